//! What Python hands over: dicts of arrays and of words, as the core's own types.

use bytemuck::cast_slice;
use numpy::{Element, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use super::errors;
use crate::camera::Camera;
use crate::fragments::Background;
use crate::frame::{
    BlendOrder, LimitPolicy, ListOptions, Lists, MsaaResolve, Rasteriser, Request, Sort, Storage,
};
use crate::node_format::NodeFormat;
use crate::real::Real;
use crate::scene::{ColorValues, Colors, Cull, Mesh, Positions, Rate};

/// An array in the precision that the user gave.
#[derive(FromPyObject)]
pub enum Values<'py> {
    F32(PyReadonlyArray2<'py, f32>),
    F64(PyReadonlyArray2<'py, f64>),
}

/// One mesh as `Mesh._parts()` in Python hands it over.
#[derive(FromPyObject)]
pub struct MeshParts<'py> {
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
    pub fn mesh(&self) -> PyResult<Mesh<'_>> {
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
pub struct CameraParts<'py> {
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
    pub fn camera(&self) -> PyResult<Camera> {
        let rows = |a: &PyReadonlyArray2<f64>| -> PyResult<[f64; 16]> {
            a.as_slice()?.try_into().map_err(|_| errors::ParameterError::new_err("matrices must be 4×4"))
        };
        Ok(Camera::from_rows(&rows(&self.view)?, &rows(&self.projection)?, self.near, self.far)?)
    }
}

#[derive(FromPyObject)]
pub struct RequestParts {
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
    least_transmittance: f64,
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
    pub fn request(&self) -> Request {
        let lists_on_gpu = ListOptions {
            rasteriser: match self.pipeline.as_str() {
                "tiles" => Rasteriser::Tiles,
                _ => Rasteriser::Hardware,
            },
            storage: match self.pipeline.as_str() {
                "prefix_sum" | "tiles" => Storage::Contiguous,
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
            least_transmittance: self.least_transmittance,
        }
    }
}

pub fn msaa_of(name: &str) -> MsaaResolve {
    match name {
        "per_sample" => MsaaResolve::PerSample,
        "hdr" => MsaaResolve::Hdr,
        "none" => MsaaResolve::None,
        _ => MsaaResolve::PerPixel,
    }
}

/// A constant colour, or one a pixel, (H, W, 4).
pub enum BackgroundParts<'py, T: Element> {
    Constant([f64; 4]),
    Image(PyReadonlyArray3<'py, T>),
}

impl<'py, T: Element + Real + bytemuck::Pod> BackgroundParts<'py, T> {
    pub fn of(object: &Bound<'py, PyAny>) -> PyResult<Self> {
        match object.cast::<PyArray3<T>>() {
            Ok(image) => Ok(Self::Image(image.try_readonly()?)),
            Err(_) => object.extract().map(Self::Constant),
        }
    }

    pub fn background(&self) -> PyResult<Background<'_, T>> {
        Ok(match self {
            Self::Constant(c) => Background::Constant(c.map(T::from_f64)),
            Self::Image(a) => Background::Image(cast_slice(a.as_slice()?)),
        })
    }
}
