// Which resolve a pixel needs: the size of its temporary array, not the work in it, sets the cost of one, so
// pixels are put into classes by the length of their lists, and each class has a pipeline of its own, dispatched
// indirectly. Empty pixels are done here. After cs_classify the totals are known, after cs_plan where each class
// lies in `class_pixels`, and cs_scatter fills it.

struct Arguments {
    // Workgroups of a class.
    dispatch: array<array<u32, 3>, CLASS_SLOTS>,
    // Vertices, instances, first vertex, first instance.
    draw: array<array<u32, 4>, CLASS_SLOTS>,
}

@group(1) @binding(0) var<storage, read_write> classes: Classes;
@group(1) @binding(1) var<storage, read_write> class_pixels: array<u32>;
@group(1) @binding(2) var<storage, read_write> arguments: Arguments;
// Nodes that were asked for: where they are more than there were, the lists are not whole and are not resolved.
@group(1) @binding(3) var<storage, read> counter: array<u32, 2>;

var<workgroup> totals: array<atomic<u32>, CLASS_SLOTS>;
var<workgroup> bases: array<u32, CLASS_SLOTS>;
var<workgroup> longest: atomic<u32>;

fn class_of(n: u32) -> u32 {
    var bounds = CLASS_BOUNDS;
    var class_index = 0u;
    for (var c = 0u; c < CLASS_COUNT; c++) {
        class_index += u32(n > bounds[c]);
    }
    return class_index;
}

@compute @workgroup_size(16, 16)
fn cs_classify(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32) {
    if id.x < band.width && id.y < band.height {
        let pixel = id.y * band.width + id.x;
        let n = length_of(pixel, LONGEST_CLASS + 1u);
        counts[pixel] = n;
        if n == 0u {
            finish_empty(pixel);
        } else {
            atomicAdd(&totals[class_of(n)], 1u);
            if n <= LONGEST_CLASS {
                atomicMax(&longest, n);
            }
        }
    }
    workgroupBarrier(); // the workgroup's totals are complete
    if local == 0u {
        var filled = 0u;
        for (var c = 0u; c <= CLASS_COUNT; c++) {
            let total = atomicLoad(&totals[c]);
            filled += total;
            if total > 0u {
                atomicAdd(&classes.totals[c], total);
            }
        }
        if filled > 0u {
            atomicAdd(&classes.filled_tiles, 1u);
            atomicMax(&classes.longest, atomicLoad(&longest));
        }
    }
}

@compute @workgroup_size(1)
fn cs_plan() {
    let whole = counter[1] == 0u && counter[0] <= band.capacity;
    var base = 0u;
    for (var c = 0u; c <= CLASS_COUNT; c++) {
        let total = atomicLoad(&classes.totals[c]);
        classes.bases[c] = base;
        atomicStore(&classes.cursors[c], base);
        base += total;
        let groups = select(0u, (total * INVOCATIONS_PER_PIXEL + 63u) / 64u, whole);
        let x = min(groups, 65535u); // one dimension ends there
        arguments.dispatch[c] = array<u32, 3>(x, (groups + 65534u) / 65535u, 1u);
        arguments.draw[c] = array<u32, 4>(3u, min(groups, 1u), 0u, 0u);
    }
}

@compute @workgroup_size(16, 16)
fn cs_scatter(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32) {
    var n = 0u;
    var rank = 0u;
    var class_index = 0u;
    let pixel = id.y * band.width + id.x;
    if id.x < band.width && id.y < band.height {
        n = counts[pixel];
        if n > 0u {
            class_index = class_of(n);
            rank = atomicAdd(&totals[class_index], 1u);
        }
    }
    workgroupBarrier(); // ranks are handed out
    if local <= CLASS_COUNT {
        let total = atomicLoad(&totals[local]);
        if total > 0u {
            bases[local] = atomicAdd(&classes.cursors[local], total);
        }
    }
    workgroupBarrier(); // and their bases known
    if n > 0u {
        class_pixels[bases[class_index] + rank] = pixel;
    }
}
