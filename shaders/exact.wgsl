// Arithmetic that gives the same bits on every device, and on the CPU: what snapped vertices, depth keys, and so the
// order of fragments are made from.
//
// WGSL lets a compiler contract a·b + c into one rounding, and a quotient be off by 2.5 ulp. A product that is to feed
// a sum goes through integer bits, which no compiler looks through, since `view.zero` is a value of the frame's.
// Sums and differences are exact roundings everywhere.

fn opaque_bits(value: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(value) ^ view.zero);
}

fn product(a: f32, b: f32) -> f32 {
    return opaque_bits(a * b);
}

// The nearest float to a / b. Where division rounds otherwise, one step from its fused residual mends it (Markstein
// 1990); where it is exact, fma need not be fused, and is not used (Mesa's llvmpipe).
fn quotient(a: f32, b: f32) -> f32 {
    let q = a / b;
    if DIVIDES_EXACTLY {
        return opaque_bits(q);
    }
    let residual = fma(-q, b, a);
    let mended = fma(residual, 1.0 / b, q);
    return opaque_bits(select(q, mended, is_finite(mended)));
}

fn is_finite(value: f32) -> bool {
    return (bitcast<u32>(value) & 0x7f800000u) != 0x7f800000u;
}

// A comparison each, as on the CPU: a NaN (of two infinities, on a sliver) becomes `low`.
fn clamped(value: f32, low: f32, high: f32) -> f32 {
    let v = select(low, value, value > low);
    return select(high, v, v < high);
}

// 64-bit integers as (low, high) words, in two's complement.

fn wide_add(a: vec2u, b: vec2u) -> vec2u {
    let low = a.x + b.x;
    return vec2u(low, a.y + b.y + u32(low < a.x));
}

fn wide_negated(a: vec2u) -> vec2u {
    let low = ~a.x + 1u;
    return vec2u(low, ~a.y + u32(low == 0u));
}

fn wide_is_negative(a: vec2u) -> bool {
    return (a.y >> 31u) == 1u;
}

fn wide_product(a: i32, b: i32) -> vec2u {
    let x = bitcast<u32>(abs(a));
    let y = bitcast<u32>(abs(b));
    let xl = x & 0xffffu;
    let xh = x >> 16u;
    let yl = y & 0xffffu;
    let yh = y >> 16u;
    let low = xl * yl;
    // Below 2^26 in size each, so that the sum of the middle products fits.
    let middle = xl * yh + xh * yl + (low >> 16u);
    let magnitude = vec2u((middle << 16u) | (low & 0xffffu), xh * yh + (middle >> 16u));
    if (a < 0) != (b < 0) {
        return wide_negated(magnitude);
    }
    return magnitude;
}

// a·b − c·d.
fn wide_cross(a: i32, b: i32, c: i32, d: i32) -> vec2u {
    return wide_add(wide_product(a, b), wide_negated(wide_product(c, d)));
}
