// Wavelet transparency (Aizenshtein, Smal and McGuire 2022; src/methods/wavelet.rs).

// Outside the state: naga takes no pointer into a struct. s, then 2^(j/2) d_jk at 2^j + k.
var<private> coefficients: array<f32, CELLS>;

struct State {
    shade: Shade,
}

// C y.
fn place_in_cells(depth: f32) -> f32 {
    return depth_in_range(depth) * f32(CELLS - 1u);
}

fn project(place: f32, a: f32) {
    coefficients[0] += a * (1.0 - place / f32(CELLS));
    for (var level = 0u; level <= RANK; level++) {
        // A power of two: exact.
        let v = place * (f32(1u << level) / f32(CELLS));
        let k = floor(v);
        let part = v - k;
        coefficients[(1u << level) + u32(k)] -= a * min(part, 1.0 - part);
    }
}

// F_i.
fn cell(i: i32) -> f32 {
    if i < 0 {
        return 0.0;
    }
    var sum = coefficients[0];
    for (var level = 0u; level <= RANK; level++) {
        let half = u32(i) >> (RANK - level);
        let coefficient = coefficients[(1u << level) + (half >> 1u)];
        sum += select(coefficient, -coefficient, (half & 1u) == 1u);
    }
    return sum;
}

// F.
fn absorbance_in_front(place: f32) -> f32 {
    let i = floor(place);
    let before = cell(i32(i) - 1);
    return before + (cell(i32(i)) - before) * (place - i);
}

fn begin(place: Place) -> State {
    coefficients = array<f32, CELLS>();
    return State(shade_none());
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index < 2u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let place = place_in_cells(fragment.depth);
    if pass_index == 1u {
        (*s).shade = shade_add((*s).shade, fragment.color, absorbance_in_front(place));
        return;
    }
    project(place, bounded_absorbance(fragment.color.a));
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return layer_over(shade_layer((*s).shade), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
