// The nearest fragments of a pixel, front to back, at most K (src/methods/common/nearest.rs).

// Outside the state: naga takes no pointer into a struct.
var<private> nearest_orders: array<vec2u, K>;
var<private> nearest_colors: array<vec4f, K>;

fn nearest_begin() {
    for (var i = 0u; i < K; i++) {
        nearest_orders[i] = FREE;
    }
}

struct Farthest {
    order: vec2u,
    color: vec4f,
}

// Takes a fragment in. Returns what that leaves no room for, which is this one perhaps, or a free slot.
fn nearest_insert(fragment: Fragment) -> Farthest {
    // Passed on from slot to slot: each keeps the nearer of two.
    var order = order_of(fragment);
    var color = fragment.color;
    for (var i = 0u; i < K; i++) {
        let own_order = nearest_orders[i];
        let own_color = nearest_colors[i];
        let is_nearer = in_front(order, own_order);
        nearest_orders[i] = select(own_order, order, is_nearer);
        nearest_colors[i] = select(own_color, color, is_nearer);
        order = select(order, own_order, is_nearer);
        color = select(color, own_color, is_nearer);
    }
    return Farthest(order, color);
}

// Whether all of them are in front of a fragment.
fn nearest_end_before(fragment: Fragment) -> bool {
    return in_front(nearest_orders[K - 1u], order_of(fragment));
}

// All of them together.
fn nearest_layer() -> Layer {
    var layer = layer_clear();
    for (var i = 0u; i < K; i++) {
        if !is_free(nearest_orders[i]) {
            layer = layer_onto(layer, layer_of(nearest_colors[i]));
        }
    }
    return layer;
}
