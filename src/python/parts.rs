//! What Python hands over: dicts of arrays and of words, as the core's own types.

use std::collections::HashMap;
use std::sync::Arc;

use bytemuck::cast_slice;
use numpy::{Element, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use super::errors;
use crate::camera::Camera;
use crate::composite::{Lists as CapturedLists, Window};
use crate::fragments::Background;
use crate::frame::{
    BlendOrder, LimitPolicy, ListOptions, Lists, MsaaResolve, Rasteriser, Request, Sort, Storage,
};
use crate::methods::{Method, Own, Parameters, Value, Values as MethodValues};
use crate::node_format::NodeFormat;
use crate::real::Real;
use crate::resolve::Resolve;
use crate::samples::check_samples;
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

/// A parameter of a method.
#[derive(FromPyObject)]
enum ParameterValue {
    Flag(bool),
    Number(f64),
    Text(String),
}

/// A method's id and parameters, checked.
#[derive(FromPyObject)]
pub struct MethodParts {
    #[pyo3(item)]
    method: String,
    #[pyo3(item)]
    parameters: HashMap<String, ParameterValue>,
    /// Of a user's method.
    #[pyo3(item)]
    own: Option<OwnParts>,
}

/// What a GPU runs of a user's method.
#[derive(FromPyObject)]
pub struct OwnParts {
    #[pyo3(item)]
    wgsl: String,
    #[pyo3(item)]
    constants: String,
    #[pyo3(item)]
    passes: u32,
    #[pyo3(item)]
    loops: Option<u32>,
}

impl MethodParts {
    pub fn method(&self) -> PyResult<Method> {
        let value = |value: &ParameterValue| match value {
            ParameterValue::Flag(flag) => Value::Flag(*flag),
            ParameterValue::Number(number) => Value::Number(*number),
            ParameterValue::Text(text) => Value::Text(text.clone()),
        };
        if let Some(own) = &self.own {
            return Ok(Method::Own(Arc::new(self.own(own))));
        }
        let parameters = self.parameters.iter().map(|(name, own)| (name.clone(), value(own)));
        Method::of(&self.method, &Parameters(parameters.collect())).ok_or_else(|| {
            errors::ParameterError::new_err(format!("the core has no method {:?}", self.method))
        })
    }
}

impl MethodParts {
    fn own(&self, own: &OwnParts) -> Own {
        let number = |name: &str| match self.parameters.get(name) {
            Some(ParameterValue::Number(number)) => *number,
            _ => 0.0,
        };
        Own {
            id: self.method.clone(),
            wgsl: own.wgsl.clone(),
            constants: own.constants.clone(),
            passes: own.passes,
            loops: own.loops,
            has_k: self.parameters.contains_key("k"),
            values: MethodValues {
                range: (number("nearest"), number("farthest")),
                beta: number("beta"),
                seed: number("seed") as u32,
            },
        }
    }
}

#[derive(FromPyObject)]
pub struct RequestParts {
    #[pyo3(item)]
    method: MethodParts,
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
    targets: String,
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
    pub fn request(&self) -> PyResult<Request> {
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
        Ok(Request {
            method: self.method.method()?,
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
            blend_order: blend_order_of(&self.blend_order),
            least_transmittance: self.least_transmittance,
            half_targets: self.targets == "float16",
        })
    }
}

/// Captured lists.
#[derive(FromPyObject)]
pub struct ListParts<'py> {
    #[pyo3(item)]
    offsets: PyReadonlyArray1<'py, i64>,
    #[pyo3(item)]
    pub color: Values<'py>,
    #[pyo3(item)]
    depth: PyReadonlyArray1<'py, f64>,
    #[pyo3(item)]
    primitive: PyReadonlyArray1<'py, i32>,
    #[pyo3(item)]
    coverage: Option<PyReadonlyArray1<'py, u32>>,
    #[pyo3(item)]
    pub blend: Option<PyReadonlyArray1<'py, u8>>,
}

impl ListParts<'_> {
    /// With the colours, which have one of two types.
    pub fn lists<'a, C>(&'a self, color: &'a [[C; 4]]) -> PyResult<CapturedLists<'a, C>> {
        Ok(CapturedLists {
            offsets: self.offsets.as_slice()?,
            color,
            depth: self.depth.as_slice()?,
            primitive: self.primitive.as_slice()?,
            coverage: self.coverage.as_ref().map(|a| a.as_slice()).transpose()?,
            blend: self.blend.as_ref().map(|a| a.as_slice()).transpose()?,
        })
    }
}

/// How captured lists are composited.
#[derive(FromPyObject)]
pub struct ResolveParts {
    #[pyo3(item)]
    method: MethodParts,
    #[pyo3(item)]
    samples: u32,
    #[pyo3(item)]
    msaa_resolve: String,
    #[pyo3(item)]
    blend_order: String,
    #[pyo3(item)]
    least_transmittance: f64,
    /// First column and row in the image that lists are of, and their width.
    #[pyo3(item)]
    window: (u32, u32, u32),
}

impl ResolveParts {
    /// `mixes`: some fragment is blended otherwise than `over`.
    pub fn resolve(&self, mixes: bool) -> PyResult<(Resolve, Window)> {
        let resolve = Resolve {
            method: self.method.method()?,
            samples: check_samples(self.samples)?,
            msaa: msaa_of(&self.msaa_resolve),
            mixes,
            order: blend_order_of(&self.blend_order),
            least_transmittance: self.least_transmittance,
        };
        let (x0, y0, width) = self.window;
        Ok((resolve, Window { x0, y0, width }))
    }
}

fn blend_order_of(name: &str) -> BlendOrder {
    match name {
        "back_to_front" => BlendOrder::BackToFront,
        _ => BlendOrder::FrontToBack,
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
