// k-buffer (Bavoil et al. 2007): the K nearest fragments exactly, in front of the others' tail (src/methods/k_buffer.rs).

const TAIL_DROP = 0u;
const TAIL_BLEND = 1u;
const TAIL_AVERAGE = 2u;

struct State {
    tail_count: u32,
    sum: vec4f,
    painted: Layer,
}

fn begin(place: Place) -> State {
    nearest_begin();
    return State(0u, vec4f(0.0), layer_clear());
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u || (pass_index == 1u && TAIL == TAIL_BLEND && (*s).tail_count > 0u);
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    if pass_index == 1u {
        if nearest_end_before(fragment) {
            (*s).painted = layer_onto(layer_of(fragment.color), (*s).painted);
        }
        return;
    }
    let far = nearest_insert(fragment);
    if !is_free(far.order) {
        (*s).tail_count += 1u;
        (*s).sum += vec4f(far.color.a * far.color.rgb, far.color.a);
    }
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    var tail = layer_clear();
    if TAIL == TAIL_BLEND {
        tail = (*s).painted;
    } else if TAIL == TAIL_AVERAGE {
        tail = coverage_of_mean(coverage_of_equal((*s).sum.a, (*s).tail_count), (*s).sum);
    }
    return layer_over(layer_onto(nearest_layer(), tail), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return (*s).tail_count;
}
