// What a method sees: fragments, whose they are, and what it is given with each frame.

struct Method {
    // The depths that depths are normalised by.
    nearest: f32,
    farthest: f32,
    beta: f32,
    seed: u32,
    // The first row of pixels that there is room for.
    first_row: u32,
    // At most so many, whatever a method asks for.
    passes: u32,
    pad1: u32,
    pad2: u32,
}

// What a method sees of a fragment.
struct Fragment {
    // Straight.
    color: vec4f,
    depth: f32,
    // Smaller is in front; of equal ones the later primitive.
    key: u32,
    primitive: u32,
    // Of `affine`: 0, over, but for methods that take modes.
    mode: u32,
}

// Whose fragments these are.
struct Place {
    pixel: vec2u,
    sample: u32,
}

// For `in_front`.
fn order_of(fragment: Fragment) -> vec2u {
    return vec2u(fragment.key, ~fragment.primitive);
}
