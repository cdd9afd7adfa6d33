"""Memory of images that nobody has any more is used again; what someone has stays as it is."""

import gc

import numpy as np
import pytest

import abuffer as ab
import scenes

CAMERA = ab.Camera.look_at((0, 0, 3), (0, 0, 0))
TRIANGLES, COLORS = scenes.random_triangles(40, 0.5, seed=8)
SIZE = {"width": 700, "height": 500}  # 5.6 MB: smaller images are left to malloc


def image(device="cpu", background=(0, 0, 0)):
    return ab.render(ab.Mesh(TRIANGLES, colors=COLORS), CAMERA, background=background, device=device, **SIZE).image


@pytest.mark.parametrize("device", ["cpu", "gpu"])
def test_an_image_that_someone_has_stays_as_it_is(device, request):
    if device == "gpu":
        request.getfixturevalue("needs_gpu")
    first = image(device, background=(1, 0, 0))
    view, copy = first[10:, :, :3], first.copy()
    del first
    for shade in (0.25, 0.5, 0.75):
        other = image(device, background=(shade,) * 3)
        assert not np.shares_memory(other, view)
        np.testing.assert_array_equal(view, copy[10:, :, :3])
        del other


def test_an_image_that_nobody_has_leaves_its_memory_to_the_next():
    first = image(background=(1, 0, 0))
    place = first.ctypes.data
    del first
    gc.collect()
    again = image(background=(0, 0, 1))
    assert again.ctypes.data == place
    np.testing.assert_array_equal(again[0, 0], (0, 0, 1, 1))


def test_an_image_can_be_written_and_outlives_its_frame():
    own = image()
    own[:] = 7
    gc.collect()
    image()
    assert own.flags.writeable
    assert (own == 7).all()
