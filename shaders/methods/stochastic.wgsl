// Stochastic transparency (Enderton et al. 2010), with stratified coverage (src/methods/stochastic.rs).

const ESTIMATOR_MEAN = 0u;
const ESTIMATOR_VISIBILITY = 2u;

// Of a draw that nothing covers: behind all.
const UNCOVERED = vec2u(0xffffffffu, 0xffffffffu);

// Outside the state: naga takes no pointer into a struct.
var<private> draw_orders: array<vec2u, DRAWS>;
var<private> draw_colors: array<vec3f, DRAWS>;

struct State {
    hash: u32,
    coverage: Coverage,
    // Σ V α c, and last Σ V α.
    sum: vec4f,
}

// PCG's permutation of a step of its generator (Jarzynski and Olano 2020, JCGT 9(3)).
fn hash(value: u32) -> u32 {
    let stepped = value * 747796405u + 2891336453u;
    let word = ((stepped >> ((stepped >> 28u) + 4u)) ^ stepped) * 277803737u;
    return (word >> 22u) ^ word;
}

// How many draws a fragment covers: ⌊αS + ξ⌋, from ⌊αS⌋ and the rest, so that no sum rounds and alpha 1 covers all.
fn covered(alpha: f32, hashed: u32) -> u32 {
    let share = product(alpha, f32(DRAWS));
    let whole = floor(share);
    return u32(whole) + u32(f32(hashed >> 8u) / 16777216.0 < share - whole);
}

// Selection sampling (Knuth 1969, 3.4.2 S): of all subsets of the size drawn each is as likely.
fn draw(place: u32, fragment: Fragment) {
    let own = hash(place + fragment.primitive);
    let order = order_of(fragment);
    var wanted = covered(fragment.color.a, hash(own));
    for (var i = 0u; i < DRAWS; i++) {
        // Random below what is left: 24 bits and the 7 of 64 fit in 32.
        let random = ((hash(own + i + 1u) >> 8u) * (DRAWS - i)) >> 24u;
        if random < wanted {
            wanted -= 1u;
            if in_front(order, draw_orders[i]) {
                draw_orders[i] = order;
                draw_colors[i] = fragment.color.rgb;
            }
        }
    }
}

fn begin(place: Place) -> State {
    for (var i = 0u; i < DRAWS; i++) {
        draw_orders[i] = UNCOVERED;
    }
    let of_sample = hash(place.sample + hash(method.seed));
    let of_pixel = hash(place.pixel.x + hash(place.pixel.y + of_sample));
    return State(of_pixel, coverage_none(), vec4f(0.0));
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u || (pass_index == 1u && ESTIMATOR == ESTIMATOR_VISIBILITY);
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let color = fragment.color;
    if pass_index == 1u {
        var visible = 0u;
        for (var i = 0u; i < DRAWS; i++) {
            visible += u32(!in_front(draw_orders[i], order_of(fragment)));
        }
        let weight = f32(visible) * color.a;
        (*s).sum += vec4f(weight * color.rgb, weight);
        return;
    }
    (*s).coverage = coverage_add((*s).coverage, color.a);
    draw((*s).hash, fragment);
}

// From the sum of the colours of draws that are covered, and their number; of estimator c from that of weighted colours.
fn estimated(coverage: Coverage, sum: vec4f, behind: vec4f) -> vec4f {
    if ESTIMATOR == ESTIMATOR_MEAN {
        let all = f32(DRAWS);
        return layer_over(Layer(sum / all, (all - sum.a) / all), behind);
    }
    return layer_over(coverage_of_mean(coverage, sum), behind);
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    var sum = (*s).sum;
    if ESTIMATOR != ESTIMATOR_VISIBILITY {
        for (var i = 0u; i < DRAWS; i++) {
            if in_front(draw_orders[i], UNCOVERED) {
                sum += vec4f(draw_colors[i], 1.0);
            }
        }
    }
    return estimated((*s).coverage, sum, behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return 0u;
}
