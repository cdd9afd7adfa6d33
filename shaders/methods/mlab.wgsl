// Multi-layer alpha blending (Salvi and Vaidyanathan 2014): K nodes, the last two merged where there are more
// (src/methods/mlab.rs).

struct State {
    merged: u32,
}

// Outside the state: naga takes no pointer into a struct. A layer of a free node is clear.
var<private> node_orders: array<vec2u, K>;
var<private> node_layers: array<Layer, K>;

fn begin(place: Place) -> State {
    for (var i = 0u; i < K; i++) {
        node_orders[i] = FREE;
        node_layers[i] = layer_clear();
    }
    return State(0u);
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u;
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    // What is invisible would take a node from what is not.
    if fragment.color.a == 0.0 {
        return;
    }
    // Passed on from node to node: each keeps the nearer of two.
    var order = order_of(fragment);
    var layer = layer_of(fragment.color);
    for (var i = 0u; i < K; i++) {
        if in_front(order, node_orders[i]) {
            let own_order = node_orders[i];
            let own_layer = node_layers[i];
            node_orders[i] = order;
            node_layers[i] = layer;
            order = own_order;
            layer = own_layer;
        }
    }
    if !is_free(order) {
        (*s).merged += 1u;
        node_layers[K - 1u] = layer_onto(node_layers[K - 1u], layer);
    }
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    var layer = layer_clear();
    for (var i = 0u; i < K; i++) {
        layer = layer_onto(layer, node_layers[i]);
    }
    return layer_over(layer, behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return (*s).merged;
}
