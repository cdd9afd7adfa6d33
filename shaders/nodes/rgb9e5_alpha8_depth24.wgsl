// rgb9e5_alpha8_depth24: colours over 1, with nine bits of mantissa and an exponent that the channels share
// (the layout of Vulkan's E5B9G9R9 and Direct3D's R9G9B9E5).

const LARGEST = 65408.0; // (2⁹ − 1) · 2⁷

fn encode(f: Fragment, next: u32) -> array<u32, BASE_WORDS> {
    let rgb = clamp(f.color.rgb, vec3f(0.0), vec3f(LARGEST));
    let most = max(rgb.r, max(rgb.g, rgb.b));
    // The power of two over the largest channel, as bits tell it: no logarithm to round.
    var exponent = max(i32(bitcast<u32>(most) >> 23u) - 126, -15);
    if most * exp2_of(9 - exponent) + 0.5 >= 512.0 {
        exponent++; // it would round up to 2⁹
    }
    let c = vec3u(rgb * exp2_of(9 - exponent) + 0.5);
    let color = (u32(exponent + 15) << 27u) | (c.b << 18u) | (c.g << 9u) | c.r;
    let alpha = u32(saturate(f.color.a) * 255.0 + 0.5);
    return array<u32, BASE_WORDS>(next, (depth_code(f.value, LAST_CODE) << 8u) | alpha, color);
}

// 2ⁿ for normal results.
fn exp2_of(n: i32) -> f32 {
    return bitcast<f32>(u32(n + 127) << 23u);
}

fn next_of(node: u32) -> u32 {
    return word(node, 0u);
}

// Alpha decides only between equal depths, like the colour after it.
fn key_of(node: u32) -> u32 {
    return select(word(node, 1u), word(node, 1u) >> 8u, HAS_ORDER);
}

fn tie_of(node: u32) -> u32 {
    return word(node, 2u);
}

fn spare_of(node: u32) -> u32 {
    return 0u;
}

fn color_of(node: u32) -> vec4f {
    let c = word(node, 2u);
    let rgb = vec3f(vec3u(c & 511u, (c >> 9u) & 511u, (c >> 18u) & 511u));
    return vec4f(rgb * exp2_of(i32(c >> 27u) - 24), f32(word(node, 1u) & 255u) / 255.0);
}

fn value_of(node: u32) -> f32 {
    return value_of_code(word(node, 1u) >> 8u);
}
