// The first pass of count, scan, scatter ("PreCalc" in Microsoft's OIT11 sample): how many fragments each pixel has.

@group(1) @binding(1) var<storage, read_write> pixel_counts: array<atomic<u32>>;

fn keep(f: Fragment, pixel: u32, kept: bool) {
    if kept {
        atomicAdd(&pixel_counts[pixel], 1u);
    }
}
