//! The Python module `abuffer._core`: the only room that names pyo3 and numpy.
//!
//! Python has checked shapes, dtypes and values with the user's words; what arrives here is contiguous.
//! Nothing below holds the interpreter lock while it renders.

mod output;
mod parts;
mod upload;

use bytemuck::cast_slice;
use numpy::{Element, IntoPyArray, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::camera::Camera;
use crate::composite::composite as composite_lists;
use crate::cpu::Precision;
use crate::error::Error;
use crate::fragments::Background;
use crate::frame::Request;
use crate::gpu::device::{self, Adapter};
use crate::methods::IDS;
use crate::png::encode;
use crate::render;
use crate::samples::{check_samples, pattern};
use crate::scene::Scene;
use crate::shader::{user_blend, user_method};
use output::to_dict;
use parts::{BackgroundParts, CameraParts, ListParts, MeshParts, RequestParts, ResolveParts, Values};

#[pymodule]
mod _core {
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
    #[pymodule_export]
    use super::{
        adapters, check_blend, check_method, composite, encode_png, methods, render_cpu, sample_positions,
        upload::Begun, upload::Upload,
    };
}

mod errors {
    pyo3::import_exception!(abuffer.errors, SceneError);
    pyo3::import_exception!(abuffer.errors, ParameterError);
    pyo3::import_exception!(abuffer.errors, DeviceError);
    pyo3::import_exception!(abuffer.errors, UnsupportedError);
    pyo3::import_exception!(abuffer.errors, CapacityError);
    pyo3::import_exception!(abuffer.errors, ShaderError);
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        let message = error.to_string();
        // No catch-all arm: a new variant must get its class here.
        match error {
            Error::Scene(_) => errors::SceneError::new_err(message),
            Error::Parameter(_) => errors::ParameterError::new_err(message),
            Error::Device(_) => errors::DeviceError::new_err(message),
            Error::Unsupported(_) => errors::UnsupportedError::new_err(message),
            Error::Capacity { .. } => errors::CapacityError::new_err(message),
            Error::Shader { .. } => errors::ShaderError::new_err(message),
        }
    }
}

/// Renders on the CPU, in float64 if `double`.
#[pyfunction]
fn render_cpu<'py>(
    py: Python<'py>,
    meshes: Vec<MeshParts<'py>>,
    camera: CameraParts<'py>,
    request: RequestParts,
    background: &Bound<'py, PyAny>,
    double: bool,
) -> PyResult<Bound<'py, PyDict>> {
    if double {
        on_cpu::<f64>(py, &meshes, &camera, &request, background)
    } else {
        on_cpu::<f32>(py, &meshes, &camera, &request, background)
    }
}

fn on_cpu<'py, T>(
    py: Python<'py>,
    meshes: &[MeshParts<'py>],
    camera: &CameraParts,
    request: &RequestParts,
    background: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>>
where
    T: Precision + Element + bytemuck::Pod,
    T::Key: Element,
{
    let (output, request) = with_parts::<T, _>(py, meshes, camera, request, background, render::on_cpu)?;
    to_dict(py, output, &request)
}

/// Calls into the core with what Python handed over, without the interpreter lock. Also gives the request.
fn with_parts<'py, T, R>(
    py: Python<'py>,
    meshes: &[MeshParts<'py>],
    camera: &CameraParts,
    request: &RequestParts,
    background: &Bound<'py, PyAny>,
    call: impl FnOnce(&Scene, &Camera, &Request, Background<T>) -> crate::error::Result<R> + Send,
) -> PyResult<(R, Request)>
where
    T: Precision + Element + bytemuck::Pod,
    R: Send,
{
    let camera = camera.camera()?;
    let request = request.request()?;
    let parts = BackgroundParts::<T>::of(background)?;
    let background = parts.background()?;
    let meshes = meshes.iter().map(MeshParts::mesh).collect::<PyResult<Vec<_>>>()?;
    let result = py.detach(|| call(&Scene::new(meshes)?, &camera, &request, background))?;
    Ok((result, request))
}

/// All adapters, best first.
#[pyfunction]
fn adapters<'py>(py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let describe = |adapter: Adapter| {
        let dict = PyDict::new(py);
        dict.set_item("name", adapter.name)?;
        dict.set_item("kind", adapter.kind)?;
        dict.set_item("backend", adapter.backend)?;
        dict.set_item("driver", adapter.driver)?;
        dict.set_item("max_binding", adapter.max_binding)?;
        dict.set_item("lacks", adapter.lacks)?;
        dict.set_item("samples", adapter.samples)?;
        Ok(dict)
    };
    py.detach(device::adapters).into_iter().map(describe).collect()
}

/// Composites captured lists in float64. Colours are (F, 4) float32 or float64; `background` is (H·W·samples, 4).
/// Returns (H·W, 4), or with msaa_resolve "none" (H·W·samples, 4).
#[pyfunction]
fn composite<'py>(
    py: Python<'py>,
    parts: ListParts<'py>,
    how: ResolveParts,
    background: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyAny>> {
    let background = Background::Image(cast_slice(background.as_slice()?));
    let (resolve, window) = how.resolve(parts.blend.is_some())?;
    let image = match &parts.color {
        Values::F32(a) => {
            let lists = parts.lists(cast_slice::<f32, [f32; 4]>(a.as_slice()?))?;
            py.detach(|| composite_lists(lists, window, &resolve, background))?
        }
        Values::F64(a) => {
            let lists = parts.lists(cast_slice::<f64, [f64; 4]>(a.as_slice()?))?;
            py.detach(|| composite_lists(lists, window, &resolve, background))?
        }
    };
    let n = image.len();
    Ok(image.into_flattened().into_pyarray(py).reshape([n, 4])?.into_any())
}

/// Raises a ShaderError if a user's blend is no expression or function body of WGSL.
#[pyfunction]
fn check_blend(name: &str, wgsl: &str) -> PyResult<()> {
    user_blend(0, name, wgsl)?;
    Ok(())
}

/// Raises a ShaderError if a user's method does not compile, else says whether it loops.
#[pyfunction]
fn check_method(id: &str, wgsl: &str, constants: &str, has_k: bool) -> PyResult<bool> {
    Ok(user_method(id, wgsl, constants, has_k)?)
}

/// Where the samples of a pixel lie: right and down of its centre, in 1/16 pixel.
#[pyfunction]
fn sample_positions(samples: u32) -> PyResult<Vec<(i32, i32)>> {
    Ok(pattern(check_samples(samples)?).to_vec())
}

/// PNG bytes of an (H, W, 4) uint8 array.
#[pyfunction]
fn encode_png<'py>(py: Python<'py>, pixels: PyReadonlyArray3<'py, u8>) -> PyResult<Bound<'py, PyBytes>> {
    let shape = pixels.as_array().dim();
    let bytes = encode(pixels.as_slice()?, shape.1 as u32, shape.0 as u32)?;
    Ok(PyBytes::new(py, &bytes))
}

/// Ids of the methods that the core has.
#[pyfunction]
fn methods() -> Vec<&'static str> {
    IDS.to_vec()
}
