// Slots that hold fragments in their order.

// The order of a slot that is free: behind all.
const FREE = vec2u(0xffffffffu, 0xffffffffu);

fn is_free(order: vec2u) -> bool {
    return order.x == FREE.x && order.y == FREE.y;
}
