//! Textures on their way to the host: in bands of rows, each of a length that copies take.

use super::canvas::Canvas;
use super::totals::submit;
use crate::error::Result;
use crate::frame::Stats;
use crate::gpu::buffers::readable;
use crate::memory::allocate;

/// Of a band.
const MOST_BYTES: u64 = 256 << 20;

/// Encodes copies of a texture of 4 or 16 bytes a pixel into buffers that the host can read; rows of each.
pub fn copy_rows(
    canvas: &mut Canvas,
    view: &wgpu::TextureView,
    buffers: &mut Vec<wgpu::Buffer>,
) -> Result<Vec<u32>> {
    let (gpu, (width, height)) = (canvas.gpu, canvas.size);
    let each = view.texture().format().block_copy_size(None).unwrap_or(16);
    let row_bytes = (width * each).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let rows = (MOST_BYTES / u64::from(row_bytes)).clamp(1, u64::from(height)) as u32;
    let mut bands = Vec::new();
    for first in (0..height).step_by(rows as usize) {
        let rows = rows.min(height - first);
        let bytes = u64::from(row_bytes) * u64::from(rows);
        let buffer = gpu.staging.take(bytes);
        let buffer = match buffer {
            Some(buffer) => buffer,
            None => gpu.checked("the image", || Ok(readable(gpu, "image", bytes)))?,
        };
        canvas.encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                origin: wgpu::Origin3d { x: 0, y: first, z: 0 },
                ..view.texture().as_image_copy()
            },
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row_bytes),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width, height: rows, depth_or_array_layers: 1 },
        );
        buffers.push(buffer);
        bands.push(rows);
    }
    Ok(bands)
}

/// The words of each row of a band, of so many words.
pub fn each_row(words: &[u32], (row, rows): (usize, usize), mut take: impl FnMut(&[u32])) {
    let stride = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT as usize / 4);
    words.chunks(stride).take(rows).for_each(|words| take(&words[..row]));
}

/// Submits what is encoded, and reads the image that it draws.
pub fn read(canvas: &mut Canvas, view: &wgpu::TextureView, stats: &mut Stats) -> Result<Vec<[f32; 4]>> {
    let (width, height) = canvas.size;
    let mut buffers = Vec::new();
    let bands = copy_rows(canvas, view, &mut buffers)?;
    let words = submit(canvas, buffers, stats)?;
    // Poisoned: a pixel that nothing writes would show.
    let mut image = allocate("the image", width as usize * height as usize, [f32::NAN; 4])?;
    let mut to = image.chunks_exact_mut(width as usize);
    for (words, &rows) in words.iter().zip(&bands) {
        each_row(words, (4 * width as usize, rows as usize), |row| {
            if let Some(to) = to.next() {
                to.copy_from_slice(bytemuck::cast_slice(row));
            }
        });
    }
    Ok(image)
}
