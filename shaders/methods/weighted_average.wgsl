// Weighted average (Bavoil and Myers 2008): C = C̄ (1 − (1 − ᾱ)ⁿ) + (1 − ᾱ)ⁿ B (src/methods/weighted_average.rs).

struct State {
    // Σ α c, and last Σ α.
    sum: vec4f,
    count: u32,
}

fn begin(place: Place) -> State {
    return State(vec4f(0.0), 0u);
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let color = fragment.color;
    (*s).sum += vec4f(color.a * color.rgb, color.a);
    (*s).count += 1u;
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return layer_over(coverage_of_mean(coverage_of_equal((*s).sum.a, (*s).count), (*s).sum), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
