// Layers: what several fragments together add to a pixel and what they let through (src/methods/common/layer.rs). Alpha
// is accumulated, as A + T α: as 1 − T it would lose every small alpha to cancellation.

struct Layer {
    // Premultiplied.
    rgba: vec4f,
    transmittance: f32,
}

fn layer_clear() -> Layer {
    return Layer(vec4f(0.0), 1.0);
}

// One fragment, straight.
fn layer_of(color: vec4f) -> Layer {
    return Layer(vec4f(color.a * color.rgb, color.a), 1.0 - color.a);
}

fn layer_onto(front: Layer, back: Layer) -> Layer {
    return Layer(front.rgba + front.transmittance * back.rgba, front.transmittance * back.transmittance);
}

// Premultiplied, over a straight background.
fn layer_over(layer: Layer, behind: vec4f) -> vec4f {
    return layer_onto(layer, layer_of(behind)).rgba;
}

// Alpha 1 − Π (1 − αᵢ) and transmittance of fragments in whatever order they come.
struct Coverage {
    alpha: f32,
    transmittance: f32,
}

fn coverage_none() -> Coverage {
    return Coverage(0.0, 1.0);
}

fn coverage_add(c: Coverage, alpha: f32) -> Coverage {
    return Coverage(c.alpha + c.transmittance * alpha, c.transmittance * (1.0 - alpha));
}

// A layer of this coverage, of the mean of weighted colours: their sum, and last the sum of their weights. Black where
// the weights come to nothing.
fn coverage_of_mean(c: Coverage, sum: vec4f) -> Layer {
    var color = vec3f(0.0);
    if sum.a > 0.0 {
        color = sum.rgb / sum.a * c.alpha;
    }
    return Layer(vec4f(color, c.alpha), c.transmittance);
}
