// Trigonometric moments of absorbance over depth, and how much of it may lie in front of a depth
// (src/methods/common/trigonometric_moments.rs). Loops are unrolled for four moments; of fewer, what is beyond is 0.

const PI = 3.14159265358979;

// b₀; b₁ to b₄.
struct Moments {
    total: f32,
    b1: vec2f,
    b2: vec2f,
    b3: vec2f,
    b4: vec2f,
}

// B = L D Lᴴ: L without the diagonal, which is 1, and the inverses of D from the second on. The first column of L is that
// of B.
struct Factors {
    l10: vec2f,
    l20: vec2f,
    l21: vec2f,
    l30: vec2f,
    l31: vec2f,
    l32: vec2f,
    l40: vec2f,
    l41: vec2f,
    l42: vec2f,
    l43: vec2f,
    inverses: vec4f,
}

// e^{iφ} of a depth. From φ − π, which is in the range where all devices have sines; brought back to length 1, which they
// may miss by more than the bias.
fn point_of(depth: f32) -> vec2f {
    let angle = depth * (PI - ZONE / 2.0) - ZONE / 2.0;
    return -normalize(vec2f(cos(angle), sin(angle)));
}

// That of a depth, which is not in the zone: the nearest, at 0, may be rounded to the zone's end.
fn place_of(point: vec2f) -> f32 {
    let place = around(point);
    return select(place, -1.0, place > (ZONE_START + 7.0) / 2.0);
}

// Rises once around the circle, from −1 to 7, as the phase does from 0 on.
fn around(point: vec2f) -> f32 {
    var r = abs(point.y) - abs(point.x);
    r = select(r, 2.0 - r, point.x < 0.0);
    return select(r, 6.0 - r, point.y < 0.0);
}

fn moments_none() -> Moments {
    return Moments(0.0, vec2f(0.0), vec2f(0.0), vec2f(0.0), vec2f(0.0));
}

fn moments_add(b: Moments, absorbance: f32, depth: f32) -> Moments {
    let point = point_of(depth);
    let p1 = absorbance * point;
    let p2 = times(p1, point);
    let p3 = times(p2, point);
    return Moments(b.total + absorbance, b.b1 + p1, b.b2 + p2, b.b3 + p3, b.b4 + times(p3, point));
}

fn factors_none() -> Factors {
    let none = vec2f(0.0);
    return Factors(none, none, none, none, none, none, none, none, none, none, vec4f(0.0));
}

// Of moments whose total is not 0.
fn factorised(moments: Moments) -> Factors {
    let keep = (1.0 - BIAS) / moments.total;
    let b1 = keep * moments.b1;
    let b2 = keep * moments.b2;
    let b3 = keep * moments.b3;
    let b4 = keep * moments.b4;
    var f = factors_none();
    f.l10 = b1;
    let d1 = max(LEAST_PIVOT, 1.0 - dot(b1, b1));
    f.l20 = b2;
    f.l21 = (b1 - times(f.l20, conjugate(f.l10))) / d1;
    let d2 = max(LEAST_PIVOT, 1.0 - dot(f.l20, f.l20) - dot(f.l21, f.l21) * d1);
    f.inverses = vec4f(1.0 / d1, 1.0 / d2, 0.0, 0.0);
    if HALF > 2u {
        f.l30 = b3;
        f.l31 = (b2 - times(f.l30, conjugate(f.l10))) / d1;
        f.l32 = (b1 - times(f.l30, conjugate(f.l20)) - times(f.l31, conjugate(f.l21)) * d1) / d2;
        let d3 = max(
            LEAST_PIVOT,
            1.0 - dot(f.l30, f.l30) - dot(f.l31, f.l31) * d1 - dot(f.l32, f.l32) * d2,
        );
        f.inverses.z = 1.0 / d3;
        if HALF > 3u {
            f.l40 = b4;
            f.l41 = (b3 - times(f.l40, conjugate(f.l10))) / d1;
            f.l42 = (b2 - times(f.l40, conjugate(f.l20)) - times(f.l41, conjugate(f.l21)) * d1) / d2;
            f.l43 = (b1 - times(f.l40, conjugate(f.l30)) - times(f.l41, conjugate(f.l31)) * d1
                - times(f.l42, conjugate(f.l32)) * d2) / d3;
            let d4 = 1.0 - dot(f.l40, f.l40) - dot(f.l41, f.l41) * d1 - dot(f.l42, f.l42) * d2
                - dot(f.l43, f.l43) * d3;
            f.inverses.w = 1.0 / max(LEAST_PIVOT, d4);
        }
    }
    return f;
}

// The orthogonal polynomials at a point, from the second on; the first is 1.
struct Orthogonal {
    y1: vec2f,
    y2: vec2f,
    y3: vec2f,
    y4: vec2f,
}

fn orthogonal(f: Factors, x: vec2f) -> Orthogonal {
    let x2 = times(x, x);
    let y1 = x - f.l10;
    let y2 = x2 - f.l20 - times(f.l21, y1);
    var y3 = vec2f(0.0);
    var y4 = vec2f(0.0);
    if HALF > 2u {
        y3 = times(x2, x) - f.l30 - times(f.l31, y1) - times(f.l32, y2);
    }
    if HALF > 3u {
        y4 = times(x2, x2) - f.l40 - times(f.l41, y1) - times(f.l42, y2) - times(f.l43, y3);
    }
    return Orthogonal(y1, y2, y3, y4);
}

// e^{i m (ψ − φ)/2} v(e^{iψ})ᴴ q, as a polynomial of t = tan((ψ − φ)/2) over (1 + t²)^{m/2}.
fn polynomial_of(f: Factors, point: vec2f, y: Orthogonal) -> Polynomial {
    let q4 = y.y4 * f.inverses.w;
    let q3 = y.y3 * f.inverses.z - times(conjugate(f.l43), q4);
    let q2 = y.y2 * f.inverses.y - times(conjugate(f.l32), q3) - times(conjugate(f.l42), q4);
    let q1 = y.y1 * f.inverses.x - times(conjugate(f.l21), q2) - times(conjugate(f.l31), q3)
        - times(conjugate(f.l41), q4);
    let q0 = vec2f(1.0, 0.0) - times(conjugate(f.l10), q1) - times(conjugate(f.l20), q2)
        - times(conjugate(f.l30), q3) - times(conjugate(f.l40), q4);
    let back = conjugate(point);
    let back2 = times(back, back);
    let p1 = times(q1, back);
    let p2 = times(q2, back2);
    // p_{m−j} is the conjugate of p_j but for roundings, which 1/λ magnifies: what is not so is none of q.
    if HALF == 2u {
        let a0 = 0.5 * (q0.x + p2.x);
        let c0 = 0.5 * (q0.y - p2.y);
        let a1 = p1.x;
        return Polynomial(vec4f(a1 - 2.0 * a0, -4.0 * c0, 2.0 * a0 + a1, 0.0), 0.0);
    }
    let p3 = times(q3, times(back2, back));
    if HALF == 3u {
        let h0 = 0.5 * (q0 + conjugate(p3));
        let h1 = 0.5 * (p1 + conjugate(p2));
        let first = vec4f(h0.y - h1.y, h1.x - 3.0 * h0.x, -(3.0 * h0.y + h1.y), h0.x + h1.x);
        return Polynomial(first, 0.0);
    }
    let p4 = times(q4, times(back2, back2));
    let h0 = 0.5 * (q0 + conjugate(p4));
    let h1 = 0.5 * (p1 + conjugate(p3));
    let even = 2.0 * h0.x + p2.x;
    let odd = 8.0 * h0.y;
    let first = vec4f(even - 2.0 * h1.x, odd - 4.0 * h1.y, 2.0 * p2.x - 12.0 * h0.x, -(odd + 4.0 * h1.y));
    return Polynomial(first, even + 2.0 * h1.x);
}

// The root t. In the zone the part of it that is in front rises from 0 to 1: what is there is neither far nor near.
fn add_root(point: vec2f, own_place: f32, t: f32) {
    let square = t * t;
    let turned = times(vec2f(1.0 - square, t + t) / (1.0 + square), point);
    let place = around(turned);
    let zone = clamp((place - ZONE_START) / (7.0 - ZONE_START), 0.0, 1.0);
    nodes_add(turned, select(zone, 1.0, place < own_place));
}

// How much of the whole is in front of a depth: `beta` is 0 for the least, 1 for the most that it may be.
fn share_before(f: Factors, depth: f32, beta: f32) -> f32 {
    let point = point_of(depth);
    let y = orthogonal(f, point);
    let own_place = place_of(point);
    let t = real_roots(polynomial_of(f, point, y));
    nodes_begin();
    add_root(point, own_place, t.x);
    add_root(point, own_place, t.y);
    if HALF > 2u {
        add_root(point, own_place, t.z);
    }
    if HALF > 3u {
        add_root(point, own_place, t.w);
    }
    return nodes_in_front(point, beta, f.l10, f.l20, f.l30, f.l40);
}
