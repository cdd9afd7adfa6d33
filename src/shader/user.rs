//! What users write of shaders: a blend, or a method. It is checked here, by itself, so that what is wrong with it is told
//! in its own lines, on any device or none.

use super::Composed;
use crate::error::{Error, Result};

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
