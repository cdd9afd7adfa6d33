//! The modules of a variant: which files of shaders/ each is composed of.

use super::unrolled;
use super::variant::{BuildStage, Variant};
use crate::error::Result;
use crate::frame::{Sort, Storage};
use crate::shader::{CHUNK, Composed};

impl Variant {
    pub fn nodes(&self) -> [&'static str; 2] {
        use crate::node_format::NodeFormat::*;
        let format = match self.layout.format {
            Float32 => "nodes/float32",
            Rgba8Depth32 => "nodes/rgba8_depth32",
            Rgba8Depth24Coverage8 => "nodes/rgba8_depth24_coverage8",
            Rgb565Depth16 => "nodes/rgb565_depth16",
            Rgb9e5Alpha8Depth24 => "nodes/rgb9e5_alpha8_depth24",
        };
        ["nodes/common", format]
    }

    fn varyings(&self) -> &'static str {
        if self.layout.samples > 1 { "varyings_samples" } else { "varyings" }
    }

    pub fn opaque(&self) -> Result<Composed> {
        let stage = if self.layout.samples > 1 { "opaque_samples" } else { "opaque" };
        Composed::new(self.prelude(1, 0), &["common", "raster", self.varyings(), stage])
    }

    /// A pass over the translucent geometry.
    pub fn build(&self, stage: BuildStage) -> Result<Composed> {
        let fragment = match (self.hides, self.layout.samples, self.early) {
            (false, ..) => "build/fragment",
            (true, 1, true) => "build/fragment",
            (true, 1, false) => "build/fragment_compare",
            (true, ..) => "build/fragment_samples",
        };
        let mut files = vec!["common", "raster", self.varyings(), "build/common", fragment];
        files.extend(self.nodes());
        match stage {
            BuildStage::Count => files.extend(["build/count", "build/read_none"]),
            BuildStage::Scatter => files.extend(["build/scatter", "build/write"]),
            BuildStage::Link => files.push("build/linked"),
            BuildStage::Append => files.push("build/append"),
        }
        let takes = matches!(stage, BuildStage::Link | BuildStage::Append);
        if takes {
            let counter = if self.aggregates() { "build/counter_subgroup" } else { "build/counter" };
            files.extend(["build/take", "build/write", counter]);
        }
        let mut composed = Composed::new(self.prelude(1, 0), &files)?;
        composed.push(&self.entry(takes && self.aggregates()), "entry".into());
        Ok(composed)
    }

    /// The fragment stage's entry, whose parameters and attributes are the variant's.
    fn entry(&self, aggregates: bool) -> String {
        let early = self.hides && !self.compares_depth();
        format!(
            "@fragment\n{}fn fs_build(v: Varyings, @builtin(sample_mask) mask: u32{}) {{\n{}    enter(v, mask);\n}}\n",
            if early { "@early_depth_test(force)\n" } else { "" },
            if aggregates { ", @builtin(subgroup_invocation_id) lane: u32" } else { "" },
            if aggregates { "    own_lane = lane;\n" } else { "" },
        )
    }

    pub fn gather(&self) -> Result<Composed> {
        let mut files = vec!["common", "gather"];
        files.extend(self.nodes());
        Composed::new(self.prelude(1, 0), &files)
    }

    /// The stages that read lists have these files in common.
    fn reading(&self, temp: u32, class: usize, own: &[&'static str]) -> Result<Composed> {
        let mut files = vec!["common", "resolve/read"];
        files.extend(self.nodes());
        files.push(match self.storage {
            Storage::Linked => "lists/linked",
            Storage::Contiguous => "lists/contiguous",
        });
        files.push(match (self.tiles, self.layout.samples) {
            (true, _) => "resolve/opaque_buffer",
            (false, 1) => "resolve/opaque",
            (false, _) => "resolve/opaque_samples",
        });
        if self.back_to_front() {
            files.extend(["blend/affine", "blend/back_to_front"]);
        } else if self.layout.mixed {
            files.extend(["blend/affine", "blend/compose", "blend/front_to_back"]);
        } else {
            files.extend(["methods/exact", "blend/over"]);
        }
        files.extend(own);
        let mut composed = Composed::new(self.prelude(temp, class), &files)?;
        if self.back_to_front() {
            composed.push_blends(&self.blends);
        }
        Ok(composed)
    }

    pub fn classify(&self) -> Result<Composed> {
        self.reading(1, 0, &["resolve/classes", "resolve/classify"])
    }

    pub fn average(&self) -> Result<Composed> {
        self.reading(1, 0, &["resolve/average"])
    }

    pub fn background(&self) -> Result<Composed> {
        self.reading(1, 0, &["resolve/background"])
    }

    pub fn class(&self, class: usize) -> Result<Composed> {
        let temp = self.classes[class];
        let unrolled = self.sort == Sort::Auto && self.limit.is_none() && temp <= self.longest_unrolled;
        let mut own = vec!["sort/arrays", "resolve/classes", "resolve/class"];
        if !unrolled {
            own.extend([self.sort_file(), "resolve/class_loops"]);
        }
        if self.fullscreen {
            own.extend([
                "resolve/fullscreen",
                if self.early && self.counts_in_stencil() {
                    "resolve/fullscreen_early"
                } else {
                    "resolve/fullscreen_late"
                },
            ]);
        }
        let mut composed = self.reading(temp, class, &own)?;
        if unrolled {
            composed.push(&unrolled::text(temp, self.back_to_front()), "unrolled".into());
        }
        Ok(composed)
    }

    pub fn long(&self) -> Result<Composed> {
        self.reading(CHUNK, 0, &["sort/arrays", self.sort_file(), "resolve/long", "resolve/long_blocks"])
    }

    /// Sums over a workgroup, beside "sums".
    pub fn sums_file(&self) -> &'static str {
        if self.subgroups { "sums_subgroup" } else { "sums_steps" }
    }

    /// What a method that takes modes makes of a fragment, beside "blend/compose".
    pub fn affine_file(&self) -> &'static str {
        if self.layout.mixed { "blend/affine" } else { "blend/affine_over" }
    }

    pub fn scan(&self) -> Result<Composed> {
        Composed::new(self.prelude(1, 0), &["sums", self.sums_file(), "scan"])
    }

    fn sort_file(&self) -> &'static str {
        match self.sort {
            Sort::Auto | Sort::Insertion => "sort/insertion",
            Sort::Selection => "sort/selection",
            Sort::Bitonic => "sort/bitonic",
            Sort::Merge => "sort/merge",
            Sort::Heap => "sort/heap",
        }
    }
}
