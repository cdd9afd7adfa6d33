//! Textures that are rendered to, and the way of pixels between them, buffers and the image.

use super::device::Gpu;
use super::pipelines::{COLOR_FORMAT, COVERAGE_FORMAT};
use super::rect::Rect;
use super::variant::Variant;
use crate::error::Result;
use crate::fragments::Background;

const CLEARED: wgpu::Operations<u32> =
    wgpu::Operations { load: wgpu::LoadOp::Clear(0), store: wgpu::StoreOp::Store };

/// The targets of a render: only those that the scene requires; the others are of one pixel.
pub struct Targets {
    /// The user's background, where that is an image.
    pub background: wgpu::TextureView,
    /// What opaque surfaces show, with alpha 1.
    pub opaque_color: wgpu::TextureView,
    /// What opaque geometry writes depths to, and what translucent geometry is tested against or counts in: the
    /// same, but where a shader loads the depths.
    opaque_depth: Option<(wgpu::TextureFormat, wgpu::TextureView)>,
    test: Option<(wgpu::TextureFormat, wgpu::TextureView)>,
    /// The depth alone, for a shader that compares.
    pub depth_to_load: Option<wgpu::TextureView>,
    /// What else a pass is measured by: of the build, and of a full-screen resolve.
    coverage: Option<wgpu::TextureView>,
    screen: Option<wgpu::TextureView>,
    pub bytes: u64,
}

impl Targets {
    pub fn new(gpu: &Gpu, variant: &Variant, size: (u32, u32), background: &Background<f32>) -> Result<Self> {
        // Tiles have buffers, whatever the samples.
        let samples = if variant.tiles { 1 } else { variant.layout.samples };
        let one = (1, 1);
        let mut bytes = 0;
        let mut view = |label, format: wgpu::TextureFormat, (w, h): (u32, u32), samples: u32| {
            let texture = texture(gpu, label, format, (w, h), samples);
            if (w, h) != one {
                // Stencil beside depth takes a word of its own.
                let each = format.block_copy_size(None).unwrap_or(8);
                bytes += u64::from(each) * u64::from(w) * u64::from(h) * u64::from(samples);
            }
            texture
        };
        let is_image = matches!(background, Background::Image(_));
        let user = view("background", COLOR_FORMAT, if is_image { size } else { one }, 1);
        if let Background::Image(pixels) = background {
            write_texture(gpu, &user, pixels);
        }
        let drawn = variant.hides && !variant.tiles;
        let opaque = view("opaque colour", COLOR_FORMAT, if drawn { size } else { one }, samples);
        let depth = variant.opaque_format().map(|format| view("depth", format, size, samples));
        let measured = variant.build_format().is_none() && !variant.tiles;
        let coverage = measured.then(|| view("coverage", COVERAGE_FORMAT, size, samples));
        let test = match variant.build_format() {
            same if same == variant.opaque_format() => depth.clone(),
            apart => apart.map(|format| view("stencil", format, size, samples)),
        };
        let screen = (variant.fullscreen && !variant.counts_in_stencil())
            .then(|| view("screen", COVERAGE_FORMAT, size, 1));
        let whole = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        let depth_only = |texture: &wgpu::Texture| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                aspect: wgpu::TextureAspect::DepthOnly,
                ..Default::default()
            })
        };
        Ok(Self {
            background: whole(&user),
            opaque_color: whole(&opaque),
            depth_to_load: depth.as_ref().filter(|_| variant.compares_depth()).map(depth_only),
            opaque_depth: depth.as_ref().map(|t| (t.format(), whole(t))),
            test: test.as_ref().map(|t| (t.format(), whole(t))),
            coverage: coverage.as_ref().map(whole),
            screen: screen.as_ref().map(whole),
            bytes,
        })
    }

    /// Cleared, for opaque geometry. Depth is reversed: 0 is infinitely far.
    pub fn depth_to_write(&self) -> Option<wgpu::RenderPassDepthStencilAttachment<'_>> {
        self.opaque_depth.as_ref().map(|(format, view)| wgpu::RenderPassDepthStencilAttachment {
            view,
            depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store }),
            stencil_ops: format.has_stencil_aspect().then_some(CLEARED),
        })
    }

    /// Depth as it is; the stencil starts at 0.
    pub fn depth_to_test(&self) -> Option<wgpu::RenderPassDepthStencilAttachment<'_>> {
        self.test.as_ref().map(|(format, view)| wgpu::RenderPassDepthStencilAttachment {
            view,
            depth_ops: None,
            stencil_ops: format.has_stencil_aspect().then_some(CLEARED),
        })
    }

    /// Both as they are.
    pub fn stencil_to_test(&self) -> Option<wgpu::RenderPassDepthStencilAttachment<'_>> {
        self.test.as_ref().filter(|_| self.screen.is_none()).map(|(_, view)| {
            wgpu::RenderPassDepthStencilAttachment { view, depth_ops: None, stencil_ops: None }
        })
    }

    /// The target that nothing is written to, where there is no other.
    pub fn nothing(&self) -> Option<Option<wgpu::RenderPassColorAttachment<'_>>> {
        self.coverage.as_ref().map(unwritten)
    }

    /// The same for a full-screen resolve.
    pub fn nothing_on_screen(&self) -> Option<Option<wgpu::RenderPassColorAttachment<'_>>> {
        self.screen.as_ref().map(unwritten)
    }
}

fn unwritten(view: &wgpu::TextureView) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    Some(wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
    })
}

/// To draw into and read; copied from and to, where it has one sample.
pub fn texture(
    gpu: &Gpu,
    label: &str,
    format: wgpu::TextureFormat,
    (width, height): (u32, u32),
    sample_count: u32,
) -> wgpu::Texture {
    use wgpu::TextureUsages as Usage;
    let both = Usage::RENDER_ATTACHMENT | Usage::TEXTURE_BINDING;
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: if sample_count > 1 { both } else { both | Usage::COPY_DST | Usage::COPY_SRC },
        view_formats: &[],
    })
}

fn write_texture(gpu: &Gpu, texture: &wgpu::Texture, pixels: &[[f32; 4]]) {
    gpu.queue.write_texture(
        texture.as_image_copy(),
        bytemuck::cast_slice(pixels),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(16 * texture.width()),
            rows_per_image: None,
        },
        texture.size(),
    );
}

/// Copies the rows of a rectangle, `each` values a pixel, into the whole image.
pub fn place<V: bytemuck::Pod>(words: &[u32], image: &mut [V], width: u32, rect: Rect, each: usize) {
    let w = rect.w as usize * each;
    // The buffer may be a little longer than the rectangle.
    let values = rect.pixels() as usize * each;
    let rows: &[V] = bytemuck::cast_slice(&words[..values * size_of::<V>() / 4]);
    for (row, y) in rows.chunks_exact(w).zip(rect.y0..rect.y0 + rect.h) {
        let start = (y as usize * width as usize + rect.x0 as usize) * each;
        image[start..start + w].copy_from_slice(row);
    }
}
