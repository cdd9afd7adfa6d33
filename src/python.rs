//! The Python module `abuffer._core`: the only place that names pyo3 and numpy.
//!
//! Python has checked shapes, dtypes and values with the user's words; what arrives here is contiguous.
//! Nothing below holds the interpreter lock while it renders.

use bytemuck::cast_slice;
use numpy::{
    Element, IntoPyArray, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::camera::Camera;
use crate::composite::{Lists as ListsOf, composite as composite_lists};
use crate::error::Error;
use crate::fragments::{Background, Fragments};
use crate::frame::{
    BlendOrder, LimitPolicy, ListOptions, Lists, MsaaResolve, Output, Request, Sort, Stats, Storage,
};
use crate::gpu::device::{self, Adapter};
use crate::methods::METHODS;
use crate::node_format::NodeFormat;
use crate::png::encode;
use crate::real::Real;
use crate::render;
use crate::resolve::Resolve;
use crate::samples::check_samples;
use crate::scene::{ColorValues, Colors, Cull, Mesh, Positions, Rate, Scene};
use crate::shader::user_blend;

#[pymodule]
mod _core {
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
    #[pymodule_export]
    use super::{adapters, check_blend, composite, encode_png, methods, render_cpu, render_gpu};
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

/// An array in the precision that the user gave.
#[derive(FromPyObject)]
enum Values<'py> {
    F32(PyReadonlyArray2<'py, f32>),
    F64(PyReadonlyArray2<'py, f64>),
}

/// One mesh as `Mesh._parts()` in Python hands it over.
#[derive(FromPyObject)]
struct MeshParts<'py> {
    #[pyo3(item)]
    positions: Values<'py>,
    #[pyo3(item)]
    faces: Option<PyReadonlyArray2<'py, u32>>,
    #[pyo3(item)]
    color_mode: String,
    #[pyo3(item)]
    colors: Values<'py>,
    #[pyo3(item)]
    opaque: bool,
    #[pyo3(item)]
    alpha_cutoff: f64,
    #[pyo3(item)]
    cull: Option<String>,
    #[pyo3(item)]
    blend: u8,
}

impl MeshParts<'_> {
    fn mesh(&self) -> PyResult<Mesh<'_>> {
        Ok(Mesh {
            positions: match &self.positions {
                Values::F32(a) => Positions::F32(cast_slice(a.as_slice()?)),
                Values::F64(a) => Positions::F64(cast_slice(a.as_slice()?)),
            },
            faces: match &self.faces {
                Some(a) => Some(cast_slice(a.as_slice()?)),
                None => None,
            },
            colors: Colors {
                rate: match self.color_mode.as_str() {
                    "one" => Rate::One,
                    "vertex" => Rate::Vertex,
                    "face" => Rate::Face,
                    _ => Rate::Corner,
                },
                values: match &self.colors {
                    Values::F32(a) => ColorValues::F32(cast_slice(a.as_slice()?)),
                    Values::F64(a) => ColorValues::F64(cast_slice(a.as_slice()?)),
                },
            },
            opaque: self.opaque,
            alpha_cutoff: self.alpha_cutoff,
            cull: match self.cull.as_deref() {
                Some("back") => Cull::Back,
                Some("front") => Cull::Front,
                _ => Cull::None,
            },
            blend: self.blend,
        })
    }
}

#[derive(FromPyObject)]
struct CameraParts<'py> {
    #[pyo3(item)]
    view: PyReadonlyArray2<'py, f64>,
    #[pyo3(item)]
    projection: PyReadonlyArray2<'py, f64>,
    #[pyo3(item)]
    near: Option<f64>,
    #[pyo3(item)]
    far: Option<f64>,
}

impl CameraParts<'_> {
    fn camera(&self) -> PyResult<Camera> {
        let rows = |a: &PyReadonlyArray2<f64>| -> PyResult<[f64; 16]> {
            a.as_slice()?.try_into().map_err(|_| errors::ParameterError::new_err("matrices must be 4×4"))
        };
        Ok(Camera::from_rows(&rows(&self.view)?, &rows(&self.projection)?, self.near, self.far)?)
    }
}

#[derive(FromPyObject)]
struct RequestParts {
    #[pyo3(item)]
    width: u32,
    #[pyo3(item)]
    height: u32,
    #[pyo3(item)]
    lists: String,
    #[pyo3(item)]
    memory: Option<u64>,
    #[pyo3(item)]
    samples: u32,
    #[pyo3(item)]
    msaa_resolve: String,
    #[pyo3(item)]
    sort: String,
    #[pyo3(item)]
    max_sorted_fragments: Option<u32>,
    #[pyo3(item)]
    limit_policy: String,
    #[pyo3(item)]
    blend_order: String,
    #[pyo3(item)]
    pipeline: String,
    #[pyo3(item)]
    node_format: String,
    #[pyo3(item)]
    resolve: String,
    #[pyo3(item)]
    resolve_classes: Vec<u32>,
    #[pyo3(item)]
    blends: Vec<(String, Option<String>)>,
}

impl RequestParts {
    fn request(&self) -> Request {
        let lists_on_gpu = ListOptions {
            storage: match self.pipeline.as_str() {
                "prefix_sum" => Storage::Contiguous,
                _ => Storage::Linked,
            },
            format: NodeFormat::named(&self.node_format).unwrap_or(NodeFormat::Float32),
            classes: self.resolve_classes.clone(),
            fullscreen: self.resolve == "fragment",
            blends: self.blends.iter().map(|(n, b)| (n.clone(), b.clone().unwrap_or_default())).collect(),
        };
        Request {
            lists_on_gpu,
            width: self.width,
            height: self.height,
            lists: match self.lists.as_str() {
                "count" => Lists::Count,
                "translucent" => Lists::Translucent,
                "all" => Lists::All,
                _ => Lists::None,
            },
            memory: self.memory,
            samples: self.samples,
            msaa_resolve: msaa_of(&self.msaa_resolve),
            sort: match self.sort.as_str() {
                "insertion" => Sort::Insertion,
                "selection" => Sort::Selection,
                "bitonic" => Sort::Bitonic,
                "merge" => Sort::Merge,
                "heap" => Sort::Heap,
                _ => Sort::Auto,
            },
            limit: self.max_sorted_fragments.map(|n| {
                let last = self.limit_policy == "last_submitted";
                (n, if last { LimitPolicy::LastSubmitted } else { LimitPolicy::Nearest })
            }),
            blend_order: match self.blend_order.as_str() {
                "back_to_front" => BlendOrder::BackToFront,
                _ => BlendOrder::FrontToBack,
            },
        }
    }
}

fn msaa_of(name: &str) -> MsaaResolve {
    match name {
        "per_sample" => MsaaResolve::PerSample,
        "hdr" => MsaaResolve::Hdr,
        "none" => MsaaResolve::None,
        _ => MsaaResolve::PerPixel,
    }
}

/// A constant colour, or one a pixel, (H, W, 4).
enum BackgroundParts<'py, T: Element> {
    Constant([f64; 4]),
    Image(PyReadonlyArray3<'py, T>),
}

impl<'py, T: Element + Real + bytemuck::Pod> BackgroundParts<'py, T> {
    fn of(object: &Bound<'py, PyAny>) -> PyResult<Self> {
        match object.cast::<PyArray3<T>>() {
            Ok(image) => Ok(Self::Image(image.try_readonly()?)),
            Err(_) => object.extract().map(Self::Constant),
        }
    }

    fn background(&self) -> PyResult<Background<'_, T>> {
        Ok(match self {
            Self::Constant(c) => Background::Constant(c.map(T::from_f64)),
            Self::Image(a) => Background::Image(cast_slice(a.as_slice()?)),
        })
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
    T: Real + Element + bytemuck::Pod,
    T::Key: Element,
{
    let camera = camera.camera()?;
    let request = request.request();
    let parts = BackgroundParts::<T>::of(background)?;
    let background = parts.background()?;
    let meshes = meshes.iter().map(MeshParts::mesh).collect::<PyResult<Vec<_>>>()?;
    let output = py.detach(|| {
        let scene = Scene::new(meshes)?;
        render::on_cpu(&scene, &camera, &request, background)
    })?;
    to_dict(py, output, &request)
}

/// Renders with pipeline linked_list on an adapter, by its place in `adapters()`.
#[pyfunction]
fn render_gpu<'py>(
    py: Python<'py>,
    adapter: usize,
    meshes: Vec<MeshParts<'py>>,
    camera: CameraParts<'py>,
    request: RequestParts,
    background: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let camera = camera.camera()?;
    let request = request.request();
    let parts = BackgroundParts::<f32>::of(background)?;
    let background = parts.background()?;
    let meshes = meshes.iter().map(MeshParts::mesh).collect::<PyResult<Vec<_>>>()?;
    let output = py.detach(|| {
        let scene = Scene::new(meshes)?;
        render::on_gpu(adapter, &scene, &camera, &request, background)
    })?;
    to_dict(py, output, &request)
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

fn to_dict<'py, T>(py: Python<'py>, output: Output<T>, request: &Request) -> PyResult<Bound<'py, PyDict>>
where
    T: Real + Element,
    T::Key: Element,
{
    let (h, w) = (request.height as usize, request.width as usize);
    let dict = PyDict::new(py);
    // (H, W, 4), or (H, W, S, 4) where there is a colour a sample.
    let rgba = |pixels: Vec<[T; 4]>, samples: Option<usize>| -> PyResult<Bound<'py, PyAny>> {
        let flat = pixels.into_flattened().into_pyarray(py);
        Ok(match samples {
            Some(samples) => flat.reshape([h, w, samples, 4])?.into_any(),
            None => flat.reshape([h, w, 4])?.into_any(),
        })
    };
    let apart = (request.msaa_resolve == MsaaResolve::None).then(|| request.image_samples());
    dict.set_item("image", rgba(output.image, apart)?)?;
    if let Some(counts) = output.counts {
        dict.set_item("counts", counts.into_pyarray(py).reshape([h, w])?)?;
    }
    if let Some(background) = output.background {
        let apart = (request.samples > 1).then_some(request.samples as usize);
        dict.set_item("background", rgba(background, apart)?)?;
    }
    if let Some(Fragments { offsets, depth, key, color, primitive, coverage, blend }) = output.fragments {
        let n = color.len();
        dict.set_item("offsets", offsets.into_pyarray(py))?;
        dict.set_item("depth", depth.into_pyarray(py))?;
        dict.set_item("key", key.into_pyarray(py))?;
        dict.set_item("color", color.into_flattened().into_pyarray(py).reshape([n, 4])?)?;
        dict.set_item("primitive", primitive.into_pyarray(py))?;
        dict.set_item("coverage", coverage.map(|c| c.into_pyarray(py)))?;
        dict.set_item("blend", blend.map(|b| b.into_pyarray(py)))?;
    }
    dict.set_item("stats", stats_to_dict(py, output.stats)?)?;
    Ok(dict)
}

fn stats_to_dict<'py>(py: Python<'py>, stats: Stats) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let Stats {
        fragments,
        max_depth_complexity,
        rejected_triangles,
        dropped_fragments,
        bands,
        bytes,
        ms,
        device,
        plan,
    } = stats;
    dict.set_item("fragments", fragments)?;
    dict.set_item("max_depth_complexity", max_depth_complexity)?;
    dict.set_item("rejected_triangles", rejected_triangles)?;
    dict.set_item("dropped_fragments", dropped_fragments)?;
    dict.set_item("bands", bands)?;
    dict.set_item("bytes", bytes.into_iter().collect::<std::collections::BTreeMap<_, _>>())?;
    let stages = PyDict::new(py); // in the order that they ran
    for (stage, ms) in ms {
        stages.set_item(stage.as_ref(), ms)?;
    }
    dict.set_item("ms", stages)?;
    dict.set_item("device", device)?;
    dict.set_item("plan", plan)?;
    Ok(dict)
}

/// Composites captured lists in float64. `color` is (F, 4) float32 or float64; `background` one colour, or
/// (H·W·samples, 4). Returns (H·W, 4), or with msaa_resolve "none" (H·W·samples, 4).
#[pyfunction]
#[pyo3(signature = (offsets, color, background, coverage, blend, samples, msaa_resolve, back_to_front))]
#[allow(clippy::too_many_arguments)]
fn composite<'py>(
    py: Python<'py>,
    offsets: PyReadonlyArray1<'py, i64>,
    color: Values<'py>,
    background: PyReadonlyArray2<'py, f64>,
    coverage: Option<PyReadonlyArray1<'py, u32>>,
    blend: Option<PyReadonlyArray1<'py, u8>>,
    samples: u32,
    msaa_resolve: &str,
    back_to_front: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let background = Background::Image(cast_slice(background.as_slice()?));
    let offsets = offsets.as_slice()?;
    let coverage = coverage.as_ref().map(|a| a.as_slice()).transpose()?;
    let blend = blend.as_ref().map(|a| a.as_slice()).transpose()?;
    let resolve = Resolve {
        samples: check_samples(samples)?,
        msaa: msaa_of(msaa_resolve),
        mixes: blend.is_some(),
        order: if back_to_front { BlendOrder::BackToFront } else { BlendOrder::FrontToBack },
    };
    let image = match &color {
        Values::F32(a) => {
            let color = cast_slice::<f32, [f32; 4]>(a.as_slice()?);
            py.detach(|| composite_lists(ListsOf { offsets, color, coverage, blend }, resolve, background))?
        }
        Values::F64(a) => {
            let color = cast_slice::<f64, [f64; 4]>(a.as_slice()?);
            py.detach(|| composite_lists(ListsOf { offsets, color, coverage, blend }, resolve, background))?
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

/// PNG bytes of an (H, W, 4) uint8 array.
#[pyfunction]
fn encode_png<'py>(py: Python<'py>, pixels: PyReadonlyArray3<'py, u8>) -> PyResult<Bound<'py, PyBytes>> {
    let shape = pixels.as_array().dim();
    let bytes = encode(pixels.as_slice()?, shape.1 as u32, shape.0 as u32)?;
    Ok(PyBytes::new(py, &bytes))
}

/// Rows of the method table: id, title, order, source.
#[pyfunction]
fn methods() -> Vec<(&'static str, &'static str, &'static str, &'static str)> {
    METHODS.iter().map(|m| (m.id, m.title, m.order, m.source)).collect()
}
