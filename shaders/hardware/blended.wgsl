// Methods whose states add up, in whatever order: a fragment's own state is blended into targets. How a state lies there
// is the method's, in the file of its name.

var<private> state: State;

// The state that has seen one fragment alone.
@fragment
fn fs_first(v: Varyings, @builtin(front_facing) is_front: bool) -> First {
    let fragment = fragment_of(v, is_front);
    state = begin(Place(vec2u(v.position.xy), 0u));
    if turn(&state, 0u) {
        insert(&state, fragment, 0u);
    }
    return first(state);
}

@fragment
fn fs_composite(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(at.xy);
    state = seen_all(pixel);
    return end(&state, behind(pixel));
}
