"""What pipelines take, measured: by this `pipeline="auto"` chooses between `tiles` and `linked_list` on a GPU.

`abuffer bench --calibrate` measures it again, on a device of yours, and prints rows to put here.
"""

# What is asked of a render, by what it takes.
CASES = {
    "image": "an image alone, or counts",
    "lists": "lists of one sample, all blended over",
    "samples": "several samples a pixel",
    "stored": "blend modes, opaque surfaces listed, or options of how lists are resolved",
}
# Scenes up to so many triangles are "few", of some 400 pixels a side where it was measured; others "many", of some 6.
FEW = 5_000

# Wall time of a render of `tiles` divided by that of `linked_list`: by the kind of device, the case, few or many.
TILES_TO_LINKED_LIST = {
    "real": {
        "device": "NVIDIA H100 80GB HBM3",
        "image": {"few": 0.30, "many": 0.25},
        "lists": {"few": 0.47, "many": 0.38},
        "samples": {"few": 0.47, "many": 0.44},
        "stored": {"few": 0.45, "many": 0.40},
    },
    "software": {
        "device": "llvmpipe (LLVM 15.0.6, 256 bits)",
        "image": {"few": 5.9, "many": 10.0},
        "lists": {"few": 2.6, "many": 7.5},
        "samples": {"few": 2.5, "many": 4.6},
        "stored": {"few": 2.7, "many": 8.3},
    },
}


def scene_of(triangles) -> str:
    """Which of the measured scenes a number of triangles is taken for."""
    return "few" if triangles <= FEW else "many"


def faster(kind, case, triangles):
    """The pipeline that took less time, and what was measured, in words.

    Args:
        kind: the adapter's.
        case: one of CASES.

    >>> faster("discrete", "image", 100)[0]
    'tiles'
    """
    row = TILES_TO_LINKED_LIST["software" if kind == "software" else "real"]
    scene = scene_of(triangles)
    ratio = row[case][scene]
    why = f"tiles took {ratio:.2g} of linked_list's time for {CASES[case]} of {scene} triangles, on {row['device']}"
    return ("tiles" if ratio < 1 else "linked_list"), why
