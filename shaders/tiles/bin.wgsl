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

var<workgroup> shared_box: array<atomic<u32>, 4>;

@compute @workgroup_size(256)
fn cs_count_bins(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let bin_count = grid.bins_x * grid.bins_y;
    for (var b = local; b < bin_count; b += BLOCK) {
        atomicStore(&filled[b], 0u);
    }
    if local < 4u {
        atomicStore(&shared_box[local], 0u);
    }
    workgroupBarrier(); // all counts are 0
    var own = vec4u(0u);
    // Where triangles are few, several invocations share one's squares.
    let lanes = BLOCK / grid.block;
    let lane = local % lanes;
    for (var block = 0u; block < grid.blocks; block++) {
        let t = (group.x * grid.blocks + block) * grid.block + local / lanes;
        var pixels = vec4i(1, 1, 0, 0);
        if t < grid.triangles {
            pixels = box_in_band(boxes[t]);
        }
        if !is_empty(pixels) {
            if !HIDES || (flags_of(rasters[t]) & OPAQUE) == 0u {
                let whole = unpacked_box(boxes[t]);
                own = max(own, vec4u(vec4i(65536 - whole.xy, whole.zw + 1)));
            }
            let box = box_in_bins(pixels);
            let size = 16i << grid.bin_shift;
            var shape: Shape;
            if !is_small(box) {
                shape = shape_of(t);
            }
            for (var i = lane; i < squares_in(box); i += lanes) {
                let bin = square_of(box, i);
                if is_small(box) || !misses_square(shape, bin * size, size) {
                    atomicAdd(&filled[u32(bin.y) * grid.bins_x + u32(bin.x)], 1u);
                }
            }
        }
    }
    if own.z > 0u {
        for (var i = 0u; i < 4u; i++) {
            atomicMax(&shared_box[i], own[i]);
        }
    }
    workgroupBarrier(); // the chunk is counted
    if local < 4u {
        atomicMax(&counters.box[local], atomicLoad(&shared_box[local]));
    }
    for (var b = local; b < bin_count; b += BLOCK) {
        matrix[b * grid.chunks + group.x] = atomicLoad(&filled[b]);
    }
}

var<workgroup> sums: array<u32, BLOCK>;
var<workgroup> shared_first: u32;

// The sum of `value` over the invocations before this one; the sum of all is left in sums[BLOCK - 1] (Hillis and
// Steele 1986).
fn scan(value: u32, local: u32) -> u32 {
    sums[local] = value;
    for (var step = 1u; step < BLOCK; step *= 2u) {
        workgroupBarrier(); // sums of the step before are written
        var left = 0u;
        if local >= step {
            left = sums[local - step];
        }
        workgroupBarrier(); // and read by all
        sums[local] += left;
    }
    workgroupBarrier(); // the last step's sums are written
    return sums[local] - value;
}

// A workgroup a bin: where each chunk's entries go, and room for all of them.
@compute @workgroup_size(256)
fn cs_offsets(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    var before = 0u;
    for (var first = 0u; first < grid.chunks; first += BLOCK) {
        let c = first + local;
        var own = 0u;
        if c < grid.chunks {
            own = matrix[group.x * grid.chunks + c];
        }
        let offset = scan(own, local);
        if c < grid.chunks {
            matrix[group.x * grid.chunks + c] = before + offset;
        }
        before += sums[BLOCK - 1u];
        workgroupBarrier(); // the sums are read before the next round writes them
    }
    if local == 0u {
        bins[group.x] = Span(atomicAdd(&counters.bin_entries, before), before);
    }
}

@compute @workgroup_size(256)
fn cs_scatter_bins(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let bin_count = grid.bins_x * grid.bins_y;
    for (var b = local; b < bin_count; b += BLOCK) {
        atomicStore(&filled[b], bins[b].first + matrix[b * grid.chunks + group.x]);
    }
    let lanes = BLOCK / grid.block;
    let lane = local % lanes;
    let size = 16i << grid.bin_shift;
    for (var block = 0u; block < grid.blocks; block++) {
        for (var w = local; w < bin_count * WORDS; w += BLOCK) {
            atomicStore(&masks[w], 0u);
        }
        workgroupBarrier(); // the masks are empty, and all of the block before is written
        let own = local / lanes;
        let t = (group.x * grid.blocks + block) * grid.block + own;
        var pixels = vec4i(1, 1, 0, 0);
        if t < grid.triangles {
            pixels = box_in_band(boxes[t]);
        }
        var box = vec4i(0, 0, -1, -1);
        var shape: Shape;
        if !is_empty(pixels) {
            box = box_in_bins(pixels);
            if !is_small(box) {
                shape = shape_of(t);
            }
        }
        for (var i = lane; i < squares_in(box); i += lanes) {
            let bin = square_of(box, i);
            if is_small(box) || !misses_square(shape, bin * size, size) {
                atomicOr(&masks[(u32(bin.y) * grid.bins_x + u32(bin.x)) * WORDS + own / 32u], 1u << (own % 32u));
            }
        }
        workgroupBarrier(); // the masks are complete
        for (var i = lane; i < squares_in(box); i += lanes) {
            let bin = square_of(box, i);
            let b = u32(bin.y) * grid.bins_x + u32(bin.x);
            if (atomicLoad(&masks[b * WORDS + own / 32u]) >> (own % 32u) & 1u) == 1u {
                let place = atomicLoad(&filled[b]) + count_before(b, own);
                if place < grid.bin_capacity {
                    bin_entries[place] = t;
                }
            }
        }
        workgroupBarrier(); // all places are taken
        for (var b = local; b < bin_count; b += BLOCK) {
            atomicStore(&filled[b], atomicLoad(&filled[b]) + count_all(b));
        }
    }
}

// Marks the tiles of a bin that triangle `own` of the block may touch. `box`: of the triangle, in tiles of the bin.
fn mark_tiles(id: u32, box_and_share: vec2u, box: vec4i, bin: vec2i, own: u32, lane: u32, lanes: u32, weighs: bool) {
    let pixels = box_in_band(box_and_share);
    let small = is_small(pixels >> vec4u(4u));
    var shape: Shape;
    if !small && squares_in(box) > 0u {
        shape = shape_of(id);
    }
    for (var i = lane; i < squares_in(box); i += lanes) {
        let square = square_of(box, i);
        let tile = (bin << vec2u(grid.bin_shift)) + square;
        if small || !misses_square(shape, tile * TILE, TILE) {
            let slot = (u32(square.y) << grid.bin_shift) + u32(square.x);
            atomicOr(&masks[slot * WORDS + own / 32u], 1u << (own % 32u));
            if weighs {
                let area = area_in(pixels, tile);
                atomicAdd(&areas[slot], area);
                atomicAdd(&covered[slot], u32(f32(area) * share_of(box_and_share) * 16.0));
            }
        }
    }
}

// Pixels of a tile that are in a triangle's box.
fn area_in(box: vec4i, tile: vec2i) -> u32 {
    let first = max(box.xy, tile * TILE);
    let last = min(box.zw, tile * TILE + TILE - 1);
    let size = max(last - first + 1, vec2i(0));
    return u32(size.x * size.y);
}

var<workgroup> shared_span: Span;
// Pixels of boxes of triangles in each tile.
var<workgroup> areas: array<atomic<u32>, BLOCK>;
// And those that triangles are expected to cover, in sixteenths.
var<workgroup> covered: array<atomic<u32>, BLOCK>;

// A workgroup a bin: the lists of its tiles.
@compute @workgroup_size(256)
fn cs_bin_tiles(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let bin = vec2i(i32(group.x % grid.bins_x), i32(group.x / grid.bins_x));
    let side = 1u << grid.bin_shift;
    let slots = side * side; // at most BLOCK
    if local == 0u {
        let span = bins[group.x];
        // What did not fit is not there.
        let end = min(span.first + span.count, grid.bin_capacity);
        shared_span = Span(span.first, select(0u, end - span.first, end > span.first));
    }
    let span = workgroupUniformLoad(&shared_span);
    if (span.count / BLOCK + 1u) * (6u * slots + 16u) > grid.trips {
        if local == 0u {
            atomicMax(&counters.longest, TOO_LONG); // the host says so
        }
        return;
    }
    atomicStore(&areas[local], 0u);
    atomicStore(&covered[local], 0u);
    // Where triangles are few, several invocations share one's tiles.
    var lanes = 1u;
    while lanes < 8u && span.count * lanes * 2u <= BLOCK {
        lanes *= 2u;
    }
    let block = BLOCK / lanes;
    let own = local / lanes;
    let lane = local % lanes;
    // Twice over the bin's list: counts, then places. The masks of a list of one block are kept.
    var own_count = 0u;
    var own_first = 0u;
    for (var round = 0u; round < 2u; round++) {
        for (var first = 0u; first < span.count; first += block) {
            let marks = round == 0u || span.count > block;
            if marks {
                for (var w = local; w < slots * WORDS; w += BLOCK) {
                    atomicStore(&masks[w], 0u);
                }
            }
            workgroupBarrier(); // the masks are empty
            var packed = EMPTY_BOX;
            var t = 0u;
            var box = vec4i(0, 0, -1, -1);
            if first + own < span.count {
                t = bin_entries[span.first + first + own];
                packed = boxes[t];
                let whole = box_in_band(packed) >> vec4u(4u);
                let origin = bin << vec2u(grid.bin_shift);
                let last = vec2i(i32(side) - 1);
                box = vec4i(max(whole.xy - origin, vec2i(0)), min(whole.zw - origin, last));
            }
            if marks {
                mark_tiles(t, packed, box, bin, own, lane, lanes, round == 0u);
            }
            workgroupBarrier(); // the masks are complete
            if round == 0u {
                if local < slots {
                    own_count += count_all(local);
                }
            } else {
                for (var i = lane; i < squares_in(box); i += lanes) {
                    let square = square_of(box, i);
                    let slot = (u32(square.y) << grid.bin_shift) + u32(square.x);
                    if (atomicLoad(&masks[slot * WORDS + own / 32u]) >> (own % 32u) & 1u) == 1u {
                        let place = atomicLoad(&filled[slot]) + count_before(slot, own);
                        if place < grid.tile_capacity {
                            tile_entries[place] = t;
                        }
                    }
                }
                workgroupBarrier(); // all places are taken
                if local < slots {
                    atomicStore(&filled[local], atomicLoad(&filled[local]) + count_all(local));
                }
            }
            workgroupBarrier(); // the masks are read
        }
        if round == 0u {
            let before = scan(own_count, local);
            if local == BLOCK - 1u {
                shared_first = atomicAdd(&counters.tile_entries, sums[BLOCK - 1u]);
            }
            own_first = workgroupUniformLoad(&shared_first) + before;
            let tile = (vec2u(bin) << vec2u(grid.bin_shift)) + vec2u(local % side, local / side);
            if local < slots {
                atomicStore(&filled[local], own_first);
                if tile.x < grid.tiles_x && tile.y < grid.tiles_y {
                    plan_tile(tile.y * grid.tiles_x + tile.x, Span(own_first, own_count), atomicLoad(&areas[local]), atomicLoad(&covered[local]));
                }
            }
        }
    }
}

fn plan_tile(tile: u32, span: Span, area: u32, sixteenths: u32) {
    tiles[tile] = span;
    atomicMax(&counters.longest, span.count);
    if span.count > 0u {
        atomicAdd(&classes.filled_tiles, 1u);
    }
    let own = class_of_tile(span.count, area, sixteenths);
    var threads = CLASS_THREADS;
    let n = 256u / threads[own];
    let place = atomicAdd(&classes.counts[own], n);
    for (var i = 0u; i < n; i++) {
        parts[own * grid.parts + place + i] = part_of(tile, i * threads[own]);
    }
}

// The class that a tile starts in. 0 and 1 take triangles in turns, 2 to 4 keep masks of few, 5 takes whatever is left.
// A guess, for speed alone: where it is too low the part goes on to the next.
fn class_of_tile(count: u32, area: u32, sixteenths: u32) -> u32 {
    var depths = CLASS_DEPTHS;
    var entries = CLASS_ENTRIES;
    let sum = f32(sixteenths) / 16.0;
    let mean = sum / 256.0;
    // Of pixels at random the deepest of a tile's 256 is about this much over the mean.
    let expected = min(mean + 3.0 * sqrt(mean), f32(count));
    let is_small = count >= MANY_TRIANGLES && count < 0x1000000u && area < SMALL_AREA * count;
    if is_small && expected <= f32(depths[0]) && 1.1 * sum <= f32(entries[1]) {
        return select(1u, 0u, 1.1 * sum <= f32(entries[0]));
    }
    if count > 128u {
        return 5u;
    }
    if expected <= f32(depths[2]) {
        return 2u;
    }
    return select(4u, 3u, expected <= f32(depths[3]));
}
