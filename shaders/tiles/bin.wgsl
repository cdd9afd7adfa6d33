// Binning: for each 16×16 tile the triangles that may cover it, in submission order whatever the scheduler does.
//
// Two levels. Chunks of triangles are counted and scattered into bins of many tiles, then a workgroup takes a bin and
// does the same for its tiles. A triangle's place in a list is a count of the bits before its own in a mask of 256
// triangles, so that no list is ever sorted. Where a bin's or a tile's list begins depends on the scheduler, what
// is in it does not.

struct Grid {
    tiles_x: u32,
    tiles_y: u32,
    bins_x: u32,
    bins_y: u32,
    // A bin is 2^bin_shift tiles wide and high.
    bin_shift: u32,
    triangles: u32,
    chunks: u32,
    // Blocks of triangles in a chunk.
    blocks: u32,
    bin_capacity: u32,
    tile_capacity: u32,
    // Loop iterations that an invocation may take, where a driver ends loops silently.
    trips: u32,
    // Room for parts of one class.
    parts: u32,
    // Triangles of a block, at most BLOCK.
    block: u32,
    // The first row of tiles of the band; tiles and bins are numbered from there.
    first_row: u32,
    pad0: u32,
    pad1: u32,
}

struct Span {
    first: u32,
    count: u32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> rasters: array<Raster>;
@group(0) @binding(3) var<storage, read> pieces: array<array<i32, 6>>;
@group(0) @binding(5) var<storage, read_write> counters: Counters;
// Of each bin and chunk: how many of its triangles may touch the bin, then how many of those before it do.
@group(0) @binding(6) var<storage, read_write> matrix: array<u32>;
@group(0) @binding(7) var<storage, read_write> bins: array<Span>;
@group(0) @binding(8) var<storage, read_write> bin_entries: array<u32>;
@group(0) @binding(9) var<storage, read_write> tiles: array<Span>;
@group(0) @binding(10) var<storage, read_write> tile_entries: array<u32>;
@group(0) @binding(11) var<storage, read_write> classes: Classes;
@group(0) @binding(12) var<storage, read_write> parts: array<u32>;
@group(0) @binding(4) var<storage, read> boxes: array<vec2u>;

const BLOCK = 256u;
// Words of a mask of BLOCK triangles.
const WORDS = 8u;

// Bit t of bin b, or of tile b: triangle t of the block may touch it.
var<workgroup> masks: array<atomic<u32>, MAX_BINS * WORDS>;
// How many entries each bin has so far.
var<workgroup> filled: array<atomic<u32>, MAX_BINS>;

// A triangle's box in the band, whose first row is 0.
fn box_in_band(packed: vec2u) -> vec4i {
    let box = unpacked_box(packed) - vec4i(0, band_y(), 0, band_y());
    return vec4i(box.x, max(box.y, 0), box.z, min(box.w, TILE * i32(grid.tiles_y) - 1));
}

fn band_y() -> i32 {
    return TILE * i32(grid.first_row);
}

fn bin_of(tile: i32) -> i32 {
    return tile >> grid.bin_shift;
}

// What tells where a triangle may lie: its edges at the first pixel of its box, or the corners of a large one.
struct Shape {
    edges: Edges,
    origin: vec2i,
    corners: array<i32, 6>,
    // 0: edges, 1: corners, 2: several pieces, which may lie anywhere in the box.
    kind: u32,
}

fn shape_of(id: u32) -> Shape {
    var s: Shape;
    let r = rasters[id];
    let box = unpacked_box(boxes[id]);
    s.origin = box.xy;
    if (flags_of(r) & PIECES) == 0u {
        s.edges = edges_at_pixel(r, box, box.x, box.y);
    } else if r.slopes.y == 1 {
        s.corners = pieces[r.slopes.x];
        s.kind = 1u;
    } else {
        s.kind = 2u;
    }
    return s;
}

// Whether it covers no sample of a square of the band's pixels, as far as this can tell: a few too many do no harm.
fn misses_square(s: Shape, in_band: vec2i, size: i32) -> bool {
    let first = in_band + vec2i(0, band_y());
    if s.kind == 0u {
        var e = s.edges;
        e.q += e.a * (first.x - s.origin.x) + e.b * (first.y - s.origin.y);
        return misses(e, size, size);
    }
    return s.kind == 1u && misses_large(s.corners, first, size);
}

// Whether all of a square lies outside one edge of a large triangle, by more than rounding.
fn misses_large(corners: array<i32, 6>, pixel: vec2i, size: i32) -> bool {
    let first = vec2f(pixel) * 256.0;
    let p = array<vec2f, 3>(
        vec2f(f32(corners[0]), f32(corners[1])),
        vec2f(f32(corners[2]), f32(corners[3])),
        vec2f(f32(corners[4]), f32(corners[5])),
    );
    for (var i = 0; i < 3; i++) {
        let d = p[(i + 1) % 3] - p[i];
        // The corner of the square that is farthest inside.
        let last = vec2f(f32(size) * 256.0);
        let to = first + select(vec2f(0.0), last, vec2<bool>((d.y < 0.0), (d.x > 0.0))) - p[i];
        let along = d.x * to.y;
        let across = d.y * to.x;
        // Of coordinates below 2^26, their differences and two products.
        if along - across < -(abs(along) + abs(across)) * 0x1p-20 - 1.0 {
            return true;
        }
    }
    return false;
}

fn box_in_bins(box: vec4i) -> vec4i {
    return vec4i(bin_of(box.x >> 4u), bin_of(box.y >> 4u), bin_of(box.z >> 4u), bin_of(box.w >> 4u));
}

// Of a box of squares the one of this number.
fn square_of(box: vec4i, number: u32) -> vec2i {
    let width = u32(box.z - box.x + 1);
    return box.xy + vec2i(vec2u(number % width, number / width));
}

fn squares_in(box: vec4i) -> u32 {
    return u32(max(box.z - box.x + 1, 0) * max(box.w - box.y + 1, 0));
}

// Of so few squares a small triangle touches nearly always all.
fn is_small(box: vec4i) -> bool {
    return max(box.z - box.x, box.w - box.y) <= 1;
}

fn count_before(slot: u32, t: u32) -> u32 {
    var before = countOneBits(atomicLoad(&masks[slot * WORDS + t / 32u]) & ((1u << (t % 32u)) - 1u));
    for (var w = 0u; w < t / 32u; w++) {
        before += countOneBits(atomicLoad(&masks[slot * WORDS + w]));
    }
    return before;
}

fn count_all(slot: u32) -> u32 {
    var all = 0u;
    for (var w = 0u; w < WORDS; w++) {
        all += countOneBits(atomicLoad(&masks[slot * WORDS + w]));
    }
    return all;
}

var<workgroup> shared_first: u32;
