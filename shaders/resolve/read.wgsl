// What the stages after the build see: lists to read, what is behind them, and where results go.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> band: Band;
// Where each pixel's list begins, as links or offsets: lists/linked.wgsl or lists/contiguous.wgsl.
@group(0) @binding(2) var<storage, read> heads: array<u32>;
@group(0) @binding(3) var<storage, read> nodes: array<u32>;
// A colour a pixel, or where samples are asked for one a sample.
@group(0) @binding(4) var<storage, read_write> image: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> counts: array<u32>;
@group(0) @binding(6) var background_image: texture_2d<f32>;

// What blending sees of a fragment.
struct Source {
    color: vec4f, // straight
    mode: u32,
    depth: f32, // eye depth; only where a user's blend may ask for it
}

fn source_of(node: u32) -> Source {
    var depth = 0.0;
    if USER_BLENDS {
        depth = depth_of(node);
    }
    return Source(color_of(node), mode_of(node), depth);
}

// Straight RGBA behind a sample's fragments. pixel: of the band.
fn behind(pixel: u32, s: u32) -> vec4f {
    if HIDES {
        // Opaque surfaces have alpha 1, and elsewhere the target is cleared to 0.
        let color = opaque_at(place_of(pixel), s);
        if color.a == 1.0 {
            return color;
        }
    }
    if view.background_texture == 1u {
        return textureLoad(background_image, place_of(pixel), 0);
    }
    return view.background;
}

// Where a pixel of the band is in the image.
fn place_of(pixel: u32) -> vec2u {
    return vec2u(pixel % band.width + band.x0, pixel / band.width + band.y0);
}

fn weight_of(color: vec4f) -> f32 {
    if MSAA_RESOLVE == MSAA_HDR {
        // A user's blend may go below 0.
        return 1.0 / (1.0 + max(0.0, max(color.r, max(color.g, color.b))));
    }
    return 1.0;
}

// Writes a pixel's samples, or their mean (GPU Pro 2, section 2.8.3).
fn finish(pixel: u32, colors: ptr<function, array<vec4f, SAMPLES>>) {
    if MSAA_RESOLVE == MSAA_NONE {
        for (var s = 0u; s < SAMPLES; s++) {
            image[pixel * SAMPLES + s] = (*colors)[s];
        }
        return;
    }
    if SAMPLES == 1u {
        image[pixel] = (*colors)[0];
        return;
    }
    var sum = vec4f(0.0);
    var weights = 0.0;
    for (var s = 0u; s < SAMPLES; s++) {
        let weight = weight_of((*colors)[s]);
        sum += weight * (*colors)[s];
        weights += weight;
    }
    image[pixel] = sum / weights;
}

fn finish_empty(pixel: u32) {
    var colors: array<vec4f, SAMPLES>;
    for (var s = 0u; s < SAMPLES; s++) {
        let color = behind(pixel, s);
        let state = blend_begin(color);
        colors[s] = blend_end(state, color);
    }
    finish(pixel, &colors);
}
