"""What tests of comparisons render: three sheets over the whole view, at a small size."""

import abuffer as ab

SIZE = {"width": 48, "height": 36}
QUICK = {"devices": ["cpu"], "repeats": 2, "warmup": 3}


def sheets(*colors):
    """Triangles over the whole view, the first the farthest."""
    return ab.Mesh(
        [[(-30, -30, z), (30, -30, z), (0, 60, z)] for z in range(len(colors))], colors=colors, color_mode="face"
    )


SHEETS = sheets((1, 0, 0, 0.5), (0, 1, 0, 0.25), (0, 0, 1, 0.75))
CAMERA = ab.Camera.look_at((0, 0, 9), (0, 0, 0))
