//! Shader text: WGSL files put together by plain concatenation (module scope has no order), after a prelude
//! of constants that Rust knows too.

use std::borrow::Cow;

use crate::error::{Error, Result};

/// Entries of a long list that one invocation sorts or merges.
pub const CHUNK: u32 = 32;
/// Entries of a long list that a workgroup sorts: eight bytes each, of the 16 KiB that every device has.
pub const LONG_BLOCK: u32 = 63 * CHUNK;
/// Values that a workgroup of the prefix sum takes.
pub const SCAN_BLOCK: u32 = 1024;

macro_rules! sources {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../shaders/", $name, ".wgsl")))),*]
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

/// A user's blend, number `i`: an expression or a function body over `dst`, `src` and `depth`. It is checked here,
/// by itself, so that what is wrong with it is told in its own lines, on any device or none.
pub fn user_blend(i: usize, name: &str, text: &str) -> Result<String> {
    let is_body = text.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == "return");
    let body = if is_body { text.to_string() } else { format!("return ({text}\n);") };
    let lines_before = 1;
    let function = |returns: &str| {
        format!("fn own_blend_{i}(dst: vec3f, src: vec4f, depth: f32) -> {returns} {{\n{body}\n}}\n")
    };
    let check = |text: &str| -> std::result::Result<(), (usize, String)> {
        let module = naga::front::wgsl::parse_str(text).map_err(|e| {
            let line = e.location(text).map_or(1, |l| l.line_number as usize);
            (line, e.message().to_string())
        })?;
        pure(&module).map_err(|what| (1 + lines_before, what.to_string()))?;
        let mut validator = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::empty(),
        );
        validator.validate(&module).map(|_| ()).map_err(|e| {
            let line = e.location(text).map_or(1, |l| l.line_number as usize);
            (line, innermost(e.as_inner()))
        })
    };
    let three = function("vec3f");
    let Err((line, message)) = check(&three) else {
        let wrap = format!(
            "fn blended_{i}(d: vec4f, s: vec4f, z: f32) -> vec4f {{ return vec4f(own_blend_{i}(d.rgb, s, z), d.a); }}"
        );
        return Ok(three + &wrap);
    };
    let four = function("vec4f");
    let Err((line_of_four, message_of_four)) = check(&four) else {
        let wrap = format!(
            "fn blended_{i}(d: vec4f, s: vec4f, z: f32) -> vec4f {{ return own_blend_{i}(d.rgb, s, z); }}"
        );
        return Ok(four + &wrap);
    };
    // Of the two complaints the one that is not about what is returned; where both are, neither kind is.
    let about_result = |message: &str| message.contains("return type");
    let (line, message) = match (about_result(&message), about_result(&message_of_four)) {
        (true, true) => (line, "it must give a vec3f, or a vec4f whose last is the alpha".to_string()),
        (true, false) => (line_of_four, message_of_four),
        _ => (line, message),
    };
    // What a parser expects next is seldom what is missing.
    let hint = if is_body || !message.starts_with("expected") {
        ""
    } else {
        " (an expression has no `;`, and a function body needs a `return`)"
    };
    let line = line.saturating_sub(lines_before).clamp(1, text.lines().count().max(1));
    let own = text.lines().nth(line - 1).unwrap_or_default().trim();
    Err(Error::Shader { file: name.into(), line, message: format!("{message}, in `{own}`{hint}") })
}

/// Files that a method of a user's may call functions of; the last where it has a `K`.
const FOR_METHODS: [&str; 4] =
    ["methods/common/layer", "methods/common/absorbance", "methods/common/slots", "methods/common/nearest"];

pub fn for_methods(has_k: bool) -> &'static [&'static str] {
    &FOR_METHODS[..if has_k { 4 } else { 3 }]
}

/// Checks a user's method, by itself, so that what is wrong with it is told in its own lines, on any device or none.
/// `constants`: its parameters, as WGSL. Returns whether it loops.
pub fn user_method(id: &str, text: &str, constants: &str, has_k: bool) -> Result<bool> {
    let mut files = vec!["common", "exact", "methods/common/fragment"];
    files.extend(for_methods(has_k));
    let prelude = "const DIVIDES_EXACTLY = false;\nvar<private> view: View;\nvar<private> method: Method;\n";
    let mut composed = Composed::new(prelude.into(), &files)?;
    composed.push(constants, "parameters".into());
    composed.push_foreign(text, id);
    // As shaders/tiles/stream.wgsl calls it.
    let calls = "var<private> state: State;\n\
         fn calls(f: Fragment, behind: vec4f) -> vec4f {\n\
             state = begin(Place(vec2u(0u), 0u));\n\
             if turn(&state, 0u) { insert(&state, f, 0u); }\n\
             return end(&state, behind) * f32(left_out(&state, 1u));\n\
         }\n";
    composed.push(calls, "what calls a method: begin, turn, insert, end, left_out".into());
    let module = naga::front::wgsl::parse_str(&composed.text).map_err(|e| {
        let line = e.location(&composed.text).map_or(1, |l| l.line_number as usize);
        composed.error(line, e.message())
    })?;
    if !module.entry_points.is_empty() {
        return Err(Error::Shader {
            file: id.into(),
            line: 1,
            message: "a method has no entry point".into(),
        });
    }
    if module.functions.iter().any(|(_, function)| block_has(&function.body, &is_collective)) {
        let message = "a method must not wait or discard: a pixel is by itself".into();
        return Err(Error::Shader { file: id.into(), line: 1, message });
    }
    let mut validator =
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
    validator.validate(&module).map_err(|e| {
        let line = e.location(&composed.text).map_or(1, |l| l.line_number as usize);
        composed.error(line, &innermost(e.as_inner()))
    })?;
    let is_loop = |statement: &naga::Statement| matches!(statement, naga::Statement::Loop { .. });
    let theirs = composed.starts.iter().find(|(_, origin)| origin == id).map_or(0, |(start, _)| *start);
    let before: String = composed.text.lines().take(theirs).flat_map(|line| [line, "\n"]).collect();
    let is_ours = |name: &str| before.contains(&format!("fn {name}("));
    let mut own = module.functions.iter().filter(|(_, f)| !f.name.as_deref().is_some_and(is_ours));
    Ok(own.any(|(_, f)| block_has(&f.body, &is_loop)))
}

/// A blend is one function of its arguments: what it says must mean the same wherever it is put.
fn pure(module: &naga::Module) -> std::result::Result<(), &'static str> {
    if module.functions.len() != 1 || !module.global_variables.is_empty() || !module.entry_points.is_empty() {
        return Err(
            "it must be one expression or one function's body, with no other function and no variable outside",
        );
    }
    let of_neighbours = |(_, function): (_, &naga::Function)| {
        let derives = |(_, e): (_, &naga::Expression)| matches!(e, naga::Expression::Derivative { .. });
        function.expressions.iter().any(derives) || block_has(&function.body, &is_collective)
    };
    if module.functions.iter().any(of_neighbours) {
        return Err("it must not derive, wait or discard: a fragment is blended by itself");
    }
    Ok(())
}

fn is_collective(statement: &naga::Statement) -> bool {
    use naga::Statement::*;
    matches!(
        statement,
        Kill | ControlBarrier(_)
            | MemoryBarrier(_)
            | WorkGroupUniformLoad { .. }
            | SubgroupBallot { .. }
            | SubgroupGather { .. }
            | SubgroupCollectiveOperation { .. }
    )
}

/// Whether a statement is in a block, however deep.
fn block_has(block: &naga::Block, wanted: &impl Fn(&naga::Statement) -> bool) -> bool {
    use naga::Statement::*;
    block.iter().any(|statement| {
        wanted(statement)
            || match statement {
                Block(inner) => block_has(inner, wanted),
                If { accept, reject, .. } => block_has(accept, wanted) || block_has(reject, wanted),
                Switch { cases, .. } => cases.iter().any(|case| block_has(&case.body, wanted)),
                Loop { body, continuing, .. } => block_has(body, wanted) || block_has(continuing, wanted),
                _ => false,
            }
    })
}

/// Whether a checked blend loops.
pub fn has_loop(blend: &str) -> bool {
    let is_loop = |statement: &naga::Statement| matches!(statement, naga::Statement::Loop { .. });
    naga::front::wgsl::parse_str(blend)
        .is_ok_and(|module| module.functions.iter().any(|(_, f)| block_has(&f.body, &is_loop)))
}

/// The message at the root of an error: those around it speak of functions that are not the user's.
fn innermost(error: &dyn std::error::Error) -> String {
    let mut error = error;
    while let Some(source) = error.source() {
        error = source;
    }
    error.to_string()
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

    #[test]
    fn blends_are_expressions_or_bodies_of_three_channels_or_four() {
        for text in [
            "dst * (1.0 - src.a) + src.rgb * src.a",
            "let t = 1.0 - src.a;\nreturn dst * t + src.rgb * src.a;",
            "vec4f(dst, 1.0) * depth",
            "dst // returns nothing odd",
        ] {
            user_blend(0, "blend", text).unwrap();
        }
    }

    #[test]
    fn what_is_wrong_with_a_blend_is_told_in_its_own_line() {
        for (text, line, word) in [
            ("dst * colour.a", 1, "colour"),
            ("let t = 1.0;\nlet u = missing;\nreturn dst;", 2, "missing"),
            ("dst.r", 1, "vec3f"),
            ("dst +", 1, ""),
            ("1.0; } fn f() { return", 1, ""),
            ("return f(dst); } fn f(x: vec3f) -> vec3f { return x;", 1, "one function"),
            ("dst + dpdx(src.rgb)", 1, "derive"),
            ("if src.a > 0.5 { discard; }\nreturn dst;", 1, "discard"),
            ("workgroupBarrier();\nreturn dst;", 1, "wait"),
        ] {
            match user_blend(0, "glass", text) {
                Err(Error::Shader { file, line: found, message }) => {
                    assert_eq!((file.as_str(), found), ("glass", line), "{text}: {message}");
                    assert!(message.contains(word), "{text}: {message}");
                }
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
