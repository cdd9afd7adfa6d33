//! Textures that are rendered to, and the way of pixels between them, buffers and the image.

use super::buffers::readable;
use super::device::Gpu;
use super::pool::Rect;
use crate::error::Result;

pub fn texture(
    gpu: &Gpu,
    label: &str,
    format: wgpu::TextureFormat,
    width: u32,
    height: u32,
) -> wgpu::Texture {
    use wgpu::TextureUsages as Usage;
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: Usage::RENDER_ATTACHMENT | Usage::TEXTURE_BINDING | Usage::COPY_SRC | Usage::COPY_DST,
        view_formats: &[],
    })
}

pub fn write_texture(gpu: &Gpu, texture: &wgpu::Texture, pixels: &[[f32; 4]], width: u32, height: u32) {
    gpu.queue.write_texture(
        texture.as_image_copy(),
        bytemuck::cast_slice(pixels),
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(16 * width), rows_per_image: None },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
}

/// The pixels of an RGBA float32 texture.
pub fn read_texture(gpu: &Gpu, texture: &wgpu::Texture) -> Result<Vec<[f32; 4]>> {
    let (width, height) = (texture.width(), texture.height());
    // Copies of textures come in rows of a multiple of 256 bytes.
    let row = (16 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let buffer = gpu.checked("reading the background", || {
        let buffer = readable(gpu, "background", u64::from(row) * u64::from(height));
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        Ok(buffer)
    })?;
    let words = gpu.submit_and_read(encoder, &[&buffer])?.remove(0);
    let mut pixels = Vec::with_capacity(width as usize * height as usize);
    for line in words.chunks_exact(row as usize / 4) {
        pixels.extend_from_slice(bytemuck::cast_slice::<u32, [f32; 4]>(&line[..4 * width as usize]));
    }
    Ok(pixels)
}

/// Copies the rows of a rectangle into the whole image.
pub fn place<V: bytemuck::Pod>(words: &[u32], image: &mut [V], width: u32, rect: Rect) {
    let w = rect.w as usize;
    // The buffer may be a little longer than the rectangle.
    let pixels = rect.pixels() as usize;
    let rows: &[V] = bytemuck::cast_slice(&words[..pixels * size_of::<V>() / 4]);
    for (row, y) in rows.chunks_exact(w).zip(rect.y0..rect.y0 + rect.h) {
        let start = y as usize * width as usize + rect.x0 as usize;
        image[start..start + w].copy_from_slice(row);
    }
}
