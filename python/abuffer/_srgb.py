"""The transfer function of sRGB."""

import numpy as np


def encode_srgb(linear):
    """Linear light to sRGB, IEC 61966-2-1. 1 becomes exactly 1.

    >>> encode_srgb(np.array([0, 1])).tolist()
    [0.0, 1.0]
    """
    power = np.maximum(linear, 0.0031308) ** (1 / 2.4)
    return np.where(linear <= 0.0031308, 12.92 * linear, power + 0.055 * (power - 1))
