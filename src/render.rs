//! One render: a checked request goes to a pipeline.

use std::sync::{Arc, Mutex, PoisonError};

use crate::camera::Camera;
use crate::cpu;
use crate::error::Result;
use crate::fragments::Background;
use crate::frame::{Output, Request};
use crate::gpu::{self, Kept};
use crate::scene::Scene;
use crate::threads::threads;

/// Renders on the CPU.
pub fn on_cpu<T: cpu::Precision>(
    scene: &Scene,
    camera: &Camera,
    request: &Request,
    background: Background<T>,
) -> Result<Output<T>> {
    request.check(&background)?;
    threads()?.install(|| cpu::render(scene, camera, request, background))
}

/// A scene on an adapter, by its place in [`gpu::device::adapters`], and what has rendered it. It is uploaded when it
/// is first needed there; again if the device was lost, or in a forked child, which has no devices yet.
pub struct Upload {
    adapter: usize,
    kept: Mutex<Option<(u32, Kept)>>,
}

impl Upload {
    pub fn new(adapter: usize) -> Self {
        Self { adapter, kept: Mutex::new(None) }
    }

    /// Renders the scene, which is the same one each time.
    pub fn render(
        &self,
        scene: &Scene,
        camera: &Camera,
        request: &Request,
        background: Background<f32>,
    ) -> Result<Output<f32>> {
        request.check(&background)?;
        self.with("a render", |kept| gpu::render(kept, scene, camera, request, background))
    }

    /// Gives the device a frame without waiting for it; `None` if that takes more than one submission.
    pub fn begin(
        &self,
        scene: &Scene,
        camera: &Camera,
        request: &Request,
        background: Background<f32>,
    ) -> Result<Option<gpu::Begun>> {
        request.check(&background)?;
        self.with("a frame", |kept| gpu::begin(kept, scene, camera, request, &background))
    }

    /// Waits for a frame; `None` if it must be rendered otherwise.
    pub fn finish(&self, begun: gpu::Begun) -> Result<Option<Output<f32>>> {
        self.with("a frame", |kept| begun.finish(kept))
    }

    /// Measures frames of tiles and of plain blending in turns (see [`gpu::measure`]).
    pub fn measure(
        &self,
        scene: &Scene,
        camera: &Camera,
        request: &Request,
        background: Background<f32>,
        frames: usize,
    ) -> Result<[gpu::Times; 2]> {
        request.check(&background)?;
        self.with("measuring", |kept| gpu::measure(kept, scene, camera, request, &background, frames))
    }

    fn with<R>(&self, what: &str, call: impl FnOnce(&mut Kept) -> Result<R>) -> Result<R> {
        let gpu = gpu::device::open(self.adapter)?;
        let mut slot = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let process = std::process::id();
        if let Some((of, _)) = &*slot
            && *of != process
        {
            std::mem::forget(slot.take()); // its handles belong to the parent
        }
        let (_, mut kept) = slot
            .take()
            .filter(|(_, kept)| Arc::ptr_eq(&kept.gpu, &gpu))
            .unwrap_or_else(|| (process, Kept::new(gpu.clone())));
        kept.begin();
        let result = gpu.exclusively(|| gpu.checked(what, || call(&mut kept)));
        *slot = Some((process, kept));
        result
    }
}
