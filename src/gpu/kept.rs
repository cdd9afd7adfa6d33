//! What stays on a device between the renders of one scene: nothing is made or uploaded again that still serves.

use std::sync::Arc;

use super::device::Gpu;
use super::pool::Pool;
use super::tiles::{Bins, BinsKey, Image, ImageKey, Opaque, OpaqueKey, Wanted};
use super::upload::Uploaded;
use super::variant::Variant;
use crate::error::Result;
use crate::scene::Scene;

pub struct Kept {
    pub gpu: Arc<Gpu>,
    scene: Option<Arc<Uploaded>>,
    /// An earlier render uploaded it.
    pub is_kept: bool,
    pub bins: Spare<BinsKey, Bins>,
    pub opaque: Spare<OpaqueKey, Opaque>,
    pub image: Spare<ImageKey, Image>,
    pub wanted: Wanted,
    /// By what nodes are like, and the bytes that they may take.
    pub pool: Spare<(Variant, u64), Pool>,
}

impl Kept {
    pub fn new(gpu: Arc<Gpu>) -> Self {
        let (bins, opaque, image, wanted, pool) = Default::default();
        Self { gpu, scene: None, is_kept: false, bins, opaque, image, wanted, pool }
    }

    /// A render begins.
    pub fn begin(&mut self) {
        self.is_kept = self.scene.is_some();
    }

    /// The scene, uploaded at the first call. It is the same scene each time.
    pub fn scene(&mut self, scene: &Scene) -> Result<Arc<Uploaded>> {
        if let Some(uploaded) = &self.scene {
            return Ok(uploaded.clone());
        }
        let uploaded = Arc::new(Uploaded::new(&self.gpu, scene)?);
        Ok(self.scene.insert(uploaded).clone())
    }
}

/// A thing between two uses, with what it serves for.
pub struct Spare<K, V>(Option<(K, V)>);

impl<K, V> Default for Spare<K, V> {
    fn default() -> Self {
        Self(None)
    }
}

impl<K: PartialEq, V> Spare<K, V> {
    /// The thing if it serves for `key`, else a new one. The old one goes first: the two need not fit together.
    pub fn take(&mut self, key: &K, make: impl FnOnce() -> Result<V>) -> Result<V> {
        self.take_if(key, |_| true, make)
    }

    /// The same, of things that may differ otherwise than by key.
    pub fn take_if(
        &mut self,
        key: &K,
        serves: impl FnOnce(&V) -> bool,
        make: impl FnOnce() -> Result<V>,
    ) -> Result<V> {
        if let Some((kept, thing)) = self.0.take()
            && kept == *key
            && serves(&thing)
        {
            return Ok(thing);
        }
        make()
    }

    pub fn put(&mut self, key: K, thing: V) {
        self.0 = Some((key, thing));
    }
}
