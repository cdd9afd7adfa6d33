//! Shader text: WGSL files put together by plain concatenation (module scope has no order), after a prelude
//! of constants that Rust knows too.

mod user;

use std::borrow::Cow;

use crate::error::{Error, Result};
pub use user::{for_methods, has_loop, user_blend, user_method};

/// Entries of a long list that one invocation sorts or merges.
pub const CHUNK: u32 = 32;
/// Entries of a long list that a workgroup sorts: eight bytes each, of the 16 KiB that every device has.
pub const LONG_BLOCK: u32 = 63 * CHUNK;
/// Values that a workgroup of the prefix sum takes.
pub const SCAN_BLOCK: u32 = 1024;

macro_rules! sources {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../shaders/", $name, ".wgsl")))),*]
    };
}

/// Every shader file, by name.
pub static SOURCES: &[(&str, &str)] = sources![
    "common",
    "exact",
    "raster",
    "varyings",
    "varyings_samples",
    "opaque",
    "opaque_samples",
    "nodes/common",
    "nodes/float32",
    "nodes/rgba8_depth32",
    "nodes/rgba8_depth24_coverage8",
    "nodes/rgb565_depth16",
    "nodes/rgb9e5_alpha8_depth24",
    "build/common",
    "build/write",
    "build/read_none",
    "build/linked",
    "build/append",
    "build/take",
    "build/counter",
    "build/counter_subgroup",
    "build/count",
    "build/scatter",
    "build/fragment",
    "build/fragment_compare",
    "build/fragment_samples",
    "sums",
    "sums_steps",
    "sums_subgroup",
    "scan",
    "gather",
    "lists/linked",
    "lists/contiguous",
    "resolve/read",
    "resolve/opaque",
    "resolve/opaque_samples",
    "resolve/opaque_buffer",
    "resolve/classes",
    "resolve/classify",
    "resolve/class",
    "resolve/class_loops",
    "resolve/average",
    "resolve/fullscreen",
    "resolve/fullscreen_early",
    "resolve/fullscreen_late",
    "resolve/background",
    "resolve/long",
    "resolve/long_blocks",
    "sort/arrays",
    "sort/insertion",
    "sort/selection",
    "sort/bitonic",
    "sort/merge",
    "sort/heap",
    "blend/over",
    "blend/affine",
    "blend/affine_over",
    "blend/compose",
    "blend/front_to_back",
    "blend/back_to_front",
    "methods/exact",
    "methods/common/fragment",
    "methods/common/layer",
    "methods/common/absorbance",
    "methods/common/slots",
    "methods/common/nearest",
    "methods/bounds",
    "methods/common/window",
    "methods/additive",
    "methods/depth_peeling",
    "methods/dual_depth_peeling",
    "methods/common/depth",
    "methods/common/shade",
    "methods/common/interpolation",
    "methods/common/roots",
    "methods/common/power_moments",
    "methods/common/trigonometric_moments",
    "methods/k_buffer",
    "methods/phenomenological",
    "methods/unsorted",
    "methods/mlab",
    "methods/hybrid",
    "methods/adaptive",
    "methods/bucket_peeling",
    "methods/stencil_routed",
    "methods/weighted_average",
    "methods/weighted_sum",
    "methods/wboit",
    "methods/wavelet",
    "methods/fourier",
    "methods/stochastic",
    "methods/mboit",
    "tiles/triangle",
    "tiles/scene",
    "tiles/setup",
    "tiles/planes",
    "tiles/clip",
    "tiles/edges",
    "tiles/bin",
    "tiles/bin_chunks",
    "tiles/bin_tiles",
    "tiles/walk",
    "tiles/listed",
    "tiles/listed_none",
    "tiles/lists",
    "tiles/opaque",
    "tiles/keep",
    "tiles/hidden",
    "tiles/hidden_none",
    "tiles/classes",
    "tiles/start",
    "tiles/resolve",
    "tiles/gather_masks",
    "tiles/gather_staged",
    "tiles/composite_staged",
    "tiles/composite_taken",
    "tiles/gather_triangles",
    "tiles/gather_deep",
    "tiles/block",
    "tiles/places",
    "tiles/widest",
    "tiles/widest_subgroup",
    "tiles/opaque_read",
    "tiles/opaque_none",
    "tiles/blending",
    "tiles/stream",
    "hardware/raster",
    "hardware/screen",
    "hardware/coverage",
    "hardware/absorbed",
    "hardware/blended",
    "hardware/blended_second",
    "hardware/additive",
    "hardware/unsorted",
    "hardware/weighted_average",
    "hardware/wboit",
    "hardware/mboit",
    "hardware/power_moments",
    "hardware/trigonometric_moments",
    "hardware/stochastic",
    "hardware/stochastic_composite",
    "hardware/depth_peeling",
    "hardware/peeled_under",
    "hardware/peeled_composite",
    "hardware/dual_depth_peeling",
    "hardware/dual_merge",
    "hardware/dual_composite",
    "hardware/totals",
];

/// A module's text, and where each file starts in it.
#[derive(Debug)]
pub struct Composed {
    pub text: String,
    starts: Vec<(usize, String)>,
    has_foreign: bool,
}

impl Composed {
    /// Constants, then files. Files in the folder that `ABUFFER_SHADER_DIR` names replace ours, for trying a
    /// change without building.
    pub fn new(constants: String, files: &[&str]) -> Result<Self> {
        let foreign = std::env::var_os("ABUFFER_SHADER_DIR").is_some();
        let mut composed = Self { text: constants, starts: Vec::new(), has_foreign: foreign };
        for file in files {
            let (source, origin) = source(file)?;
            composed.push(&source, origin);
        }
        Ok(composed)
    }

    pub fn push(&mut self, source: &str, origin: String) {
        self.starts.push((self.text.lines().count(), origin));
        self.text.push_str(source);
        self.text.push('\n');
    }

    /// A user's text.
    pub fn push_foreign(&mut self, source: &str, origin: &str) {
        self.has_foreign = true;
        self.push(source, origin.into());
    }

    /// All of it is this crate's own, as it was built.
    pub fn is_trusted(&self) -> bool {
        !self.has_foreign
    }

    /// Where the text came from.
    pub fn files(&self) -> Vec<String> {
        self.starts.iter().map(|(_, origin)| origin.clone()).collect()
    }

    /// A user's blends, and what chooses between them.
    pub fn push_blends(&mut self, blends: &[String]) {
        self.has_foreign |= !blends.is_empty();
        for blend in blends {
            self.push(blend, "blend".into());
        }
        let cases: String = (0..blends.len())
            .map(|i| format!("case {i}u: {{ return blended_{i}(destination, source, depth); }}\n"))
            .collect();
        self.push(
            &format!(
                "fn user_blend(i: u32, destination: vec4f, source: vec4f, depth: f32) -> vec4f {{\n\
                 switch i {{\n{cases}default: {{ return destination; }}\n}}\n}}"
            ),
            "blends".into(),
        );
    }

    /// A compiler's complaint about line `line` (from 1) of the composed text, in the file that it came from.
    pub fn error(&self, line: usize, message: &str) -> Error {
        let before = (0, "prelude".to_string());
        let (start, file) = self.starts.iter().rev().find(|(start, _)| *start < line).unwrap_or(&before);
        // What follows the first line draws the composed text, with its line numbers.
        let message = message.lines().map(str::trim).find(|l| !l.is_empty()).unwrap_or_default();
        let message = message.rsplit_once("parsing error: ").map_or(message, |(_, what)| what);
        let own = self.text.lines().nth(line - 1).unwrap_or_default().trim();
        Error::Shader { file: file.clone(), line: line - start, message: format!("{message}, in `{own}`") }
    }
}

fn source(name: &str) -> Result<(Cow<'static, str>, String)> {
    let file = format!("{name}.wgsl");
    if let Some(folder) = std::env::var_os("ABUFFER_SHADER_DIR") {
        let path = std::path::Path::new(&folder).join(&file);
        if path.exists() {
            let text = std::fs::read_to_string(&path)
                .map_err(|e| Error::Parameter(format!("cannot read {}: {e}", path.display())))?;
            return Ok((text.into(), path.display().to_string()));
        }
    }
    let text = SOURCES.iter().find(|(n, _)| *n == name).map_or("", |(_, text)| text);
    Ok((text.into(), file))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_told_in_the_lines_of_their_own_file() {
        let composed = Composed::new("const A = 1;\n".into(), &["common", "sort/heap"]).unwrap();
        let line = composed.text.lines().position(|l| l.contains("fn sift")).unwrap() + 1;
        let own = SOURCES.iter().find(|(n, _)| *n == "sort/heap").unwrap().1;
        let wanted = own.lines().position(|l| l.contains("fn sift")).unwrap() + 1;
        match composed.error(line, "bad") {
            Error::Shader { file, line, .. } => assert_eq!((file.as_str(), line), ("sort/heap.wgsl", wanted)),
            other => panic!("{other:?}"),
        }
    }
}
