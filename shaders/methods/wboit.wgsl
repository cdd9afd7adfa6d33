// Weighted blended order-independent transparency (McGuire and Bavoil 2013), equations 7 to 10 (src/methods/wboit.rs).

struct State {
    // Σ α w c, and last Σ α w.
    sum: vec4f,
    coverage: Coverage,
}

fn power(x: f32, k: u32) -> f32 {
    var p = x;
    for (var i = 1u; i < k; i++) {
        p *= x;
    }
    return p;
}

// A common factor cancels, and this one brings weights below 1: bright colours do not overflow.
const WEIGHT_SCALE = 1.0 / 4096.0;

// w of the paper, which multiplies α c.
fn weight_of(depth: f32, alpha: f32) -> f32 {
    let z = abs(depth);
    var w = 0.0;
    switch WEIGHT {
        case 1u: {
            w = 10.0 / (1e-5 + power(z / 5.0, 2u) + power(z / 200.0, 6u));
        }
        case 2u: {
            w = 10.0 / (1e-5 + power(z / 10.0, 3u) + power(z / 200.0, 6u));
        }
        case 3u: {
            w = 0.03 / (1e-5 + power(z / 200.0, 4u));
        }
        case 4u: {
            let front = 1.0 - window_depth(z);
            return alpha * WEIGHT_SCALE * max(0.01, 3e3 * front * front * front);
        }
        default: {
            return 1.0;
        }
    }
    return alpha * WEIGHT_SCALE * max(0.01, min(w, 3e3));
}

fn begin(place: Place) -> State {
    return State(vec4f(0.0), coverage_none());
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let color = fragment.color;
    let weight = color.a * weight_of(fragment.depth, color.a);
    (*s).sum += vec4f(weight * color.rgb, weight);
    (*s).coverage = coverage_add((*s).coverage, color.a);
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return layer_over(coverage_of_mean((*s).coverage, (*s).sum), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
