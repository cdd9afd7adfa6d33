// Additive: C = B + Σ αᵢ cᵢ, and alpha the background's alone (src/methods/additive.rs).

struct State {
    // Σ α c.
    sum: vec3f,
}

fn begin(place: Place) -> State {
    return State(vec3f(0.0));
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    (*s).sum += fragment.color.a * fragment.color.rgb;
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return layer_over(Layer(vec4f((*s).sum, 0.0), 1.0), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
