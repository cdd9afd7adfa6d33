// The second pass of methods that have two: a fragment sees what all of them left in the first.

@fragment
fn fs_second(v: Varyings, @builtin(front_facing) is_front: bool) -> Second {
    let fragment = fragment_of(v, is_front);
    state = seen_once(vec2u(v.position.xy));
    if turn(&state, 1u) {
        insert(&state, fragment, 1u);
    }
    return second(state);
}
