//! What opaque surfaces leave: of each sample the nearest one's key, and its colour.

use super::Context;
use crate::error::{Error, Result};
use crate::gpu::buffers::{bind, storage};
use crate::gpu::device::Gpu;
use crate::gpu::variant::Variant;

/// Pixels, and samples of each that something hides in.
#[derive(PartialEq)]
pub struct OpaqueKey((u32, u32), u32);

impl OpaqueKey {
    pub fn of(variant: &Variant, size: (u32, u32)) -> Self {
        Self(size, if variant.hides { variant.layout.samples } else { 0 })
    }
}

pub struct Opaque {
    keys: wgpu::Buffer,
    pub colors: wgpu::Buffer,
}

impl Opaque {
    /// Empty where nothing hides.
    pub fn new(gpu: &Gpu, key: &OpaqueKey) -> Result<Self> {
        let OpaqueKey((width, height), samples) = *key;
        let all = u64::from(width) * u64::from(height) * u64::from(samples);
        let limit = gpu.adapter.max_binding;
        if 16 * all > limit {
            return Err(Error::Unsupported(format!(
                "{} binds {limit} bytes at once, and opaque surfaces of {width}×{height} pixels take {}; \
                 pipeline=\"linked_list\" and device=\"cpu\" take more",
                gpu.adapter.name,
                16 * all
            )));
        }
        gpu.checked("opaque surfaces", || {
            Ok(Self {
                keys: storage(gpu, "opaque keys", 4 * all),
                colors: storage(gpu, "opaque colours", 16 * all),
            })
        })
    }

    pub fn bytes(&self) -> u64 {
        self.keys.size() + self.colors.size()
    }

    /// The walk over opaque geometry, but for what is walked: its pipeline and group 1.
    pub fn set_walk(&self, of: Context, pass: &mut wgpu::ComputePass) -> Result<()> {
        let stages = of.stages();
        pass.set_pipeline(stages.opaque(of.gpu, of.variant())?);
        pass.set_bind_group(1, &self.group(of, &stages.opaque_layout), &[]);
        Ok(())
    }

    /// Group 2 of the walks that come after it, where something hides.
    pub fn set_read(&self, of: Context, pass: &mut wgpu::ComputePass) {
        if of.variant().hides {
            pass.set_bind_group(2, &self.group(of, &of.stages().read_opaque_layout), &[]);
        }
    }

    fn group(&self, of: Context, layout: &wgpu::BindGroupLayout) -> wgpu::BindGroup {
        bind(of.gpu, "opaque", layout, &[(&self.keys).into(), (&self.colors).into()])
    }
}
