//! What Python gets back: a dict of arrays, and of what was measured.

use bytemuck::Pod;
use bytemuck::allocation::try_cast_vec;
use numpy::ndarray::{ArrayViewD, IxDyn};
use numpy::{Element, IntoPyArray, PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::fragments::Fragments;
use crate::frame::{MsaaResolve, Output, Request, Stats};
use crate::memory::recycled;
use crate::real::Real;

/// What an image's array lies in: the next image may have it, once no array is left.
#[pyclass(frozen)]
struct Pixels(Vec<u32>);

impl Drop for Pixels {
    fn drop(&mut self) {
        recycled::give(std::mem::take(&mut self.0));
    }
}

/// An array of all of `values`, whose memory is used again where its alignment is that of most images.
fn array_of<'py, T: Pod + Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let words = match try_cast_vec(values) {
        Ok(words) => words,
        Err((_, values)) => return values.into_pyarray(py).reshape(shape),
    };
    let pixels = Bound::new(py, Pixels(words))?;
    let view = ArrayViewD::from_shape(IxDyn(shape), bytemuck::cast_slice(&pixels.get().0))
        .map_err(|e| PyErr::new::<pyo3::exceptions::PyValueError, _>(e.to_string()))?;
    // SAFETY: the words stay where they are until `pixels` is dropped, which the array holds: it is frozen, and nothing
    // else has them.
    Ok(unsafe { PyArrayDyn::borrow_from_array(&view, pixels.clone().into_any()) })
}

pub fn to_dict<'py, T>(py: Python<'py>, output: Output<T>, request: &Request) -> PyResult<Bound<'py, PyDict>>
where
    T: Real + Element,
    T::Key: Element,
{
    let (h, w) = (request.height as usize, request.width as usize);
    let dict = PyDict::new(py);
    // (H, W, 4), or (H, W, S, 4) where there is a colour a sample.
    let rgba = |pixels: Vec<[T; 4]>, samples: Option<usize>| match samples {
        Some(samples) => array_of(py, pixels.into_flattened(), &[h, w, samples, 4]),
        None => array_of(py, pixels.into_flattened(), &[h, w, 4]),
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
        merged_fragments,
        bands,
        bytes,
        ms,
        gpu_ms,
        device,
        plan,
    } = stats;
    dict.set_item("fragments", fragments)?;
    dict.set_item("max_depth_complexity", max_depth_complexity)?;
    dict.set_item("rejected_triangles", rejected_triangles)?;
    dict.set_item("dropped_fragments", dropped_fragments)?;
    dict.set_item("merged_fragments", merged_fragments)?;
    dict.set_item("bands", bands)?;
    dict.set_item("bytes", bytes.into_iter().collect::<std::collections::BTreeMap<_, _>>())?;
    let stages = PyDict::new(py); // in the order that they ran
    for (stage, ms) in ms {
        stages.set_item(stage.as_ref(), ms)?;
    }
    dict.set_item("ms", stages)?;
    dict.set_item("gpu_ms", gpu_ms)?;
    dict.set_item("device", device)?;
    dict.set_item("plan", plan)?;
    Ok(dict)
}
