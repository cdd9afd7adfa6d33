// Adaptive transparency (Salvi, Montgomery and Lefohn 2011): transmittance as a step function of K nodes
// (src/methods/adaptive.rs).

struct State {
    count: u32,
    removed: u32,
    coverage: Coverage,
    // Σ V α c, and last Σ V α.
    sum: vec4f,
}

struct Node {
    order: vec2u,
    depth: f32,
    // Of it and all in front of it.
    transmittance: f32,
}

// Outside the state: naga takes no pointer into a struct. One more than K, while one is removed.
var<private> nodes: array<Node, K + 1u>;

fn begin(place: Place) -> State {
    return State(0u, 0u, coverage_none(), vec4f(0.0));
}

fn turn(s: ptr<private, State>, pass_index: u32) -> bool {
    return pass_index == 0u || (pass_index == 1u && (*s).count > 0u);
}

// What the first `place` nodes let through.
fn visibility(place: u32) -> f32 {
    if place == 0u {
        return 1.0;
    }
    return nodes[place - 1u].transmittance;
}

// Of the nodes j and j − 1, what removing j changes in the area under the step function.
fn cost(j: u32) -> f32 {
    let front = nodes[j - 1u];
    let back = nodes[j];
    return (back.depth - front.depth) * (front.transmittance - back.transmittance);
}

// Of K + 1 nodes.
fn remove_least() {
    var least = 1u;
    var least_cost = cost(1u);
    for (var j = 2u; j <= K; j++) {
        // The farthest of equals: behind alpha 1 there are many of area 0, and no one sees them.
        let own = cost(j);
        if own <= least_cost {
            least = j;
            least_cost = own;
        }
    }
    nodes[least - 1u].transmittance = nodes[least].transmittance;
    for (var j = least; j < K; j++) {
        nodes[j] = nodes[j + 1u];
    }
}

fn insert(s: ptr<private, State>, fragment: Fragment, pass_index: u32) {
    let color = fragment.color;
    // No step, and were it the first node Σ V α might come to nothing.
    if color.a == 0.0 {
        return;
    }
    let order = order_of(fragment);
    var place = (*s).count;
    if pass_index == 1u {
        while place > 0u && !in_front(nodes[place - 1u].order, order) {
            place--;
        }
        let weight = visibility(place) * color.a;
        (*s).sum += vec4f(weight * color.rgb, weight);
        return;
    }
    (*s).coverage = coverage_add((*s).coverage, color.a);
    let through = 1.0 - color.a;
    while place > 0u && in_front(order, nodes[place - 1u].order) {
        let node = nodes[place - 1u];
        nodes[place] = Node(node.order, node.depth, node.transmittance * through);
        place--;
    }
    nodes[place] = Node(order, fragment.depth, visibility(place) * through);
    if (*s).count < K {
        (*s).count += 1u;
        return;
    }
    remove_least();
    (*s).removed += 1u;
}

fn end(s: ptr<private, State>, behind: vec4f) -> vec4f {
    let coverage = (*s).coverage;
    var layer = Layer(vec4f((*s).sum.rgb, coverage.alpha), coverage.transmittance);
    if RENORMALISES {
        layer = coverage_of_mean(coverage, (*s).sum);
    }
    return layer_over(layer, behind);
}

fn left_out(s: ptr<private, State>, count: u32) -> u32 {
    return (*s).removed;
}
