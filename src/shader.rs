//! Shader text: WGSL files put together by plain concatenation (module scope has no order), after a prelude
//! of constants that Rust knows too.

use std::borrow::Cow;

use crate::error::{Error, Result};

/// Fragments of a pixel that the resolve sorts in registers; longer lists take the path of `linked_list_long`.
pub const TEMP_FRAGMENTS: u32 = 32;
/// Entries of a long list that one invocation sorts or merges.
pub const CHUNK: u32 = 32;

macro_rules! sources {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../shaders/", $name, ".wgsl")))),*]
    };
}

/// Every shader file, by name.
pub static SOURCES: &[(&str, &str)] = sources![
    "common",
    "raster",
    "opaque",
    "linked_list_build",
    "linked_list_build_early",
    "linked_list_build_compare",
    "linked_list_read",
    "linked_list_resolve",
    "linked_list_long",
    "methods/exact",
];

/// The modules that pipelines are made from, and the files of each.
pub static MODULES: &[(&str, &[&str])] = &[
    ("opaque", &["common", "raster", "opaque"]),
    ("build_early", &["common", "raster", "linked_list_build", "linked_list_build_early"]),
    ("build_compare", &["common", "raster", "linked_list_build", "linked_list_build_compare"]),
    ("resolve", &["common", "methods/exact", "linked_list_read", "linked_list_resolve"]),
    ("long", &["common", "methods/exact", "linked_list_read", "linked_list_long"]),
];

/// A module's text, and where each file starts in it.
#[derive(Debug)]
pub struct Composed {
    pub text: String,
    starts: Vec<(usize, String)>,
}

impl Composed {
    /// The module `name` of [`MODULES`]. Files in the folder that `ABUFFER_SHADER_DIR` names replace ours,
    /// for trying a change without building.
    pub fn module(name: &str) -> Result<Self> {
        let files = MODULES.iter().find(|(module, _)| *module == name).map_or(&[][..], |(_, files)| *files);
        let mut composed = Self { text: prelude(), starts: Vec::new() };
        for file in files {
            let (source, origin) = source(file)?;
            composed.starts.push((composed.text.lines().count(), origin));
            composed.text.push_str(&source);
            composed.text.push('\n');
        }
        Ok(composed)
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

fn prelude() -> String {
    format!("const TEMP_FRAGMENTS: u32 = {TEMP_FRAGMENTS}u;\nconst CHUNK: u32 = {CHUNK}u;\n")
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
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    #[test]
    fn every_module_is_valid_without_optional_capabilities() {
        for (name, _) in MODULES {
            let text = Composed::module(name).unwrap().text;
            let module = naga::front::wgsl::parse_str(&text)
                .unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(&text)));
            let needs = match *name {
                "build_early" => Capabilities::EARLY_DEPTH_TEST,
                _ => Capabilities::empty(),
            };
            let mut validator = Validator::new(ValidationFlags::all(), needs);
            validator.validate(&module).unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(&text)));
        }
    }

    #[test]
    fn every_file_is_used_and_every_used_file_exists() {
        let used: Vec<_> = MODULES.iter().flat_map(|(_, files)| files.iter().copied()).collect();
        for (name, _) in SOURCES {
            assert!(used.contains(name), "{name} is in no module");
        }
        for name in used {
            assert!(SOURCES.iter().any(|(n, _)| *n == name), "{name} is in no file");
        }
    }

    #[test]
    fn errors_are_told_in_the_lines_of_their_own_file() {
        let composed = Composed::module("resolve").unwrap();
        let line = composed.text.lines().position(|l| l.contains("fn cs_resolve")).unwrap() + 1;
        let own = SOURCES.iter().find(|(n, _)| *n == "linked_list_resolve").unwrap().1;
        let wanted = own.lines().position(|l| l.contains("fn cs_resolve")).unwrap() + 1;
        match composed.error(line, "bad") {
            Error::Shader { file, line, .. } => {
                assert_eq!((file.as_str(), line), ("linked_list_resolve.wgsl", wanted))
            }
            other => panic!("{other:?}"),
        }
    }
}
