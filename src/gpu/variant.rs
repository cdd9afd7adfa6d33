//! What pipelines are specialised for, and the shader text that follows: constants before files, so that a scene
//! that does not need a thing does not pay for it.

use std::fmt::Write;
use std::sync::Arc;

use super::pipelines::DEPTH_FORMAT;
use crate::frame::{BlendOrder, LimitPolicy, MsaaResolve, Sort, Storage};
use crate::node_format::{NodeFormat, NodeLayout};
use crate::samples::{full, pattern};
use crate::shader::{CHUNK, LONG_BLOCK, SCAN_BLOCK};

/// How tiles find the colour of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ColorsOf {
    /// By its number.
    Triangle,
    /// One a triangle, where setup says.
    Flat,
    /// Some are interpolated.
    Corners,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Variant {
    pub colors: ColorsOf,
    /// Compute shaders rasterise.
    pub tiles: bool,
    pub storage: Storage,
    pub layout: NodeLayout,
    /// Opaque geometry hides what is behind it.
    pub hides: bool,
    pub msaa: MsaaResolve,
    pub sort: Sort,
    pub limit: Option<(u32, LimitPolicy)>,
    pub order: BlendOrder,
    /// The longest list of each class.
    pub classes: Vec<u32>,
    /// The resolve is a full-screen pass behind a stencil.
    pub fullscreen: bool,
    /// A user's blend functions, ids 5 and on.
    pub blends: Arc<[String]>,
    /// Device features: forced early depth tests, and subgroup operations.
    pub early: bool,
    pub subgroups: bool,
    /// Division is the nearest float as it is.
    pub divides_exactly: bool,
    /// Classes up to here are sorted by networks in registers, unless a sort is asked for.
    pub longest_unrolled: u32,
}

impl Variant {
    pub fn per_sample(&self) -> bool {
        self.layout.samples > 1 && self.msaa == MsaaResolve::PerSample
    }

    /// Invocations of a resolve for each of its pixels.
    pub fn invocations_per_pixel(&self) -> u32 {
        if self.per_sample() { self.layout.samples } else { 1 }
    }

    pub fn longest_class(&self) -> u32 {
        self.classes.last().copied().unwrap_or(0)
    }

    /// The opaque depth is read by the build's shader, not tested by hardware.
    pub fn compares_depth(&self) -> bool {
        self.hides && !self.tiles && (self.layout.samples > 1 || !self.early)
    }

    /// Nodes are handed out a subgroup at a time. Not behind a forced depth test: invocations that it kills take part
    /// in subgroup operations as helpers, whose writes are lost, and nothing tells them from others.
    pub fn aggregates(&self) -> bool {
        self.subgroups && (!self.hides || self.compares_depth())
    }

    /// A stencil counts fragments. Not with several samples: a resolve to one colour a pixel has a target of one
    /// sample, which no stencil of several can go with (section 2.8.3).
    pub fn counts_in_stencil(&self) -> bool {
        self.fullscreen && self.layout.samples == 1
    }

    /// Of the target that opaque geometry writes its depth to, with a stencil if translucent geometry counts there.
    pub fn opaque_format(&self) -> Option<wgpu::TextureFormat> {
        (self.hides && !self.tiles).then_some(if self.counts_in_stencil() && !self.compares_depth() {
            wgpu::TextureFormat::Depth32FloatStencil8
        } else {
            DEPTH_FORMAT
        })
    }

    /// Of the target that translucent geometry is tested against, or counts in. A shader that loads depths cannot
    /// have them in a target that it writes: then the stencil is apart.
    pub fn build_format(&self) -> Option<wgpu::TextureFormat> {
        let apart = self.counts_in_stencil() && (!self.hides || self.compares_depth());
        if apart { Some(wgpu::TextureFormat::Stencil8) } else { self.opaque_format() }
    }

    pub fn back_to_front(&self) -> bool {
        self.order == BlendOrder::BackToFront || !self.blends.is_empty()
    }

    /// The same with what nodes and their resolve are like left out, where there are none: one set of pipelines does.
    pub fn without_nodes(self) -> Self {
        let layout = NodeLayout::new(NodeFormat::Float32, 1, false, false);
        let (storage, msaa, sort) = (Storage::Contiguous, MsaaResolve::PerPixel, Sort::Auto);
        let classes = vec![1]; // the shader text has one
        Self { layout, storage, msaa, sort, classes, fullscreen: false, ..self }
    }

    /// The same with how lists are stored, sorted and limited left out, where there are none.
    pub fn without_lists(self) -> Self {
        let layout = NodeLayout::new(NodeFormat::Float32, self.layout.samples, self.layout.mixed, false);
        let (msaa, hides) = (self.msaa, self.hides);
        Self { layout, msaa, hides, limit: None, order: BlendOrder::FrontToBack, ..self.without_nodes() }
    }

    /// `temp`: entries of the temporary array. `class`: which class's, where it is one.
    pub fn prelude(&self, temp: u32, class: usize) -> String {
        let layout = &self.layout;
        let samples = layout.samples;
        let mut text = String::new();
        let mut constant = |name: &str, value: String| {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "const {name} = {value};");
        };
        let unsigned = |value: u32| format!("{value}u");
        constant("SAMPLES", unsigned(samples));
        constant("FULL_MASK", unsigned(full(samples)));
        let positions: Vec<_> = pattern(samples)
            .iter()
            .map(|&(x, y)| format!("vec2f({:?}, {:?})", x as f32 / 16.0, y as f32 / 16.0))
            .collect();
        constant("PATTERN", format!("array<vec2f, {samples}>({})", positions.join(", ")));
        let offsets: Vec<_> = pattern(samples).iter().map(|(x, y)| format!("vec2i({x}, {y})")).collect();
        constant("SAMPLE_OFFSETS", format!("array<vec2i, {samples}>({})", offsets.join(", ")));
        constant("COLORS_BY_TRIANGLE", (self.colors == ColorsOf::Triangle).to_string());
        constant("HAS_GRADIENTS", (self.colors == ColorsOf::Corners).to_string());
        constant("DIVIDES_EXACTLY", self.divides_exactly.to_string());
        constant("MIXED", layout.mixed.to_string());
        constant("HAS_ORDER", layout.has_order.to_string());
        constant("HAS_COVERAGE", layout.has_coverage.to_string());
        constant("BASE_WORDS", unsigned(layout.format.base_words()));
        constant("NODE_WORDS", unsigned(layout.words()));
        constant("ORDER_WORD", unsigned(layout.order_word()));
        constant("COVERAGE_WORD", unsigned(layout.coverage_word()));
        constant("LAST_CODE", unsigned(layout.format.last_code().unwrap_or(0)));
        constant("HIDES", self.hides.to_string());
        constant("USER_BLENDS", (!self.blends.is_empty()).to_string());
        constant("BACK_TO_FRONT", self.back_to_front().to_string());
        constant("PER_SAMPLE", self.per_sample().to_string());
        constant("INVOCATIONS_PER_PIXEL", unsigned(self.invocations_per_pixel()));
        for (i, name) in ["MSAA_MEAN", "MSAA_HDR", "MSAA_NONE"].into_iter().enumerate() {
            constant(name, unsigned(i as u32));
        }
        let msaa = match self.msaa {
            MsaaResolve::PerSample | MsaaResolve::PerPixel => 0,
            MsaaResolve::Hdr => 1,
            MsaaResolve::None => 2,
        };
        constant("MSAA_RESOLVE", unsigned(msaa));
        let count = self.classes.len() as u32;
        constant("CLASS_COUNT", unsigned(count));
        constant("CLASS_SLOTS", unsigned(count + 1));
        constant("LONGEST_CLASS", unsigned(self.longest_class()));
        constant("CLASS", unsigned(class as u32));
        constant("CLASS_ABOVE", unsigned(if class == 0 { 0 } else { self.classes[class - 1] }));
        constant("TEMP", unsigned(temp));
        constant("CHUNK", unsigned(CHUNK));
        constant("LONG_BLOCK", unsigned(LONG_BLOCK));
        constant("SCAN_BLOCK", unsigned(SCAN_BLOCK));
        constant("LIMIT", unsigned(self.limit.map_or(0, |(n, _)| n)));
        let last = matches!(self.limit, Some((_, LimitPolicy::LastSubmitted)));
        constant("LIMIT_LAST", last.to_string());
        // Written out: an indexed array of bounds would be memory.
        let above: Vec<_> = self.classes.iter().map(|bound| format!("u32(n > {bound}u)")).collect();
        let _ = writeln!(text, "fn class_of(n: u32) -> u32 {{ return {}; }}", above.join(" + "));
        text
    }
}

/// What a pass over the translucent geometry does with fragments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BuildStage {
    Link,
    Append,
    Count,
    Scatter,
}

#[cfg(test)]
pub mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::*;
    use crate::gpu::{hardware, tiles};
    use crate::node_format::NodeFormat;
    use crate::shader::Composed;

    pub fn plain() -> Variant {
        Variant {
            colors: ColorsOf::Corners,
            tiles: false,
            divides_exactly: false,
            storage: Storage::Linked,
            layout: NodeLayout::new(NodeFormat::Float32, 1, false, false),
            hides: false,
            msaa: MsaaResolve::PerPixel,
            sort: Sort::Auto,
            limit: None,
            order: BlendOrder::FrontToBack,
            classes: vec![1, 4, 8, 16, 32],
            fullscreen: false,
            blends: Arc::new([]),
            early: true,
            subgroups: false,
            longest_unrolled: 16,
        }
    }

    fn validate(name: &str, composed: &Composed) {
        let text = &composed.text;
        let module = naga::front::wgsl::parse_str(text)
            .unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(text)));
        let needs = Capabilities::EARLY_DEPTH_TEST
            | Capabilities::MULTISAMPLED_SHADING
            | Capabilities::SUBGROUP
            | Capabilities::SUBGROUP_BARRIER;
        let mut validator = Validator::new(ValidationFlags::all(), needs);
        validator
            .subgroup_stages(naga::valid::ShaderStages::all())
            .subgroup_operations(naga::valid::SubgroupOperationSet::all());
        validator.validate(&module).unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(text)));
    }

    /// One of each choice, most of them together at least once.
    fn variants() -> Vec<Variant> {
        let mut all = vec![plain()];
        for format in NodeFormat::ALL {
            for samples in [1, 4, 8, 16] {
                for mixed in [false, true] {
                    let layout = NodeLayout::new(format, samples, mixed, samples == 8);
                    all.push(Variant { layout, hides: mixed, subgroups: samples == 1, ..plain() });
                }
            }
        }
        for sort in [Sort::Insertion, Sort::Selection, Sort::Bitonic, Sort::Merge, Sort::Heap] {
            all.push(Variant {
                sort,
                storage: Storage::Contiguous,
                early: false,
                hides: true,
                fullscreen: true,
                ..plain()
            });
        }
        let many = NodeLayout::new(NodeFormat::Float32, 4, true, false);
        for msaa in [MsaaResolve::PerSample, MsaaResolve::Hdr, MsaaResolve::None] {
            all.push(Variant { msaa, hides: true, fullscreen: true, ..plain() });
            let order = BlendOrder::BackToFront;
            all.push(Variant { msaa, order, layout: many, fullscreen: true, ..plain() });
        }
        for policy in [LimitPolicy::Nearest, LimitPolicy::LastSubmitted] {
            all.push(Variant { limit: Some((18, policy)), layout: many, ..plain() });
        }
        let blends = Arc::new(["return dst + src.rgb * depth;".to_string(), "dst * src.rgb".to_string()]);
        let checked = |(i, b): (usize, &String)| crate::shader::user_blend(i, "blend", b).unwrap();
        let blends = blends.iter().enumerate().map(checked).collect();
        all.push(Variant { tiles: true, hides: true, divides_exactly: true, subgroups: true, ..plain() });
        all.push(Variant { tiles: true, colors: ColorsOf::Triangle, ..plain() });
        all.push(Variant { tiles: true, colors: ColorsOf::Flat, layout: many, ..plain() });
        all.push(Variant { blends, layout: NodeLayout::new(NodeFormat::Float32, 1, true, false), ..plain() });
        all
    }

    /// Of tiles, and of what the hardware draws of methods.
    fn rasterised(v: &Variant) -> impl Iterator<Item = Composed> {
        tiles::modules(v).into_iter().chain(hardware::modules(v))
    }

    #[test]
    fn every_module_of_every_variant_is_valid() {
        for v in variants() {
            let modules = [
                v.opaque(),
                v.build(BuildStage::Link),
                v.build(BuildStage::Append),
                v.gather(),
                v.build(BuildStage::Count),
                v.build(BuildStage::Scatter),
                v.classify(),
                v.class(1),
                v.average(),
                v.background(),
                v.long(),
                v.scan(),
            ];
            for (i, module) in modules.into_iter().map(Result::unwrap).chain(rasterised(&v)).enumerate() {
                validate(&format!("module {i} of {v:?}"), &module);
            }
        }
    }

    #[test]
    fn every_shader_file_is_in_some_module() {
        let mut used = Vec::new();
        for v in variants() {
            let stages = [BuildStage::Link, BuildStage::Append, BuildStage::Count, BuildStage::Scatter];
            let built = stages.map(|s| v.build(s));
            let read = [
                v.opaque(),
                v.classify(),
                v.class(0),
                v.average(),
                v.background(),
                v.long(),
                v.scan(),
                v.gather(),
            ];
            let listed = built.into_iter().chain(read).map(Result::unwrap);
            used.extend(listed.chain(rasterised(&v)).flat_map(|m| m.files()));
        }
        for (name, _) in crate::shader::SOURCES {
            assert!(used.contains(&format!("{name}.wgsl")), "{name} is in no module");
        }
    }
}
