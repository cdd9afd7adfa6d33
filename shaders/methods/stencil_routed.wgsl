// Stencil-routed A-buffer (Myers and Bavoil 2007): the first K fragments that are submitted, sorted as they come
// (src/methods/stencil_routed.rs).

struct State {
    count: u32,
}

fn begin(place: Place) -> State {
    nearest_begin();
    return State(0u);
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    if (*s).count < K {
        _ = nearest_insert(fragment);
    }
    (*s).count += 1u;
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return layer_over(nearest_layer(), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return count - min(count, K);
}
