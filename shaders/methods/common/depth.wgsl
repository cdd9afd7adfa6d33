// Depths brought to 0 at the nearest of a scene's, 1 at the farthest (src/methods/common/depth.rs).

// By its logarithm where all are in front of the eye, else linear. ½ where there is no range.
fn depth_in_range(depth: f32) -> f32 {
    let near = method.nearest;
    let far = method.farthest;
    if near >= far {
        return 0.5;
    }
    let z = clamp(depth, near, far);
    if near > 0.0 {
        return clamp(log_ratio(z, near) / log_ratio(far, near), 0.0, 1.0);
    }
    return clamp((z - near) / (far - near), 0.0, 1.0);
}

// ln (a / b) of a ≥ b > 0: it keeps its digits where they are close, and does not overflow where they are not. WGSL's
// own logarithm may be off by 2⁻²¹ near 1: there 2 artanh ((a − b) / (a + b)) instead, by its series, whose next term
// is under 2⁻²⁴ of the sum.
fn log_ratio(a: f32, b: f32) -> f32 {
    if a >= b + b {
        return log(a) - log(b);
    }
    let t = (a - b) / (a + b);
    let u = t * t;
    let tail = 1.0 / 7.0 + u * (1.0 / 9.0 + u * (1.0 / 11.0 + u * (1.0 / 13.0)));
    return 2.0 * t * (1.0 + u * (1.0 / 3.0 + u * (1.0 / 5.0 + u * tail)));
}
