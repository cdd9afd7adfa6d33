// Contiguous lists: pixel p owns nodes heads[p] to heads[p + 1], in the order that they came.

struct Cursor {
    link: u32,
    end: u32,
}

fn first_of(pixel: u32) -> Cursor {
    return Cursor(heads[pixel], heads[pixel + 1u]);
}

fn is_end(c: Cursor) -> bool {
    return c.link == c.end;
}

fn node_at(c: Cursor) -> u32 {
    return c.link;
}

fn advance(c: ptr<function, Cursor>) {
    (*c).link++;
}

fn length_of(pixel: u32) -> u32 {
    return heads[pixel + 1u] - heads[pixel];
}
