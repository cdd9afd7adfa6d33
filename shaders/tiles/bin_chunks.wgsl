// The first level: chunks of triangles into bins of many tiles, by count, sum and scatter.

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
        let offset = sum_before(own, local);
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
        workgroupBarrier(); // the masks are read before the next block empties them
    }
}
