//! Parameters of methods as a caller gives them: by name, each checked before.

use std::collections::HashMap;

use crate::methods::DepthRange;

#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    Flag(bool),
    Number(f64),
    Text(String),
}

#[derive(Debug, Clone, Default)]
pub struct Parameters(pub HashMap<String, Value>);

impl Parameters {
    /// 0 if it is no number: none that is checked is missing.
    pub fn number(&self, name: &str) -> f64 {
        match self.0.get(name) {
            Some(Value::Number(number)) => *number,
            _ => 0.0,
        }
    }

    /// That of the geometry, where a caller gives none.
    pub fn depth_range(&self) -> DepthRange {
        (self.number("nearest"), self.number("farthest"))
    }

    pub fn count(&self, name: &str) -> usize {
        self.number(name) as usize
    }

    pub fn flag(&self, name: &str) -> bool {
        self.0.get(name) == Some(&Value::Flag(true))
    }

    /// Empty if it is no text.
    pub fn text(&self, name: &str) -> &str {
        match self.0.get(name) {
            Some(Value::Text(text)) => text,
            _ => "",
        }
    }
}
