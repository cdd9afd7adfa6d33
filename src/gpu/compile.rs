//! Compiles shader modules, and pipelines from them.

use std::sync::OnceLock;

use pollster::block_on;

use super::device::Gpu;
use crate::error::{Error, Result};
use crate::shader::Composed;

/// Made at the first use.
pub type Once<T> = OnceLock<T>;

/// A failure is not kept: memory may be there the next time.
pub fn once<'p, T>(gpu: &Gpu, slot: &'p Once<T>, make: impl FnOnce() -> Result<T>) -> Result<&'p T> {
    if let Some(made) = slot.get() {
        return Ok(made);
    }
    let made = gpu.checked("making pipelines", make)?;
    Ok(slot.get_or_init(|| made))
}

/// Compiles a module; what is wrong with it is told in the lines of its own files.
pub fn compile(gpu: &Gpu, name: &str, composed: &Composed) -> Result<wgpu::ShaderModule> {
    let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
    let descriptor = wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(composed.text.as_str().into()),
    };
    let module = if composed.is_trusted() {
        let unchecked = wgpu::ShaderRuntimeChecks::unchecked();
        // SAFETY: these are this crate's own shaders, and nothing of a user's. Their indices are in bounds: nodes
        // are below the pool's capacity, pixels below the band's, array entries below TEMP; spans of tiles end where
        // their buffers do; lists end, since a link leads to an older node; no divisor is zero. Without the checks a
        // resolve takes two thirds of the time (benchmarks/NOTES.md).
        unsafe { gpu.device.create_shader_module_trusted(descriptor, unchecked) }
    } else {
        gpu.device.create_shader_module(descriptor)
    };
    let Some(error) = block_on(scope.pop()) else {
        return Ok(module);
    };
    let messages = block_on(module.get_compilation_info()).messages;
    let message = messages.into_iter().find(|m| m.message_type == wgpu::CompilationMessageType::Error);
    Err(match message {
        Some(m) => composed.error(m.location.map_or(1, |l| l.line_number as usize), &m.message),
        None => Error::Device(format!("shader {name} does not compile: {error}")),
    })
}

pub fn pipeline_layout(gpu: &Gpu, groups: &[&wgpu::BindGroupLayout]) -> wgpu::PipelineLayout {
    let groups: Vec<_> = groups.iter().map(|g| Some(*g)).collect();
    gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &groups,
        immediate_size: 0,
    })
}

pub fn compute(
    gpu: &Gpu,
    module: &wgpu::ShaderModule,
    entry: &str,
    groups: &[&wgpu::BindGroupLayout],
) -> wgpu::ComputePipeline {
    compute_with(gpu, module, entry, groups, wgpu::PipelineCompilationOptions::default())
}

/// For shaders that write all workgroup memory before they read it: what clears it takes longer than they do.
pub fn compute_uncleared(
    gpu: &Gpu,
    module: &wgpu::ShaderModule,
    entry: &str,
    groups: &[&wgpu::BindGroupLayout],
) -> wgpu::ComputePipeline {
    let options =
        wgpu::PipelineCompilationOptions { zero_initialize_workgroup_memory: false, ..Default::default() };
    compute_with(gpu, module, entry, groups, options)
}

fn compute_with(
    gpu: &Gpu,
    module: &wgpu::ShaderModule,
    entry: &str,
    groups: &[&wgpu::BindGroupLayout],
    compilation_options: wgpu::PipelineCompilationOptions,
) -> wgpu::ComputePipeline {
    gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry),
        layout: Some(&pipeline_layout(gpu, groups)),
        module,
        entry_point: Some(entry),
        compilation_options,
        cache: None,
    })
}
