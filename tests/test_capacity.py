"""What does not fit: the bytes that are said to be needed are those of the scene's fragments, and with them it fits."""

import math
import re

import numpy as np
import pytest

import abuffer as ab
from comparison import CPU32, CPU64, GPU, GPU_PREFIX, GPU_TILES
from sheets import render, sheets

ON_GPU = pytest.mark.parametrize("pipeline", [GPU, GPU_PREFIX, GPU_TILES], ids=str)
ON_CPU = pytest.mark.parametrize("pipeline", [CPU32, CPU64], ids=str)
SORTING = 16  # bytes of scratch a node, where lists are long


def deep(n):
    return sheets(1 + np.arange(n) / 1024, np.full((n, 4), 0.01))


def refusal(pipeline, scene, memory, **size):
    """(pixel, bytes that are needed) of the error that such a memory gives."""
    with pytest.raises(ab.CapacityError) as error:
        render(pipeline, scene, memory=memory, **size)
    found = re.match(r"the fragment(?:s| list) of pixel (\[\d+, \d+\]): (\d+) bytes are needed", str(error.value))
    assert found, error.value
    return found.group(1), int(found.group(2))


@ON_GPU
@pytest.mark.parametrize("n", [1000, 1001, 1002])
def test_a_gpu_needs_three_quarters_for_the_fragments_of_the_deepest_pixel(pipeline, n):
    """Of 4/3 of their nodes and of the scratch to sort them, in steps of 4, not a byte is too many."""
    scene = deep(n)
    pixel, needed = refusal(pipeline, scene, 40_000, width=1)
    enough = render(pipeline, scene, memory=needed, width=1)
    each = enough.stats.bytes["nodes"] / n + SORTING
    assert (pixel, needed) == ("[0, 0]", 4 * math.ceil(each * n / 3))
    np.testing.assert_array_equal(enough.image, render(pipeline, scene, width=1).image)
    assert refusal(pipeline, scene, needed - 4, width=1) == (pixel, needed)


@ON_GPU
def test_of_two_pixels_the_one_that_does_not_fit_is_named(pipeline):
    """One more layer on the right than on the left, for which the memory is just enough."""
    layers = deep(1000)
    half = ab.Mesh([[0.0, -9, -9], [9, -9, -9], [0, 9, -9]], colors=(1, 1, 1, 0.5))
    _, enough = refusal(pipeline, layers, 40_000)
    render(pipeline, layers, memory=enough)
    pixel, needed = refusal(pipeline, [layers, half], enough)
    assert pixel == "[0, 1]"
    assert needed == refusal(pipeline, deep(1001), 40_000)[1] > enough


@ON_CPU
def test_the_cpu_needs_a_quarter_for_what_each_triangle_may_add_to_a_pixel(pipeline):
    """Of which all are a fragment here."""
    demands = {n: refusal(pipeline, deep(n), 60_000, width=1)[1] for n in (1000, 1001, 1500)}
    each = demands[1001] - demands[1000]
    assert demands == {n: each * n for n in demands}
    for n, needed in demands.items():
        image = render(pipeline, deep(n), memory=4 * needed, width=1).image
        np.testing.assert_array_equal(image, render(pipeline, deep(n), width=1).image)
