// Unsorted: composited in the order of submission, as if painted (src/methods/unsorted.rs).

struct State {
    painted: Affine,
}

fn begin(place: Place) -> State {
    return State(affine_identity());
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    (*s).painted = affine_onto(affine(fragment.mode, fragment.color), (*s).painted);
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return affine_over((*s).painted, behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
