// A workgroup takes a tile, each invocation a pixel, and walks the tile's triangles from workgroup memory.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> window: Window;
@group(0) @binding(2) var<storage, read> rasters: array<Raster>;
@group(0) @binding(3) var<storage, read> key_planes: array<KeyPlane>;
@group(0) @binding(4) var<storage, read> slopes: array<vec4f>;
@group(0) @binding(5) var<storage, read> pieces: array<array<i32, 6>>;
@group(0) @binding(6) var<storage, read> faces: array<u32>;
@group(0) @binding(7) var<storage, read> colors: array<vec4f>;
@group(0) @binding(8) var<storage, read> tiles: array<Span>;
@group(0) @binding(9) var<storage, read> tile_entries: array<u32>;
@group(0) @binding(10) var<storage, read> boxes: array<vec2u>;
@group(0) @binding(11) var<storage, read> color_starts: array<u32>;

struct Span {
    first: u32,
    count: u32,
}

// The part of each tile's list that a workgroup walks: Mesa's llvmpipe ends loops after 65,535 turns, silently.
struct Window {
    first: u32,
    count: u32,
    tiles_x: u32,
    // Room for parts of one class.
    parts: u32,
    // The first row of tiles that there are lists of.
    first_row: u32,
    // Fragments that there is room for where lists are kept.
    list_capacity: u32,
    pad0: u32,
    pad1: u32,
}

struct Item {
    edges: Edges,
    key: KeyPlane,
    id: u32,
    flags: u32,
    first_piece: i32,
    piece_count: i32,
}

fn item_of(id: u32, x0: i32, y0: i32) -> Item {
    let r = rasters[id];
    var item: Item;
    item.key = key_planes[id];
    item.id = id;
    item.flags = flags_of(r);
    if (item.flags & PIECES) == 0u {
        item.edges = edges_at_pixel(r, unpacked_box(boxes[id]), x0, y0);
    } else if r.slopes.y == 1 {
        item.edges = edges_of(pieces[r.slopes.x], x0, y0);
    } else {
        item.first_piece = r.slopes.x;
        item.piece_count = r.slopes.y;
    }
    return item;
}

// Whether one of several pieces covers a pixel of the tile.
fn pieces_cover(first: i32, count: i32, corner: vec2i, place: vec2i) -> bool {
    var found = false;
    for (var p = 0; p < count; p++) {
        let edges = edges_of(pieces[first + p], corner.x, corner.y);
        let e = edges.q + edges.a * place.x + edges.b * place.y;
        found |= (e.x | e.y | e.z) >= 0;
    }
    return found;
}

// The value that the key is made from, at a position in pixels.
fn value_at(k: KeyPlane, at: vec2f) -> f32 {
    let d = at - k.rest.yz;
    return clamped(k.plane.x + product(k.plane.y, d.x) + product(k.plane.z, d.y), k.plane.w, k.rest.x);
}

// Straight RGBA.
fn color_at(id: u32, flags: u32, k: KeyPlane, at: vec2f) -> vec4f {
    if COLORS_BY_TRIANGLE {
        return colors[id];
    }
    let first = color_starts[id];
    if !HAS_GRADIENTS || (flags & GRADIENT) == 0u {
        return colors[first];
    }
    var corner = array<vec4f, 3>();
    for (var i = 0u; i < 3u; i++) {
        let given = (flags >> (ORDER_SHIFT + 2u * i)) & 3u;
        if (flags & BY_CORNER) != 0u {
            corner[i] = colors[first + given];
        } else {
            corner[i] = colors[first + faces[3u * id + given]];
        }
    }
    // Barycentric coordinates over w are planes too: 1/w at their own corner, 0 at the others.
    let anchor = (flags >> ANCHOR_SHIFT) & 3u;
    let d = at - k.rest.yz;
    let slope = slopes[id];
    let perspective = view.perspective == 1u;
    let own = select(1.0, k.plane.x, perspective);
    let w = select(1.0, 1.0 / value_at(k, at), perspective);
    let b = saturate((select(0.0, own, anchor == 1u) + dot(slope.xy, d)) * w);
    let c = clamp((select(0.0, own, anchor == 2u) + dot(slope.zw, d)) * w, 0.0, 1.0 - b);
    let mixed = corner[0] + b * (corner[1] - corner[0]) + c * (corner[2] - corner[0]);
    let low = min(corner[0], min(corner[1], corner[2]));
    let high = max(corner[0], max(corner[1], corner[2]));
    return clamp(mixed, low, high);
}
