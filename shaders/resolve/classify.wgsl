// Which resolve a pixel needs: the size of its temporary array, not the work in it, sets the cost of one, so
// pixels are put into classes by the length of their lists, and each class has a pipeline of its own, dispatched
// indirectly. Empty pixels are done here. cs_classify gives each pixel a place in its class, cs_plan the classes
// theirs in `class_pixels`, and cs_place fills those.

struct Arguments {
    // Workgroups of a class.
    dispatch: array<array<u32, 3>, CLASS_SLOTS>,
    // Vertices, instances, first vertex, first instance.
    draw: array<array<u32, 4>, CLASS_SLOTS>,
}

@group(1) @binding(0) var<storage, read_write> classes: Classes;
@group(1) @binding(1) var<storage, read_write> class_pixels: array<u32>;
@group(1) @binding(2) var<storage, read_write> arguments: Arguments;

// Each pixel's place in its class.
@group(1) @binding(3) var<storage, read_write> class_places: array<u32>;

var<workgroup> totals: array<atomic<u32>, CLASS_SLOTS>;
var<workgroup> firsts: array<u32, CLASS_SLOTS>;
var<workgroup> longest: atomic<u32>;

@compute @workgroup_size(16, 16)
fn cs_classify(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32) {
    let pixel = id.y * band.width + id.x;
    var n = 0u;
    var class_index = 0u;
    var rank = 0u;
    if id.x < band.width && id.y < band.height {
        n = length_of(pixel);
        counts[pixel] = n;
        if n == 0u {
            finish_empty(pixel);
        } else {
            class_index = class_of(n);
            rank = atomicAdd(&totals[class_index], 1u);
            if n > atomicLoad(&longest) {
                atomicMax(&longest, n); // seldom: most lists are no record
            }
        }
    }
    workgroupBarrier(); // the workgroup's totals are complete
    if local <= CLASS_COUNT {
        let total = atomicLoad(&totals[local]);
        if total > 0u {
            firsts[local] = atomicAdd(&classes.totals[local], total);
        }
    }
    if local == 0u && atomicLoad(&longest) > 0u {
        atomicAdd(&classes.filled_tiles, 1u);
        atomicMax(&classes.longest, atomicLoad(&longest));
    }
    workgroupBarrier(); // and its places in each class are known
    if n > 0u {
        class_places[pixel] = firsts[class_index] + rank;
    }
}

@compute @workgroup_size(1)
fn cs_plan() {
    var base = 0u;
    for (var c = 0u; c <= CLASS_COUNT; c++) {
        let total = atomicLoad(&classes.totals[c]);
        classes.bases[c] = base;
        base += total;
        let groups = (total * INVOCATIONS_PER_PIXEL + 63u) / 64u;
        let x = min(groups, 65535u); // one dimension ends there
        arguments.dispatch[c] = array<u32, 3>(x, (groups + 65534u) / 65535u, 1u);
        arguments.draw[c] = array<u32, 4>(3u, min(groups, 1u), 0u, 0u);
    }
}

@compute @workgroup_size(16, 16)
fn cs_place(@builtin(global_invocation_id) id: vec3u) {
    if id.x < band.width && id.y < band.height {
        let pixel = id.y * band.width + id.x;
        let n = counts[pixel];
        if n > 0u {
            class_pixels[classes.bases[class_of(n)] + class_places[pixel]] = pixel;
        }
    }
}
