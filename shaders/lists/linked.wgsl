// Linked lists: a pixel's head is a link to its latest node. Links hold a node's index plus one, and 0 for none:
// buffers are cleared to zero.

struct Cursor {
    link: u32,
}

fn first_of(pixel: u32) -> Cursor {
    return Cursor(heads[pixel]);
}

fn is_end(c: Cursor) -> bool {
    return c.link == 0u;
}

fn node_at(c: Cursor) -> u32 {
    return c.link - 1u;
}

fn advance(c: ptr<function, Cursor>) {
    (*c).link = next_of((*c).link - 1u);
}

// As the build counted them.
fn length_of(pixel: u32) -> u32 {
    return counts[pixel];
}
