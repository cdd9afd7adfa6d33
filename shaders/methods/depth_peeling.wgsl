// Depth peeling (Everitt 2001): a pass finds the fragment right behind the last one (src/methods/depth_peeling.rs).

// In front of and behind all fragments.
const PEELED_NONE = vec2u(0u);
const FOUND_NONE = vec2u(0xffffffffu);

struct State {
    // Those that were peeled.
    front: Affine,
    peeled: u32,
    // The order of the last one peeled.
    last: vec2u,
    // The nearest one behind that, so far.
    found: vec2u,
    found_color: vec4f,
    found_mode: u32,
}

fn begin(place: Place) -> State {
    return State(affine_identity(), 0u, PEELED_NONE, FOUND_NONE, vec4f(0.0), 0u);
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    if pass_index == 0u {
        return true;
    }
    let found = (*s).found;
    if all(found == FOUND_NONE) {
        return false;
    }
    (*s).front = affine_onto((*s).front, affine((*s).found_mode, (*s).found_color));
    (*s).last = found;
    (*s).found = FOUND_NONE;
    (*s).peeled += 1u;
    return LAYERS == 0u || (*s).peeled < LAYERS;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let order = order_of(fragment);
    if in_front((*s).last, order) && in_front(order, (*s).found) {
        (*s).found = order;
        (*s).found_color = fragment.color;
        (*s).found_mode = fragment.mode;
    }
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return affine_over((*s).front, behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return count - (*s).peeled;
}
