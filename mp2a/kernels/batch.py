"""Running the compiled recursion: tables of chains kept, memory for threads, samples split over them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.chain import Chain
from mp2a.kernels.plan import FORMATS, Format, Plan, make_plan
from mp2a.spatial import Array


class Result(NamedTuple):
    """What the recursion gives."""

    torque: Array
    """``(T, nv)``"""
    bodies: Array | None
    """``(n, 18, T)``: velocity, acceleration and force of each body, if asked for."""
    root: Array
    """``(6, T)``: wrench on what the chain hangs on, there."""
    sound: bool
    """Whether every sample is what it should be; else some input is not finite, no rotation, or a very large angle."""


def aligned(count: int, dtype: np.dtype) -> Array:
    """Memory for numbers that starts at a cache line."""
    raw = np.empty(count * dtype.itemsize + 64, dtype=np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + count * dtype.itemsize].view(dtype)
