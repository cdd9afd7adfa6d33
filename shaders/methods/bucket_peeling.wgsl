// Bucket depth peeling (Liu et al. 2009): the nearest fragment of each of BUCKETS equal parts of the pixel's depth range
// (src/methods/bucket_peeling.rs).

struct State {
    // The least and the greatest depth.
    least: f32,
    greatest: f32,
    kept: u32,
}

// Outside the state: naga takes no pointer into a struct.
var<private> bucket_orders: array<vec2u, BUCKETS>;
var<private> bucket_colors: array<vec4f, BUCKETS>;

fn begin(place: Place) -> State {
    for (var i = 0u; i < BUCKETS; i++) {
        bucket_orders[i] = FREE;
    }
    return State(3.4e38, -3.4e38, 0u);
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u || (pass_index == 1u && (*s).least <= (*s).greatest);
}

fn bucket_of(depth: f32, least: f32, greatest: f32) -> u32 {
    let range = greatest - least;
    if range > 0.0 {
        return min(u32((depth - least) / range * f32(BUCKETS)), BUCKETS - 1u);
    }
    return 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    if pass_index == 0u {
        (*s).least = min((*s).least, fragment.depth);
        (*s).greatest = max((*s).greatest, fragment.depth);
        return;
    }
    let bucket = bucket_of(fragment.depth, (*s).least, (*s).greatest);
    (*s).kept += select(0u, 1u, is_free(bucket_orders[bucket]));
    let order = order_of(fragment);
    if in_front(order, bucket_orders[bucket]) {
        bucket_orders[bucket] = order;
        bucket_colors[bucket] = fragment.color;
    }
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    var layer = layer_clear();
    for (var i = 0u; i < BUCKETS; i++) {
        if !is_free(bucket_orders[i]) {
            layer = layer_onto(layer, layer_of(bucket_colors[i]));
        }
    }
    return layer_over(layer, behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return count - (*s).kept;
}
