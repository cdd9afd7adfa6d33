// The second level: a bin's triangles into lists of its tiles, and the class that each tile starts in.

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
            let before = sum_before(own_count, local);
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
    // What did not fit is not there: the host makes room, and starts again.
    let end = min(span.first + span.count, grid.tile_capacity);
    tiles[tile] = Span(span.first, select(0u, end - span.first, end > span.first));
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

// The class that a tile starts in. 0 takes small triangles in turns, and 4 where pixels are deep; 1 to 3 keep masks of few;
// 5 takes whatever is left.
// A guess, for speed alone: where it is too low the part goes on to the next.
fn class_of_tile(count: u32, area: u32, sixteenths: u32) -> u32 {
    var depths = CLASS_DEPTHS;
    var entries = CLASS_ENTRIES;
    let sum = f32(sixteenths) / 16.0;
    let mean = sum / 256.0;
    // Of pixels at random the deepest of a tile's 256 is about this much over the mean.
    let expected = min(mean + 3.0 * sqrt(mean), f32(count));
    let is_small = count >= MANY_TRIANGLES && count <= 0xffffu && area < SMALL_AREA * count;
    if is_small && expected <= f32(depths[0]) && 1.1 * sum <= f32(entries[0]) {
        return 0u;
    }
    if count > 128u {
        return select(5u, 4u, is_small);
    }
    if expected <= f32(depths[1]) {
        return 1u;
    }
    return select(3u, 2u, expected <= f32(depths[2]));
}
