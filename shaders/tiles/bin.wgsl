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
    // Blocks of 256 triangles in a chunk.
    blocks: u32,
    bin_capacity: u32,
    tile_capacity: u32,
    // Loop iterations that an invocation may take, where a driver ends loops silently.
    trips: u32,
    pad0: u32,
}

struct Span {
    first: u32,
    count: u32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> rasters: array<Raster>;
@group(0) @binding(3) var<storage, read> pieces: array<array<i32, 6>>;
@group(0) @binding(4) var<storage, read_write> counters: Counters;
// Of each bin and chunk: how many of its triangles may touch the bin, then how many of those before it do.
@group(0) @binding(5) var<storage, read_write> matrix: array<u32>;
@group(0) @binding(6) var<storage, read_write> bins: array<Span>;
@group(0) @binding(7) var<storage, read_write> bin_entries: array<u32>;
@group(0) @binding(8) var<storage, read_write> tiles: array<Span>;
@group(0) @binding(9) var<storage, read_write> tile_entries: array<u32>;

const BLOCK = 256u;
// Words of a mask of BLOCK triangles.
const WORDS = 8u;

// Bit t of bin b, or of tile b: triangle t of the block may touch it.
var<workgroup> masks: array<atomic<u32>, MAX_BINS * WORDS>;
// How many entries each bin has so far.
var<workgroup> filled: array<atomic<u32>, MAX_BINS>;

fn bin_of(tile: i32) -> i32 {
    return tile >> grid.bin_shift;
}

// Whether every centre of a bin lies outside one edge, by more than rounding: a few bins too many do no harm.
fn misses_bin(r: Raster, bin: vec2i) -> bool {
    let size = f32((16i << grid.bin_shift) - 1) * 256.0 + 256.0;
    let first = vec2f(bin) * f32(4096i << grid.bin_shift);
    let p = array<vec2f, 3>(
        vec2f(f32(r.corners[0]), f32(r.corners[1])),
        vec2f(f32(r.corners[2]), f32(r.corners[3])),
        vec2f(f32(r.corners[4]), f32(r.corners[5])),
    );
    for (var i = 0; i < 3; i++) {
        let d = p[(i + 1) % 3] - p[i];
        // The corner of the bin that is farthest inside.
        let to = first + select(vec2f(0.0), vec2f(size), vec2<bool>((d.y < 0.0), (d.x > 0.0))) - p[i];
        let along = d.x * to.y;
        let across = d.y * to.x;
        // Of coordinates below 2^26, their differences and two products.
        if along - across < -(abs(along) + abs(across)) * 0x1p-20 - 1.0 {
            return true;
        }
    }
    return false;
}

fn misses_tile(r: Raster, tile: vec2i) -> bool {
    if (r.flags & CLIPPED) == 0u {
        return misses(edges_of(r.corners, TILE * tile.x, TILE * tile.y), TILE, TILE);
    }
    for (var i = 0; i < r.corners[5]; i++) {
        if !misses(edges_of(pieces[r.corners[4] + i], TILE * tile.x, TILE * tile.y), TILE, TILE) {
            return false;
        }
    }
    return true;
}

fn box_in_bins(r: Raster) -> vec4i {
    let box = pixel_box(r);
    return vec4i(bin_of(box.x >> 4u), bin_of(box.y >> 4u), bin_of(box.z >> 4u), bin_of(box.w >> 4u));
}

// Whether the triangle may touch a bin of its box.
fn touches_bin(r: Raster, box: vec4i, bin: vec2i) -> bool {
    let is_small = (box.z - box.x + 1) * (box.w - box.y + 1) <= 2;
    return is_small || (r.flags & CLIPPED) != 0u || !misses_bin(r, bin);
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
    for (var block = 0u; block < grid.blocks; block++) {
        let t = (group.x * grid.blocks + block) * BLOCK + local;
        if t < grid.triangles && (rasters[t].flags & VISIBLE) != 0u {
            let r = rasters[t];
            if !HIDES || (r.flags & OPAQUE) == 0u {
                let pixels = pixel_box(r);
                own = max(own, vec4u(vec4i(65536 - pixels.xy, pixels.zw + 1)));
            }
            let box = box_in_bins(r);
            for (var y = box.y; y <= box.w; y++) {
                for (var x = box.x; x <= box.z; x++) {
                    if touches_bin(r, box, vec2i(x, y)) {
                        atomicAdd(&filled[u32(y) * grid.bins_x + u32(x)], 1u);
                    }
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
    for (var block = 0u; block < grid.blocks; block++) {
        for (var w = local; w < bin_count * WORDS; w += BLOCK) {
            atomicStore(&masks[w], 0u);
        }
        workgroupBarrier(); // the masks are empty, and all of the block before is written
        let t = (group.x * grid.blocks + block) * BLOCK + local;
        var r: Raster;
        if t < grid.triangles {
            r = rasters[t];
        }
        var box = vec4i(0, 0, -1, -1);
        if (r.flags & VISIBLE) != 0u {
            box = box_in_bins(r);
        }
        for (var y = box.y; y <= box.w; y++) {
            for (var x = box.x; x <= box.z; x++) {
                if touches_bin(r, box, vec2i(x, y)) {
                    atomicOr(&masks[(u32(y) * grid.bins_x + u32(x)) * WORDS + local / 32u], 1u << (local % 32u));
                }
            }
        }
        workgroupBarrier(); // the masks are complete
        for (var y = box.y; y <= box.w; y++) {
            for (var x = box.x; x <= box.z; x++) {
                let b = u32(y) * grid.bins_x + u32(x);
                if (atomicLoad(&masks[b * WORDS + local / 32u]) >> (local % 32u) & 1u) == 1u {
                    let place = atomicLoad(&filled[b]) + count_before(b, local);
                    if place < grid.bin_capacity {
                        bin_entries[place] = t;
                    }
                }
            }
        }
        workgroupBarrier(); // all places are taken
        for (var b = local; b < bin_count; b += BLOCK) {
            atomicStore(&filled[b], atomicLoad(&filled[b]) + count_all(b));
        }
    }
}

// Marks the tiles of a bin that the invocation's triangle may touch. `box`: of the triangle, in tiles of the bin.
fn mark_tiles(r: Raster, box: vec4i, bin: vec2i, local: u32) {
    let is_alone = box.x == box.z && box.y == box.w;
    for (var y = box.y; y <= box.w; y++) {
        for (var x = box.x; x <= box.z; x++) {
            if is_alone || !misses_tile(r, (bin << vec2u(grid.bin_shift)) + vec2i(x, y)) {
                let slot = (u32(y) << grid.bin_shift) + u32(x);
                atomicOr(&masks[slot * WORDS + local / 32u], 1u << (local % 32u));
            }
        }
    }
}

var<workgroup> shared_span: Span;

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
    // Twice over the bin's list: counts, then places.
    var own_count = 0u;
    var own_first = 0u;
    for (var round = 0u; round < 2u; round++) {
        for (var first = 0u; first < span.count; first += BLOCK) {
            for (var w = local; w < slots * WORDS; w += BLOCK) {
                atomicStore(&masks[w], 0u);
            }
            workgroupBarrier(); // the masks are empty
            var r: Raster;
            var t = 0u;
            var box = vec4i(0, 0, -1, -1);
            if first + local < span.count {
                t = bin_entries[span.first + first + local];
                r = rasters[t];
                let whole = pixel_box(r) >> vec4u(4u);
                let origin = bin << vec2u(grid.bin_shift);
                let last = vec2i(i32(side) - 1);
                box = vec4i(max(whole.xy - origin, vec2i(0)), min(whole.zw - origin, last));
            }
            mark_tiles(r, box, bin, local);
            workgroupBarrier(); // the masks are complete
            if round == 0u {
                if local < slots {
                    own_count += count_all(local);
                }
            } else {
                for (var y = box.y; y <= box.w; y++) {
                    for (var x = box.x; x <= box.z; x++) {
                        let slot = (u32(y) << grid.bin_shift) + u32(x);
                        if (atomicLoad(&masks[slot * WORDS + local / 32u]) >> (local % 32u) & 1u) == 1u {
                            let place = atomicLoad(&filled[slot]) + count_before(slot, local);
                            if place < grid.tile_capacity {
                                tile_entries[place] = t;
                            }
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
                    plan_tile(tile.y * grid.tiles_x + tile.x, Span(own_first, own_count));
                }
            }
        }
    }
}

fn plan_tile(tile: u32, span: Span) {
    tiles[tile] = span;
    atomicMax(&counters.longest, span.count);
}
