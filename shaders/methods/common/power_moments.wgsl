// Power moments of absorbance over depth, and how much of it may lie in front of a depth
// (src/methods/common/power_moments.rs). Loops are unrolled for eight moments; of fewer, what is beyond is 0.

// Where a depth's powers still fit, and its share of any moments that are left is nothing.
const FAR_DEPTH = 1e3;

// b₀; b₁ to b₄; b₅ to b₈.
struct Moments {
    total: f32,
    low: vec4f,
    high: vec4f,
}

// B = L D Lᵀ: L by rows from the second on, without the diagonal, which is 1, and the inverses of D from the second on.
// The first column of L is that of B.
struct Factors {
    row1: f32,
    row2: vec2f,
    row3: vec3f,
    row4: vec4f,
    inverses: vec4f,
}

fn moments_none() -> Moments {
    return Moments(0.0, vec4f(0.0), vec4f(0.0));
}

fn moments_add(b: Moments, absorbance: f32, depth: f32) -> Moments {
    let square = depth * depth;
    let powers = vec4f(depth, square, square * depth, square * square);
    let low = absorbance * powers;
    let sum = Moments(b.total + absorbance, b.low + low, b.high + low.w * powers);
    if SIXTEEN_BITS && sum.total > 0.0 {
        return Moments(sum.total, sum.total * stored_in_16_bits(sum.low / sum.total), sum.high);
    }
    return sum;
}

// Normalised moments b₁ to b₄ as 16-bit fractions hold them: as four numbers in 0 to 1 that use all of it, to the nearest
// of their steps, and back.
fn stored_in_16_bits(b: vec4f) -> vec4f {
    let root = 1.7320508;
    let fractions = vec4f(
        1.5 * b.x - 2.0 * b.z + 0.5,
        4.0 * b.y - 4.0 * b.w,
        0.5 * root * b.x - 2.0 / 9.0 * root * b.z + 0.5,
        0.5 * b.y + 0.5 * b.w,
    );
    let q = floor(clamp(fractions, vec4f(0.0), vec4f(1.0)) * 65535.0 + 0.5) / 65535.0;
    let q1 = q.x - 0.5;
    let q3 = q.z - 0.5;
    return vec4f(
        root * q3 - 1.0 / 3.0 * q1,
        0.125 * q.y + q.w,
        0.75 * root * q3 - 0.75 * q1,
        q.w - 0.125 * q.y,
    );
}

fn factors_none() -> Factors {
    return Factors(0.0, vec2f(0.0), vec3f(0.0), vec4f(0.0), vec4f(0.0));
}

// Of moments whose total is not 0.
fn factorised(moments: Moments) -> Factors {
    let low = (1.0 - BIAS) * (moments.low / moments.total) + BIAS * TOWARDS_LOW;
    let high = (1.0 - BIAS) * (moments.high / moments.total) + BIAS * TOWARDS_HIGH;
    var f = factors_none();
    f.row1 = low.x;
    let d1 = max(LEAST_PIVOT, low.y - f.row1 * f.row1);
    let l20 = low.y;
    let l21 = (low.z - l20 * f.row1) / d1;
    f.row2 = vec2f(l20, l21);
    let d2 = max(LEAST_PIVOT, low.w - l20 * l20 - l21 * l21 * d1);
    f.inverses = vec4f(1.0 / d1, 1.0 / d2, 0.0, 0.0);
    if HALF > 2u {
        let l30 = low.z;
        let l31 = (low.w - l30 * f.row1) / d1;
        let l32 = (high.x - l30 * l20 - l31 * l21 * d1) / d2;
        f.row3 = vec3f(l30, l31, l32);
        let d3 = max(LEAST_PIVOT, high.y - l30 * l30 - l31 * l31 * d1 - l32 * l32 * d2);
        f.inverses.z = 1.0 / d3;
        if HALF > 3u {
            let l40 = low.w;
            let l41 = (high.x - l40 * f.row1) / d1;
            let l42 = (high.y - l40 * l20 - l41 * l21 * d1) / d2;
            let l43 = (high.z - l40 * l30 - l41 * l31 * d1 - l42 * l32 * d2) / d3;
            f.row4 = vec4f(l40, l41, l42, l43);
            let d4 = high.w - l40 * l40 - l41 * l41 * d1 - l42 * l42 * d2 - l43 * l43 * d3;
            f.inverses.w = 1.0 / max(LEAST_PIVOT, d4);
        }
    }
    return f;
}

// The orthogonal polynomials at x, from the second on; the first is 1.
fn orthogonal(f: Factors, x: f32) -> vec4f {
    let square = x * x;
    let y1 = x - f.row1;
    let y2 = square - f.row2.x - f.row2.y * y1;
    var y3 = 0.0;
    var y4 = 0.0;
    if HALF > 2u {
        y3 = square * x - f.row3.x - f.row3.y * y1 - f.row3.z * y2;
    }
    if HALF > 3u {
        y4 = square * square - f.row4.x - f.row4.y * y1 - f.row4.z * y2 - f.row4.w * y3;
    }
    return vec4f(y1, y2, y3, y4);
}

fn add_root(depth: f32, x: f32) {
    nodes_add(real(clamp(x, -FAR_DEPTH, FAR_DEPTH)), select(0.0, 1.0, x < depth));
}

fn real(x: f32) -> vec2f {
    return vec2f(x, 0.0);
}

// How much of the whole is in front of a depth: `beta` is 0 for the least, 1 for the most that it may be.
fn share_before(f: Factors, depth: f32, beta: f32) -> f32 {
    let y = orthogonal(f, depth);
    let own = y * f.inverses;
    let q4 = own.w;
    let q3 = own.z - f.row4.w * q4;
    let q2 = own.y - f.row3.z * q3 - f.row4.z * q4;
    let q1 = own.x - f.row2.y * q2 - f.row3.y * q3 - f.row4.y * q4;
    let q0 = 1.0 - f.row1 * q1 - f.row2.x * q2 - f.row3.x * q3 - f.row4.x * q4;
    var q = Polynomial(vec4f(q2, q1, q0, 0.0), 0.0);
    if HALF == 3u {
        q = Polynomial(vec4f(q3, q2, q1, q0), 0.0);
    } else if HALF == 4u {
        q = Polynomial(vec4f(q4, q3, q2, q1), q0);
    }
    let x = real_roots(q);
    nodes_begin();
    add_root(depth, x.x);
    add_root(depth, x.y);
    if HALF > 2u {
        add_root(depth, x.z);
    }
    if HALF > 3u {
        add_root(depth, x.w);
    }
    return nodes_in_front(real(depth), beta, real(f.row1), real(f.row2.x), real(f.row3.x), real(f.row4.x));
}
