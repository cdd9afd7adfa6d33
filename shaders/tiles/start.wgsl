// What the first classes are dispatched with, once all tiles are planned.

@group(0) @binding(0) var<storage, read_write> classes: Classes;
@group(0) @binding(1) var<storage, read_write> groups_0: array<u32, 3>;
@group(0) @binding(2) var<storage, read_write> groups_1: array<u32, 3>;
@group(0) @binding(3) var<storage, read_write> groups_2: array<u32, 3>;
@group(0) @binding(4) var<storage, read_write> groups_3: array<u32, 3>;
@group(0) @binding(5) var<storage, read_write> groups_4: array<u32, 3>;
@group(0) @binding(6) var<storage, read_write> groups_5: array<u32, 3>;

fn groups(class_index: u32) -> array<u32, 3> {
    return array<u32, 3>(min(atomicLoad(&classes.counts[class_index]), MOST_GROUPS), 1u, 1u);
}

@compute @workgroup_size(1)
fn cs_start() {
    groups_0 = groups(0u);
    groups_1 = groups(1u);
    groups_2 = groups(2u);
    groups_3 = groups(3u);
    groups_4 = groups(4u);
    groups_5 = groups(5u);
}
