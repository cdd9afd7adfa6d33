// No method, but how far off an image some methods can be at most (src/methods/bounds.rs). The tolerance comes in beta.

struct State {
    count: u32,
    alphas: f32,
    // Σ αᵢ αⱼ over all pairs.
    pairs: f32,
    low: vec3f,
    high: vec3f,
}

fn begin(place: Place) -> State {
    nearest_begin();
    return State(0u, 0.0, 0.0, vec3f(0.0), vec3f(0.0));
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let color = fragment.color;
    let is_first = (*s).count == 0u;
    (*s).low = select(min((*s).low, color.rgb), color.rgb, is_first);
    (*s).high = select(max((*s).high, color.rgb), color.rgb, is_first);
    (*s).count += 1u;
    (*s).pairs += (*s).alphas * color.a;
    (*s).alphas += color.a;
    _ = nearest_insert(fragment);
}

fn greatest(v: vec3f) -> f32 {
    return max(v.x, max(v.y, v.z));
}

// (unweighted, how many nearest, fragments, 0); or (the K nearest, 0, fragments, 0).
fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    let count = (*s).count;
    if count == 0u {
        return vec4f(0.0);
    }
    let shown = behind.a * behind.rgb;
    let own = greatest((*s).high - (*s).low);
    let range = max(1.0 - behind.a, greatest(max((*s).high, shown) - min((*s).low, shown)));
    var through = 1.0;
    var needed = select(K + 1u, 0u, range <= method.beta);
    for (var i = 0u; i < min(count, K); i++) {
        through *= 1.0 - nearest_colors[i].a;
        let place = i + 1u;
        if needed > place && (place == count || range * through <= method.beta) {
            needed = place;
        }
    }
    if OF_NEAREST {
        return vec4f(select(0.0, range * through, count > K), 0.0, f32(count), 0.0);
    }
    return vec4f(own * (*s).pairs, f32(needed), f32(count), 0.0);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
