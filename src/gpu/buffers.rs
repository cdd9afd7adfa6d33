//! Buffers, bind groups and their layouts, without the ceremony.

use wgpu::{BindGroupLayoutEntry, BindingType, BufferBindingType, BufferUsages, ShaderStages};

use super::device::Gpu;

/// A storage buffer that can be copied from, and written by the queue.
pub fn storage(gpu: &Gpu, label: &str, bytes: u64) -> wgpu::Buffer {
    buffer(gpu, label, bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST)
}

/// A storage buffer that dispatches and draws take their sizes from.
pub fn indirect(gpu: &Gpu, label: &str, bytes: u64) -> wgpu::Buffer {
    buffer(gpu, label, bytes, BufferUsages::STORAGE | BufferUsages::INDIRECT)
}

/// A buffer that the CPU can read after a copy into it: whole colours, so that its words are colours without a copy.
pub fn readable(gpu: &Gpu, label: &str, bytes: u64) -> wgpu::Buffer {
    buffer(gpu, label, bytes.next_multiple_of(16), BufferUsages::MAP_READ | BufferUsages::COPY_DST)
}

/// A buffer with these contents.
pub fn with_contents<T: bytemuck::Pod>(
    gpu: &Gpu,
    label: &str,
    usage: BufferUsages,
    contents: &[T],
) -> wgpu::Buffer {
    let bytes: &[u8] = bytemuck::cast_slice(contents);
    let buffer = buffer(gpu, label, bytes.len() as u64, usage | BufferUsages::COPY_DST);
    if !bytes.is_empty() {
        gpu.queue.write_buffer(&buffer, 0, bytes);
    }
    buffer
}

fn buffer(gpu: &Gpu, label: &str, bytes: u64, usage: BufferUsages) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        // A binding holds at least one element, and copies come in words.
        size: bytes.max(64).next_multiple_of(4),
        usage,
        mapped_at_creation: false,
    })
}

/// One entry of a bind group layout.
#[derive(Debug, Clone, Copy)]
pub enum Slot {
    Uniform,
    Read,
    ReadWrite,
    /// A texture that is loaded, not sampled: colour or depth, of one sample or several.
    Color,
    Depth,
    Colors,
    Depths,
    /// A texture of unsigned integers.
    Words,
}

impl Slot {
    /// What a shader that reads this has for it; of buffers a uniform.
    pub fn of(bound: &Bound) -> Self {
        let Bound::Texture(view) = bound else { return Self::Uniform };
        let (format, samples) = (view.texture().format(), view.texture().sample_count());
        match (format.sample_type(None, None), samples) {
            (Some(wgpu::TextureSampleType::Uint), _) => Self::Words,
            (Some(wgpu::TextureSampleType::Depth), 1) => Self::Depth,
            (Some(wgpu::TextureSampleType::Depth), _) => Self::Depths,
            (_, 1) => Self::Color,
            _ => Self::Colors,
        }
    }
}

/// A layout with the slots at bindings 0, 1, 2, …
pub fn layout(gpu: &Gpu, label: &str, stages: ShaderStages, slots: &[Slot]) -> wgpu::BindGroupLayout {
    let slots: Vec<_> = slots.iter().map(|&slot| (slot, stages)).collect();
    layout_of(gpu, label, &slots)
}

/// The same, with the stages that see each slot.
pub fn layout_of(gpu: &Gpu, label: &str, slots: &[(Slot, ShaderStages)]) -> wgpu::BindGroupLayout {
    let buffer = |ty| BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let texture = |sample_type, multisampled| BindingType::Texture {
        sample_type,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled,
    };
    let color = wgpu::TextureSampleType::Float { filterable: false };
    let entries: Vec<_> = (0..)
        .zip(slots)
        .map(|(binding, &(slot, visibility))| BindGroupLayoutEntry {
            binding,
            visibility,
            ty: match slot {
                Slot::Uniform => buffer(BufferBindingType::Uniform),
                Slot::Read => buffer(BufferBindingType::Storage { read_only: true }),
                Slot::ReadWrite => buffer(BufferBindingType::Storage { read_only: false }),
                Slot::Color => texture(color, false),
                Slot::Depth => texture(wgpu::TextureSampleType::Depth, false),
                Slot::Colors => texture(color, true),
                Slot::Depths => texture(wgpu::TextureSampleType::Depth, true),
                Slot::Words => texture(wgpu::TextureSampleType::Uint, false),
            },
            count: None,
        })
        .collect();
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// What a slot is bound to.
pub enum Bound<'a> {
    Buffer(&'a wgpu::Buffer),
    Texture(&'a wgpu::TextureView),
}

impl<'a> From<&'a wgpu::Buffer> for Bound<'a> {
    fn from(buffer: &'a wgpu::Buffer) -> Self {
        Self::Buffer(buffer)
    }
}

impl<'a> From<&'a wgpu::TextureView> for Bound<'a> {
    fn from(view: &'a wgpu::TextureView) -> Self {
        Self::Texture(view)
    }
}

pub fn bind(gpu: &Gpu, label: &str, layout: &wgpu::BindGroupLayout, bound: &[Bound]) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(bound)
        .map(|(binding, bound)| wgpu::BindGroupEntry {
            binding,
            resource: match bound {
                Bound::Buffer(buffer) => buffer.as_entire_binding(),
                Bound::Texture(view) => wgpu::BindingResource::TextureView(view),
            },
        })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}
