//! What Python gets back: a dict of arrays, and of what was measured.

use numpy::{Element, IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::fragments::Fragments;
use crate::frame::{MsaaResolve, Output, Request, Stats};
use crate::real::Real;

pub fn to_dict<'py, T>(py: Python<'py>, output: Output<T>, request: &Request) -> PyResult<Bound<'py, PyDict>>
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
        gpu_ms,
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
    dict.set_item("gpu_ms", gpu_ms)?;
    dict.set_item("device", device)?;
    dict.set_item("plan", plan)?;
    Ok(dict)
}
