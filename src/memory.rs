//! Memory that the system may not have.

pub mod recycled;

use bytemuck::Zeroable;
use bytemuck::allocation::try_zeroed_vec;

use crate::error::{Error, Result};

/// `n` values that are all to be written, or an error where the system has no memory for them: `poison` in debug builds,
/// otherwise zeros, whose pages the system brings when they are first touched, by whichever thread.
pub fn allocate<V: Clone + Zeroable>(what: &str, n: usize, poison: V) -> Result<Vec<V>> {
    if cfg!(debug_assertions) {
        let mut all = reserve(what, n)?;
        all.resize(n, poison);
        return Ok(all);
    }
    try_zeroed_vec(n).map_err(|()| out_of_memory(what, (n * size_of::<V>()) as u64))
}

/// Room for `n` values.
pub fn reserve<V>(what: &str, n: usize) -> Result<Vec<V>> {
    let mut v = Vec::new();
    v.try_reserve_exact(n).map_err(|_| out_of_memory(what, (n * size_of::<V>()) as u64))?;
    Ok(v)
}

pub fn out_of_memory(what: &str, needed: u64) -> Error {
    Error::Capacity {
        what: what.into(),
        needed,
        limit: 0,
        advice: "the system has no such memory left: lower width and height, or ask for fewer fragments"
            .into(),
    }
}
