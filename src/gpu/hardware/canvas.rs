//! What native forms draw with: the scene, targets, and passes over both.

use wgpu::BufferUsages;

use super::stages::{Depth, Drawing, Features, For, SCREEN, Stages};
use crate::error::Result;
use crate::frame::Request;
use crate::gpu::buffers::{Bound, bind, with_contents};
use crate::gpu::device::Gpu;
use crate::gpu::pipelines::{COLOR_FORMAT, DEPTH_FORMAT};
use crate::gpu::targets::texture;
use crate::gpu::tiles::Ready;
use crate::gpu::timing::Timing;
use crate::gpu::uniforms::MethodUniform;
use crate::methods::Method;
use crate::scene::{Cull, Scene};

/// Passes of a frame that are timed.
pub const MOST_TIMED: u32 = 2048;

pub struct Canvas<'a> {
    pub gpu: &'a Gpu,
    pub stages: &'a Stages,
    pub size: (u32, u32),
    pub encoder: wgpu::CommandEncoder,
    pub timing: Timing,
    /// Passes over translucent geometry.
    pub drawn: u32,
    /// Of all targets.
    pub bytes: u64,
    /// The format of colours that fragments are drawn as, and of their sums.
    pub colors: wgpu::TextureFormat,
    pub method: &'a Method,
    made_for: For<'a>,
    vertices: u32,
    scene: wgpu::BindGroup,
    behind: wgpu::BindGroup,
    opaque_color: wgpu::TextureView,
    /// What opaque surfaces hide by, of one sample; one pixel, and unread, where there are none.
    pub opaque_depth: wgpu::TextureView,
}

/// A target, how what is drawn blends into it, and what it is cleared to before; it is not where that is `None`.
pub struct Target<'a> {
    pub view: &'a wgpu::TextureView,
    pub blend: Option<wgpu::BlendState>,
    pub clear: Option<wgpu::Color>,
}

const fn blend(
    color: (wgpu::BlendFactor, wgpu::BlendFactor),
    alpha: (wgpu::BlendFactor, wgpu::BlendFactor),
    operation: wgpu::BlendOperation,
) -> Option<wgpu::BlendState> {
    Some(wgpu::BlendState {
        color: wgpu::BlendComponent { src_factor: color.0, dst_factor: color.1, operation },
        alpha: wgpu::BlendComponent { src_factor: alpha.0, dst_factor: alpha.1, operation },
    })
}

use wgpu::BlendFactor::{DstAlpha, One, OneMinusSrcAlpha, Zero};
use wgpu::BlendOperation as Op;

pub const ADD: Option<wgpu::BlendState> = blend((One, One), (One, One), Op::Add);
/// Premultiplied, in front of what is there.
pub const OVER: Option<wgpu::BlendState> = blend((One, OneMinusSrcAlpha), (One, OneMinusSrcAlpha), Op::Add);
/// Premultiplied, behind what is there, whose transmittance lies in alpha.
pub const UNDER: Option<wgpu::BlendState> = blend((DstAlpha, One), (Zero, OneMinusSrcAlpha), Op::Add);
/// What is there, less what alpha covers of it.
pub const FADE: Option<wgpu::BlendState> = blend((Zero, OneMinusSrcAlpha), (Zero, OneMinusSrcAlpha), Op::Add);
pub const MAX: Option<wgpu::BlendState> = blend((One, One), (One, One), Op::Max);

pub const CLEAR: wgpu::Color = wgpu::Color::TRANSPARENT;
/// All is let through.
pub const OPEN: wgpu::Color = wgpu::Color::BLACK; // alpha 1
pub const ONES: wgpu::Color = wgpu::Color::WHITE;

impl<'a> Target<'a> {
    pub fn new(view: &'a wgpu::TextureView, blend: Option<wgpu::BlendState>, clear: wgpu::Color) -> Self {
        Self { view, blend, clear: Some(clear) }
    }

    /// With what earlier passes left there.
    pub fn more(view: &'a wgpu::TextureView, blend: Option<wgpu::BlendState>) -> Self {
        Self { view, blend, clear: None }
    }

    pub fn state(&self) -> Option<wgpu::ColorTargetState> {
        let format = self.view.texture().format();
        Some(wgpu::ColorTargetState { format, blend: self.blend, write_mask: wgpu::ColorWrites::ALL })
    }
}

impl<'a> Canvas<'a> {
    pub fn new(ready: &'a Ready, scene: &Scene, request: &'a Request) -> Result<Self> {
        let method = &request.method;
        let of = ready.context();
        let gpu = of.gpu;
        let stages = &of.pipelines.hardware;
        let meshes = || scene.meshes.iter().filter(|mesh| mesh.face_count() > 0);
        let features = Features {
            culls: meshes().any(|mesh| mesh.cull != Cull::None),
            cuts_out: meshes().any(|mesh| mesh.alpha_cutoff > 0.0),
            half_targets: request.half_targets,
        };
        let variant = ready.variant();
        gpu.checked("the targets", || {
            let (passes, _) = method.work(0);
            let uniform = MethodUniform::new(method, 0, passes);
            let uniform = with_contents(gpu, "method", BufferUsages::UNIFORM, &[uniform]);
            let eye = with_contents(gpu, "eye", BufferUsages::UNIFORM, &[ready.eye]);
            let own = &ready.scene;
            let scene = [
                (&ready.view).into(),
                (&eye).into(),
                (&uniform).into(),
                (&own.positions).into(),
                (&own.position_rests).into(),
                (&own.faces).into(),
                (&own.mesh_ids).into(),
                (&own.meshes).into(),
                (&own.colors).into(),
            ];
            let scene = bind(gpu, "drawn scene", &stages.scene_layout, &scene);
            let mut bytes = 0;
            let size = if variant.hides { ready.size } else { (1, 1) };
            let opaque_color = counted(gpu, "opaque colour", COLOR_FORMAT, size, 1, &mut bytes);
            let opaque_depth = counted(gpu, "opaque depth", DEPTH_FORMAT, size, 1, &mut bytes);
            let behind = [(&ready.background).into(), (&opaque_color).into()];
            Ok(Self {
                gpu,
                stages,
                size: ready.size,
                encoder: gpu.device.create_command_encoder(&Default::default()),
                timing: Timing::of(gpu, MOST_TIMED),
                drawn: 0,
                bytes,
                colors: if request.half_targets { wgpu::TextureFormat::Rgba16Float } else { COLOR_FORMAT },
                method,
                made_for: For { variant, method, features },
                vertices: 3 * own.triangles,
                scene,
                behind: bind(gpu, "behind", &stages.behind_layout, &behind),
                opaque_color,
                opaque_depth,
            })
        })
    }

    /// There is opaque geometry.
    pub fn hides(&self) -> bool {
        self.made_for.variant.hides
    }

    /// A texture of the image's size, to draw into and read.
    pub fn texture(
        &mut self,
        label: &str,
        format: wgpu::TextureFormat,
        samples: u32,
    ) -> Result<wgpu::TextureView> {
        let (gpu, size) = (self.gpu, self.size);
        gpu.checked("the targets", || Ok(counted(gpu, label, format, size, samples, &mut self.bytes)))
    }

    /// A pass over opaque geometry, where there is some.
    pub fn draw_opaque(&mut self) -> Result<()> {
        if !self.hides() {
            return Ok(());
        }
        let (color, depth) = (self.opaque_color.clone(), self.opaque_depth.clone());
        let drawing = Drawing {
            vertex: "vs_opaque",
            fragment: "fs_opaque",
            targets: &[Target::new(&color, None, CLEAR)],
            depth: Depth::Written,
            samples: 1,
            reads: &[],
        };
        self.pass("opaque", &drawing, Some((&depth, Some(0.0))))
    }

    /// A pass over translucent geometry that opaque surfaces hide.
    pub fn draw(
        &mut self,
        stage: &'static str,
        fragment: &'static str,
        targets: &[Target],
        reads: &[Bound],
    ) -> Result<()> {
        let depth = self.opaque_depth.clone();
        let drawing = Drawing {
            vertex: "vs_translucent",
            fragment,
            targets,
            depth: if self.hides() { Depth::Tested } else { Depth::None },
            samples: 1,
            reads,
        };
        self.drawn += u32::from(stage != "count");
        self.pass(stage, &drawing, self.hides().then_some((&depth, None)))
    }

    /// A pass that clears alone.
    pub fn clear(&mut self, stage: &'static str, targets: &[Target]) {
        self.encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(stage),
            color_attachments: &attachments(targets),
            timestamp_writes: self.timing.render(stage),
            ..Default::default()
        });
    }

    /// A pass over all pixels.
    pub fn screen(
        &mut self,
        stage: &'static str,
        fragment: &'static str,
        targets: &[Target],
        reads: &[Bound],
    ) -> Result<()> {
        let drawing = Drawing { vertex: SCREEN, fragment, targets, depth: Depth::None, samples: 1, reads };
        self.pass(stage, &drawing, None)
    }

    /// `depth`: the depth target, and what it is cleared to before; it is not where that is `None`.
    pub fn pass(
        &mut self,
        stage: &'static str,
        of: &Drawing,
        depth: Option<(&wgpu::TextureView, Option<f32>)>,
    ) -> Result<()> {
        let gpu = self.gpu;
        let pass = self.stages.pass(gpu, self.made_for, of)?;
        let reads = bind(gpu, of.fragment, &pass.reads, of.reads);
        let depth = depth.map(|(view, clear)| wgpu::RenderPassDepthStencilAttachment {
            view,
            // Read alone where it is not written: other passes may load it.
            depth_ops: (of.depth == Depth::Written).then(|| wgpu::Operations {
                load: clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear),
                store: wgpu::StoreOp::Store,
            }),
            stencil_ops: None,
        });
        let mut drawing = self.encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(stage),
            color_attachments: &attachments(of.targets),
            depth_stencil_attachment: depth,
            timestamp_writes: self.timing.render(stage),
            ..Default::default()
        });
        drawing.set_pipeline(&pass.pipeline);
        drawing.set_bind_group(0, &self.scene, &[]);
        drawing.set_bind_group(1, &reads, &[]);
        if of.vertex == SCREEN {
            drawing.set_bind_group(2, &self.behind, &[]);
            drawing.draw(0..3, 0..1);
        } else {
            drawing.draw(0..self.vertices, 0..1);
        }
        Ok(())
    }
}

fn attachments<'a>(targets: &[Target<'a>]) -> Vec<Option<wgpu::RenderPassColorAttachment<'a>>> {
    let attachment = |target: &Target<'a>| wgpu::RenderPassColorAttachment {
        view: target.view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load: target.clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear),
            store: wgpu::StoreOp::Store,
        },
    };
    targets.iter().map(|target| Some(attachment(target))).collect()
}

/// One that counts among `bytes`.
fn counted(
    gpu: &Gpu,
    label: &str,
    format: wgpu::TextureFormat,
    size: (u32, u32),
    samples: u32,
    bytes: &mut u64,
) -> wgpu::TextureView {
    let each = u64::from(format.block_copy_size(None).unwrap_or(4));
    *bytes += each * u64::from(size.0) * u64::from(size.1) * u64::from(samples);
    texture(gpu, label, format, size, samples).create_view(&Default::default())
}
