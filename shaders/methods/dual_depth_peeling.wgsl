// Dual depth peeling (Bavoil and Myers 2008): a pass peels the nearest and the farthest fragment that are left
// (src/methods/dual_depth_peeling.rs).

// In front of and behind all fragments.
const FRONT_END = vec2u(0u);
const BACK_END = vec2u(0xffffffffu);

struct State {
    front: Affine,
    back: Affine,
    // Orders of the last ones peeled on either side.
    last_near: vec2u,
    last_far: vec2u,
    // The nearest and the farthest between those, so far: none while the first is behind all.
    near: vec2u,
    far: vec2u,
    near_color: vec4f,
    far_color: vec4f,
    near_mode: u32,
    far_mode: u32,
}

fn begin(place: Place) -> State {
    let clear = affine_identity();
    let none = vec4f(0.0);
    return State(clear, clear, FRONT_END, BACK_END, BACK_END, FRONT_END, none, none, 0u, 0u);
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    if pass_index == 0u {
        return true;
    }
    let near = (*s).near;
    let far = (*s).far;
    if all(near == BACK_END) {
        return false;
    }
    (*s).front = affine_onto((*s).front, affine((*s).near_mode, (*s).near_color));
    if any(near != far) {
        (*s).back = affine_onto(affine((*s).far_mode, (*s).far_color), (*s).back);
    }
    (*s).last_near = near;
    (*s).last_far = far;
    (*s).near = BACK_END;
    (*s).far = FRONT_END;
    return true;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let order = order_of(fragment);
    if !in_front((*s).last_near, order) || !in_front(order, (*s).last_far) {
        return;
    }
    if in_front(order, (*s).near) {
        (*s).near = order;
        (*s).near_color = fragment.color;
        (*s).near_mode = fragment.mode;
    }
    if in_front((*s).far, order) {
        (*s).far = order;
        (*s).far_color = fragment.color;
        (*s).far_mode = fragment.mode;
    }
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return affine_over(affine_onto((*s).front, (*s).back), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
