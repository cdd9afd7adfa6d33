// Unsorted: composited with `over` in the order of submission, as if painted (src/methods/unsorted.rs).

struct State {
    painted: Layer,
}

fn begin(place: Place) -> State {
    return State(layer_clear());
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    (*s).painted = layer_onto(layer_of(fragment.color), (*s).painted);
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return layer_over((*s).painted, behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
