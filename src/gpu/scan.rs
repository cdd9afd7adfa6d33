//! Exclusive prefix sums over a buffer of any length (see scan.wgsl).

use wgpu::BufferUsages;

use super::buffers::{bind, storage, with_contents};
use super::passes::Frame;
use super::timing::Timing;
use crate::error::Result;
use crate::shader::SCAN_BLOCK;

/// Replaces the first `n` words of `values` by the sums of those before each. `grand_total` (two words, cleared)
/// gets the sum of all.
pub fn encode(
    frame: &Frame,
    encoder: &mut wgpu::CommandEncoder,
    values: &wgpu::Buffer,
    n: u32,
    grand_total: &wgpu::Buffer,
    timing: &Timing,
) -> Result<()> {
    let gpu = frame.gpu;
    let pipelines = frame.pipelines.scan(gpu)?;
    // Each level's totals are the values of the next, until there is one.
    let mut levels = Vec::new();
    let mut size = n;
    let mut level_values = values.clone();
    loop {
        let blocks = size.div_ceil(SCAN_BLOCK);
        let totals = storage(gpu, "scan totals", 4 * u64::from(blocks));
        let first = u32::from(levels.is_empty());
        let sizes = with_contents(gpu, "scan size", BufferUsages::UNIFORM, &[[size, first, 0, 0]]);
        let group = bind(
            gpu,
            "scan",
            &frame.pipelines.layouts.scan,
            &[(&level_values).into(), (&totals).into(), (&sizes).into(), grand_total.into()],
        );
        levels.push((group, blocks));
        if blocks == 1 {
            break;
        }
        (size, level_values) = (blocks, totals);
    }
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
        label: Some("scan"),
        timestamp_writes: timing.compute("scan"),
    });
    let mut dispatch = |pipeline: &wgpu::ComputePipeline, (group, blocks): &(wgpu::BindGroup, u32)| {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        let x = (*blocks).min(gpu.limits.max_compute_workgroups_per_dimension);
        pass.dispatch_workgroups(x, blocks.div_ceil(x), 1);
    };
    levels.iter().for_each(|level| dispatch(&pipelines.scan, level));
    // The last level has one block, and nothing before it.
    levels.iter().rev().skip(1).for_each(|level| dispatch(&pipelines.add, level));
    Ok(())
}
