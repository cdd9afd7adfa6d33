// Fragments kept as places of triangles in the tile's list: planes come from where a cache holds them.

var<private> tile_first: u32;

fn id_of_place(t: u32) -> u32 {
    return tile_entries[tile_first + t];
}

fn value_of_place(t: u32, at: vec2f) -> f32 {
    return value_at(key_planes[id_of_place(t)], at);
}
