// No list is kept.

fn begin_list(n: u32, local: u32) {}

fn end_list(pixel: u32) {}

// Whether what lies behind can be left out.
fn is_done(state: State) -> bool {
    return is_saturated(state, view.least_transmittance);
}

fn keep(i: u32, id: u32, at: vec2f, color: vec4f) {}
