// Coverage by one number a pixel, to which blending adds: the absorbance Σ −ln (1 − αᵢ) of all fragments. Small alphas keep
// their digits (methods/common/absorbance.wgsl).

fn coverage_of(absorbed: f32) -> Coverage {
    return Coverage(opacity(absorbed), transmittance_of(absorbed));
}
