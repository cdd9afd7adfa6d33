//! Memory of images that nobody has any more, for the next ones: to bring pages that are new to a process takes the system
//! as long as filling them.

use std::sync::{Mutex, PoisonError};

use bytemuck::Pod;
use bytemuck::allocation::try_cast_vec;

use super::reserve;
use crate::error::Result;

/// Smaller ones come from memory that the process keeps anyway.
const LEAST_BYTES: usize = 1 << 20;
/// Of all that wait.
const MOST_BYTES: usize = 256 << 20;

static WAITING: Mutex<Vec<Vec<u32>>> = Mutex::new(Vec::new());

/// Room for `n` values that are all to be written.
pub fn room<V: Pod>(what: &str, n: usize) -> Result<Vec<V>> {
    match taken(n * size_of::<V>()).map(try_cast_vec) {
        Some(Ok(values)) => return Ok(values),
        Some(Err((_, words))) => give(words), // of another alignment
        None => {}
    }
    reserve(what, n)
}

/// One that is not much larger: the last that came, which caches may still hold.
fn taken(bytes: usize) -> Option<Vec<u32>> {
    let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
    let i = waiting.iter().rposition(|words| (bytes..=bytes + bytes / 4).contains(&bytes_of(words)))?;
    Some(waiting.remove(i))
}

/// Leaves memory to the next that asks.
pub fn give(mut words: Vec<u32>) {
    words.clear();
    if bytes_of(&words) < LEAST_BYTES {
        return;
    }
    let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
    waiting.push(words);
    while waiting.iter().map(bytes_of).sum::<usize>() > MOST_BYTES {
        waiting.remove(0); // the oldest
    }
}

fn bytes_of(words: &Vec<u32>) -> usize {
    4 * words.capacity()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_comes_back_to_what_has_its_size_and_alignment() {
        const N: usize = (1 << 18) + 12; // of no other test
        let first = room::<[f32; 4]>("an image", N).unwrap();
        let at = first.as_ptr() as usize;
        assert_eq!((first.len(), first.capacity()), (0, N));
        give(try_cast_vec(first).unwrap());
        let smaller = room::<[f32; 4]>("a smaller image", N / 2).unwrap();
        assert_ne!(smaller.as_ptr() as usize, at);
        let other = room::<[f64; 4]>("another kind of image", N / 2).unwrap();
        assert_ne!(other.as_ptr() as usize, at);
        let second = room::<[f32; 4]>("the next image", N).unwrap();
        assert_eq!(second.as_ptr() as usize, at);
        give(vec![0; 1000]);
        assert!(taken(4000).is_none(), "too small to be worth it");
        give(Vec::with_capacity(MOST_BYTES / 4 + 1));
        assert!(taken(MOST_BYTES + 4).is_none(), "too large to be kept");
    }
}
