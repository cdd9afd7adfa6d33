// Fourier opacity mapping (Jansen and Bavoil 2010; src/methods/fourier.rs).

const PI = 3.141592653589793;

// Outside the state: naga takes no pointer into a struct. Σ a cos 2πk x and Σ a sin 2πk x, of k from 1 on.
var<private> coefficients: array<vec2f, TERMS>;

struct State {
    total: f32,
    shade: Shade,
}

// cos and sin of 2πx, for x from 0 to 1: WGSL's own may be off by 2⁻¹¹. Taylor's series within an eighth of a turn,
// whose next terms are below 2⁻²⁴, then quarters.
fn wave(x: f32) -> vec2f {
    let quarter = floor(4.0 * x + 0.5);
    let t = (4.0 * x - quarter) * (0.5 * PI);
    let t2 = t * t;
    let c = 1.0 - t2 * (1.0 / 2.0 - t2 * (1.0 / 24.0 - t2 * (1.0 / 720.0 - t2 * (1.0 / 40320.0))));
    let s = t * (1.0 - t2 * (1.0 / 6.0 - t2 * (1.0 / 120.0 - t2 * (1.0 / 5040.0 - t2 * (1.0 / 362880.0)))));
    switch u32(quarter) & 3u {
        case 0u: {
            return vec2f(c, s);
        }
        case 1u: {
            return vec2f(-s, c);
        }
        case 2u: {
            return vec2f(-c, -s);
        }
        default: {
            return vec2f(s, -c);
        }
    }
}

// One term's, k times as often, from the next lower's.
fn turned(w: vec2f, by: vec2f) -> vec2f {
    return vec2f(w.x * by.x - w.y * by.y, w.y * by.x + w.x * by.y);
}

// F, at least 0.
fn absorbance_in_front(total: f32, x: f32) -> f32 {
    let first = wave(x);
    var w = first;
    var sum = total * x;
    for (var k = 1u; k <= TERMS; k++) {
        let c = coefficients[k - 1u];
        sum += (c.x * w.y + c.y * (1.0 - w.x)) / (PI * f32(k));
        w = turned(w, first);
    }
    return max(sum, 0.0);
}

fn begin(place: Place) -> State {
    coefficients = array<vec2f, TERMS>();
    return State(0.0, shade_none());
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index < 2u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let x = depth_in_range(fragment.depth);
    if pass_index == 1u {
        (*s).shade = shade_add((*s).shade, fragment.color, absorbance_in_front((*s).total, x));
        return;
    }
    let a = bounded_absorbance(fragment.color.a);
    let first = wave(x);
    var w = first;
    for (var k = 0u; k < TERMS; k++) {
        coefficients[k] += a * w;
        w = turned(w, first);
    }
    (*s).total += a;
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    return layer_over(shade_layer((*s).shade), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
