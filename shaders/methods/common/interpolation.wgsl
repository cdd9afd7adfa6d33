// How much of a whole is in front of a depth: its moments' product with the polynomial that is 1 at depths in front, 0
// behind and β at the depth itself (src/methods/common/interpolation.rs). Loops are unrolled; what is beyond HALF is 0.

// Roots, those in front first, and which part of each is in front.
var<private> root_at: array<vec2f, 4>;
var<private> root_value: array<f32, 4>;
// Where the next in front goes, and the last that is free.
var<private> root_free: vec2u;

fn times(a: vec2f, b: vec2f) -> vec2f {
    return vec2f(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

fn conjugate(a: vec2f) -> vec2f {
    return vec2f(a.x, -a.y);
}

fn nodes_begin() {
    root_at = array<vec2f, 4>();
    root_value = array<f32, 4>();
    root_free = vec2u(0u, HALF - 1u);
}

// A root, of which the part `part` counts as in front.
fn nodes_add(place: vec2f, part: f32) {
    if part == 1.0 {
        root_at[root_free.x] = place;
        root_value[root_free.x] = part;
        root_free.x++;
    } else {
        root_at[root_free.y] = place;
        root_value[root_free.y] = part;
        root_free.y--;
    }
}

fn slope_between(rise: vec2f, run: vec2f) -> vec2f {
    if rise.x == 0.0 && rise.y == 0.0 {
        return rise;
    }
    return times(rise, conjugate(run)) / max(LEAST_RUN * LEAST_RUN, dot(run, run));
}

// Of normalised moments b₁ to b₄, of the depth itself, with β, and the roots that were added.
fn nodes_in_front(own: vec2f, beta: f32, b1: vec2f, b2: vec2f, b3: vec2f, b4: vec2f) -> f32 {
    let x1 = root_at[0];
    let x2 = root_at[1];
    let x3 = root_at[2];
    let x4 = root_at[3];
    // Divided differences, of two nodes, then of three, four and five.
    let p1 = slope_between(vec2f(root_value[0] - beta, 0.0), x1 - own);
    let p2 = slope_between(vec2f(root_value[1] - root_value[0], 0.0), x2 - x1);
    let q2 = slope_between(p2 - p1, x2 - own);
    // The moments of the distribution times x − x₀, then times x − x₁ and so on.
    let l1 = b1 - own;
    let l2 = b2 - times(own, b1);
    let m2 = l2 - times(x1, l1);
    var sum = beta + times(p1, l1).x + times(q2, m2).x;
    if HALF > 2u {
        let p3 = slope_between(vec2f(root_value[2] - root_value[1], 0.0), x3 - x2);
        let q3 = slope_between(p3 - p2, x3 - x1);
        let r3 = slope_between(q3 - q2, x3 - own);
        let l3 = b3 - times(own, b2);
        let m3 = l3 - times(x1, l2);
        let n3 = m3 - times(x2, m2);
        sum += times(r3, n3).x;
        if HALF > 3u {
            let p4 = slope_between(vec2f(root_value[3] - root_value[2], 0.0), x4 - x3);
            let q4 = slope_between(p4 - p3, x4 - x2);
            let r4 = slope_between(q4 - q3, x4 - x1);
            let s4 = slope_between(r4 - r3, x4 - own);
            let l4 = b4 - times(own, b3);
            let m4 = l4 - times(x1, l3);
            let n4 = m4 - times(x2, m3);
            sum += times(s4, n4 - times(x3, n3)).x;
        }
    }
    return clamp(sum, 0.0, 1.0);
}
