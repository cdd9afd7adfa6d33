//! Scenes on an adapter.

use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::output::to_dict;
use super::parts::{CameraParts, MeshParts, RequestParts};
use super::with_parts;
use crate::frame::Request;
use crate::gpu;
use crate::render;

/// A scene on an adapter, by its place in `adapters()`. The meshes that calls are given are the same each time: they are
/// uploaded once.
#[pyclass(frozen)]
pub struct Upload(render::Upload);

/// A frame that an adapter has been given.
#[pyclass(frozen)]
pub struct Begun {
    begun: Mutex<Option<gpu::Begun>>,
    request: Request,
}

#[pymethods]
impl Upload {
    #[new]
    fn new(adapter: usize) -> Self {
        Self(render::Upload::new(adapter))
    }

    fn render<'py>(
        &self,
        py: Python<'py>,
        meshes: Vec<MeshParts<'py>>,
        camera: CameraParts<'py>,
        request: RequestParts,
        background: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (output, request) =
            with_parts(py, &meshes, &camera, &request, background, |s, c, r, b| self.0.render(s, c, r, b))?;
        to_dict(py, output, &request)
    }

    /// Gives the adapter a frame without waiting for it; None if that takes more than one submission.
    fn begin<'py>(
        &self,
        py: Python<'py>,
        meshes: Vec<MeshParts<'py>>,
        camera: CameraParts<'py>,
        request: RequestParts,
        background: &Bound<'py, PyAny>,
    ) -> PyResult<Option<Begun>> {
        let (begun, request) =
            with_parts(py, &meshes, &camera, &request, background, |s, c, r, b| self.0.begin(s, c, r, b))?;
        Ok(begun.map(|begun| Begun { begun: Mutex::new(Some(begun)), request }))
    }

    /// Waits for a frame, once; None if it must be rendered otherwise.
    fn finish<'py>(&self, py: Python<'py>, begun: &Begun) -> PyResult<Option<Bound<'py, PyDict>>> {
        let taken = begun.begun.lock().unwrap_or_else(PoisonError::into_inner).take();
        let output = py.detach(|| taken.map_or(Ok(None), |begun| self.0.finish(begun)))?;
        output.map(|output| to_dict(py, output, &begun.request)).transpose()
    }

    /// Measures frames of tiles and of plain blending in turns: of each a list of frames, of each frame pairs of a stage
    /// and its milliseconds, the last of them "gpu", from the first begin to the last end.
    fn measure<'py>(
        &self,
        py: Python<'py>,
        meshes: Vec<MeshParts<'py>>,
        camera: CameraParts<'py>,
        request: RequestParts,
        background: &Bound<'py, PyAny>,
        frames: usize,
    ) -> PyResult<[gpu::Times; 2]> {
        let (times, _) = with_parts(py, &meshes, &camera, &request, background, |s, c, r, b| {
            self.0.measure(s, c, r, b, frames)
        })?;
        Ok(times)
    }
}
