// Weighted sum (Meshkin 2007): C = Σ αᵢ cᵢ + (1 − Σ αᵢ) B, with nothing clamped (src/methods/weighted_sum.rs).

struct State {
    // Σ α c, and last Σ α.
    sum: vec4f,
}

fn begin(place: Place) -> State {
    return State(vec4f(0.0));
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    (*s).sum += vec4f(fragment.color.a * fragment.color.rgb, fragment.color.a);
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return layer_over(Layer((*s).sum, 1.0 - (*s).sum.a), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
