// Moment-based order-independent transparency (Münstermann, Krumpen, Klein and Peters 2018; src/methods/mboit.rs).

struct State {
    moments: Moments,
    factors: Factors,
    shade: Shade,
}

fn begin(place: Place) -> State {
    return State(moments_none(), factors_none(), shade_none());
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    if pass_index == 1u && (*s).moments.total > 0.0 {
        (*s).factors = factorised((*s).moments);
        return true;
    }
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let color = fragment.color;
    if color.a <= 0.0 {
        return;
    }
    let depth = 2.0 * depth_in_range(fragment.depth) - 1.0;
    if pass_index == 0u {
        (*s).moments = moments_add((*s).moments, min(absorbance(color.a), MOST_ABSORBANCE), depth);
        return;
    }
    let before = share_before((*s).factors, depth, method.beta) * (*s).moments.total;
    (*s).shade = shade_add((*s).shade, color, before);
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return layer_over(shade_layer((*s).shade), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
