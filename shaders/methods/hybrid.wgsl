// Hybrid transparency (Maule et al. 2013): the K nearest fragments exactly, in front of the mean of the others
// (src/methods/hybrid.rs).

struct State {
    tail_count: u32,
    // Σ α c of the tail, and last Σ α.
    sum: vec4f,
    coverage: Coverage,
}

fn begin(place: Place) -> State {
    nearest_begin();
    return State(0u, vec4f(0.0), coverage_none());
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let far = nearest_insert(fragment);
    if !is_free(far.order) {
        (*s).tail_count += 1u;
        (*s).sum += vec4f(far.color.a * far.color.rgb, far.color.a);
        (*s).coverage = coverage_add((*s).coverage, far.color.a);
    }
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    var coverage = (*s).coverage;
    if AVERAGES {
        coverage = coverage_of_equal((*s).sum.a, (*s).tail_count);
    }
    return layer_over(layer_onto(nearest_layer(), coverage_of_mean(coverage, (*s).sum)), behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return (*s).tail_count;
}
