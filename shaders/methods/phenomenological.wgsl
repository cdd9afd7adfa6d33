// Phenomenological transparency (McGuire and Mara 2016), of one transmission for all (src/methods/phenomenological.rs).

struct State {
    // Σ α w c, and last Σ α w.
    sum: vec4f,
    // Σ αᵢ Π_{j<i} (1 − αⱼ (1 − t)): how much of the mean colour there is.
    amount: f32,
    transmittance: f32,
}

fn weight_of(depth: f32, held_back: f32) -> f32 {
    let x = 10.0 * (1.0 - 0.99 * window_depth(abs(depth))) * held_back;
    return clamp(x * x * x, 0.01, 30.0);
}

fn begin(place: Place) -> State {
    return State(vec4f(0.0), 0.0, 1.0);
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let color = fragment.color;
    let held_back = color.a * (1.0 - TRANSMISSION);
    let weight = color.a * weight_of(fragment.depth, held_back);
    (*s).sum += vec4f(weight * color.rgb, weight);
    (*s).amount += (*s).transmittance * color.a;
    (*s).transmittance *= 1.0 - held_back;
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    let sum = (*s).sum;
    let amount = (*s).amount;
    var color = vec3f(0.0);
    if sum.a > 0.0 {
        color = sum.rgb / sum.a * amount;
    }
    return layer_over(Layer(vec4f(color, amount * (1.0 - TRANSMISSION)), (*s).transmittance), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
