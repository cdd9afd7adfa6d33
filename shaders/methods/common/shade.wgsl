// What methods share that first approximate F, the absorbance in front of each depth, and then shade by it
// (Münstermann et al. 2018; src/methods/common/shade.rs).

// −ln 10⁻⁵: that of an opaque layer would drown those of all others.
const MOST_BOUNDED = 11.512925464970229;

fn bounded_absorbance(alpha: f32) -> f32 {
    return min(absorbance(alpha), MOST_BOUNDED);
}

// Colours weighted by what is in front of them.
struct Shade {
    // Σ e^(least − F) α c, and last Σ e^(least − F) α. A common factor cancels; without it, all e^−F of a thousand
    // opaque layers are 0.
    sum: vec4f,
    least: f32,
    coverage: Coverage,
}

fn shade_none() -> Shade {
    return Shade(vec4f(0.0), 0.0, coverage_none());
}

// A fragment, straight, behind an absorbance.
fn shade_add(shade: Shade, color: vec4f, in_front_of_it: f32) -> Shade {
    var sum = shade.sum;
    var least = shade.least;
    if sum.a == 0.0 || in_front_of_it < least {
        sum *= exp(min(in_front_of_it - least, 0.0));
        least = in_front_of_it;
    }
    let weight = color.a * exp(least - in_front_of_it);
    return Shade(sum + vec4f(weight * color.rgb, weight), least, coverage_add(shade.coverage, color.a));
}

// All of them as one layer.
fn shade_layer(shade: Shade) -> Layer {
    return coverage_of_mean(shade.coverage, shade.sum);
}
