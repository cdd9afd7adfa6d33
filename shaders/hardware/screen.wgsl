// Passes over all pixels: a triangle that the screen is in, and what lies behind all fragments.

@group(2) @binding(0) var background_image: texture_2d<f32>;
@group(2) @binding(1) var opaque_color: texture_2d<f32>;

@vertex
fn vs_screen(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    let corner = vec2f(f32(index & 1u), f32(index >> 1u));
    return vec4f(4.0 * corner - 1.0, 0.0, 1.0);
}

// Straight.
fn behind(pixel: vec2u) -> vec4f {
    if HIDES {
        let color = textureLoad(opaque_color, pixel, 0);
        if color.a == 1.0 {
            return color;
        }
    }
    if view.background_texture == 1u {
        return textureLoad(background_image, pixel, 0);
    }
    return view.background;
}
