//! Memory that nobody has any more, of images and of buffers that the host reads, for the next ones: to bring pages that are
//! new to a process takes the system as long as filling them.

use std::sync::{Mutex, PoisonError};

use bytemuck::Pod;
use bytemuck::allocation::try_cast_vec;

use super::reserve;
use crate::error::Result;

/// Smaller ones come from memory that the process keeps anyway.
const LEAST_BYTES: u64 = 1 << 20;
const MOST_BYTES: u64 = 256 << 20;

static IMAGES: Waiting<Vec<u32>> = Waiting::new(bytes_of, MOST_BYTES, usize::MAX);

fn bytes_of(words: &Vec<u32>) -> u64 {
    4 * words.capacity() as u64
}

/// Things of some size that wait for another use.
pub struct Waiting<T> {
    things: Mutex<Vec<T>>,
    bytes_of: fn(&T) -> u64,
    most_bytes: u64,
    most: usize,
}

impl<T> Waiting<T> {
    /// `most_bytes`: of all together.
    pub const fn new(bytes_of: fn(&T) -> u64, most_bytes: u64, most: usize) -> Self {
        Self { things: Mutex::new(Vec::new()), bytes_of, most_bytes, most }
    }

    /// One that is not much larger: the last that came, which caches may still hold.
    pub fn take(&self, bytes: u64) -> Option<T> {
        let mut things = self.things.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |thing: &T| (bytes..=bytes + bytes / 4).contains(&(self.bytes_of)(thing));
        let i = things.iter().rposition(fits)?;
        Some(things.remove(i))
    }

    pub fn put(&self, thing: T) {
        let mut things = self.things.lock().unwrap_or_else(PoisonError::into_inner);
        things.push(thing);
        while things.len() > self.most || things.iter().map(self.bytes_of).sum::<u64>() > self.most_bytes {
            things.remove(0); // the oldest
        }
    }
}

/// Room for `n` values that are all to be written.
pub fn room<V: Pod>(what: &str, n: usize) -> Result<Vec<V>> {
    match IMAGES.take((n * size_of::<V>()) as u64).map(try_cast_vec) {
        Some(Ok(values)) => return Ok(values),
        Some(Err((_, words))) => give(words), // of another alignment
        None => {}
    }
    reserve(what, n)
}

/// Leaves memory to the next that asks.
pub fn give(mut words: Vec<u32>) {
    words.clear();
    if bytes_of(&words) >= LEAST_BYTES {
        IMAGES.put(words);
    }
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
        assert!(IMAGES.take(4000).is_none(), "too small to be worth it");
        give(Vec::with_capacity(MOST_BYTES as usize / 4 + 1));
        assert!(IMAGES.take(MOST_BYTES + 4).is_none(), "too large to be kept");
    }
}
