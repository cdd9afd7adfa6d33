//! The stages that set up and bin triangles, and what walks over tiles then bind.

use wgpu::BufferUsages;

use super::Context;
use super::bins::{BLOCK, Bins};
use super::classes::CLASS_COUNT;
use crate::error::Result;
use crate::gpu::buffers::{Bound, bind, with_contents};
use crate::gpu::uniforms::{Eye, Grid, Window};
use crate::gpu::upload::Uploaded;

/// Workgroups that clip, of 64 invocations.
const CLIP_GROUPS: u32 = 16;

impl Bins {
    /// Sets up and bins all triangles. `eye` gets what only this knows.
    pub fn encode(
        &self,
        of: Context,
        scene: &Uploaded,
        eye: Eye,
        pass: &mut wgpu::ComputePass,
    ) -> Result<()> {
        let (gpu, view, stages) = (of.gpu, of.view, of.stages());
        let eye = Eye { triangles: self.grid.triangles, piece_capacity: self.piece_capacity, ..eye };
        let eye = with_contents(gpu, "eye", BufferUsages::UNIFORM, &[eye]);
        let grid = with_contents(gpu, "grid", BufferUsages::UNIFORM, &[self.grid]);
        let (setup, bin) = (stages.setup(gpu, of.variant())?, stages.bin(gpu, of.variant())?);
        let setup_group = bind(
            gpu,
            "tile setup",
            &stages.setup_layout,
            &[
                view.into(),
                (&eye).into(),
                (&scene.positions).into(),
                (&scene.position_rests).into(),
                (&scene.faces).into(),
                (&scene.mesh_ids).into(),
                (&scene.meshes).into(),
                (&self.rasters).into(),
                (&self.key_planes).into(),
                (&self.slopes).into(),
                (&self.pieces).into(),
                (&self.clip_list).into(),
                (&self.counters).into(),
                (&self.boxes).into(),
                (&self.color_starts).into(),
                (&self.classes).into(),
            ],
        );
        let bin_group = bind(
            gpu,
            "tile binning",
            &stages.bin_layout,
            &[
                view.into(),
                (&grid).into(),
                (&self.rasters).into(),
                (&self.pieces).into(),
                (&self.boxes).into(),
                (&self.counters).into(),
                (&self.matrix).into(),
                (&self.bins).into(),
                (&self.bin_entries).into(),
                (&self.tiles).into(),
                (&self.tile_entries).into(),
                (&self.classes).into(),
                (&self.parts).into(),
            ],
        );
        let groups = self.groups[..CLASS_COUNT].iter();
        let slots: Vec<Bound> = [&self.classes].into_iter().chain(groups).map(Into::into).collect();
        let start_group = bind(gpu, "start", &stages.start_layout, &slots);
        let Grid { triangles, bins_x, bins_y, chunks, .. } = self.grid;
        pass.set_bind_group(0, &setup_group, &[]);
        pass.set_pipeline(&setup.clear);
        pass.dispatch_workgroups(1, 1, 1);
        pass.set_pipeline(&setup.setup);
        let groups = triangles.div_ceil(BLOCK);
        let x = groups.clamp(1, gpu.limits.max_compute_workgroups_per_dimension);
        pass.dispatch_workgroups(x, groups.div_ceil(x), 1);
        pass.set_pipeline(&setup.clip);
        pass.dispatch_workgroups(CLIP_GROUPS, 1, 1);
        pass.set_bind_group(0, &bin_group, &[]);
        for (pipeline, groups) in [
            (&bin.count_bins, chunks),
            (&bin.offsets, bins_x * bins_y),
            (&bin.scatter_bins, chunks),
            (&bin.bin_tiles, bins_x * bins_y),
        ] {
            pass.set_pipeline(pipeline);
            pass.dispatch_workgroups(groups, 1, 1);
        }
        pass.set_pipeline(&bin.start);
        pass.set_bind_group(0, &start_group, &[]);
        pass.dispatch_workgroups(1, 1, 1);
        Ok(())
    }

    /// The part of the tiles' lists that a dispatch walks.
    pub fn window(&self, first: u32, count: u32) -> Window {
        let Grid { tiles_x, parts, first_row, .. } = self.grid;
        Window { first, count, tiles_x, parts, first_row, list_capacity: 0, pad0: 0, pad1: 0 }
    }

    /// What walks over tiles bind as group 0.
    pub fn walk_group(&self, of: Context, scene: &Uploaded, window: &wgpu::Buffer) -> wgpu::BindGroup {
        let slots = [
            of.view.into(),
            window.into(),
            (&self.rasters).into(),
            (&self.key_planes).into(),
            (&self.slopes).into(),
            (&self.pieces).into(),
            (&scene.faces).into(),
            (&scene.colors).into(),
            (&self.tiles).into(),
            (&self.tile_entries).into(),
            (&self.boxes).into(),
            (&self.color_starts).into(),
        ];
        bind(of.gpu, "tile walk", &of.stages().walk_layout, &slots)
    }
}
