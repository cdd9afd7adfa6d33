// Exact: every fragment, front to back, composited with `over` (Porter and Duff 1984).
//
// C = Σ Tᵢ αᵢ cᵢ + T B, with Tᵢ = Π_{j<i} (1 − αⱼ). Alpha is accumulated as Σ Tᵢ αᵢ, never taken as 1 − T.

struct State {
    color: vec3f,
    alpha: f32,
    transmittance: f32,
}

fn begin() -> State {
    return State(vec3f(0.0), 0.0, 1.0);
}

fn insert(s: ptr<function, State>, fragment: vec4f) {
    let weight = (*s).transmittance * fragment.a;
    (*s).color += weight * fragment.rgb;
    (*s).alpha += weight;
    (*s).transmittance *= 1.0 - fragment.a;
}

// No more than `least` is let through: whatever is left out behind, a channel whose colours reach M changes by
// `least` · M at most.
fn is_saturated(s: State, least: f32) -> bool {
    return s.transmittance <= least;
}

// Premultiplied, over a straight background.
fn end(s: State, background: vec4f) -> vec4f {
    let weight = s.transmittance * background.a;
    return vec4f(s.color + weight * background.rgb, s.alpha + weight);
}
