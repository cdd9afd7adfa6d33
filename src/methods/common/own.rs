//! A method of a user's, which GPUs run; on the CPU it is a function of arrays, outside the core.

use crate::error::{Error, Result};
use crate::methods::{Described, Values};
use crate::shader::for_methods;

#[derive(Debug, Clone)]
pub struct Own {
    pub id: String,
    pub wgsl: String,
    /// Its parameters, as WGSL.
    pub constants: String,
    pub passes: u32,
    /// Iterations of loops inside an `insert`; `None`: nobody knows.
    pub loops: Option<u32>,
    pub has_k: bool,
    pub values: Values,
}

impl Own {
    /// Refuses what a driver that ends loops early, and silently, may spoil.
    pub fn check_loops(&self, device: &str) -> Result<()> {
        match self.loops {
            Some(_) => Ok(()),
            None => Err(Error::Unsupported(format!(
                "method {:?} loops, and {device} ends loops after some turns, silently: say how many an insert takes, with \
                 register_method(…, loops=…), write the loop out, or use the CPU",
                self.id
            ))),
        }
    }
}

impl Described for Own {
    fn common(&self) -> &'static [&'static str] {
        for_methods(self.has_k)
    }
    fn values(&self) -> Values {
        self.values
    }
    fn work(&self, _: u32) -> (u32, u32) {
        (self.passes, self.loops.unwrap_or(0))
    }
}
