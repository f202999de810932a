"""Vectors of the ground as complex numbers x + i y, for what turns and bends them a lot: a turn is a factor."""

import numpy as np
from numpy.typing import NDArray

from mp2a.spatial import Array

Complex = NDArray[np.complex128]


def as_complex(vectors: Array) -> Complex:
    """Return the first two of ``(..., 2)`` or ``(..., 3)`` numbers as complex ones, ``(...,)``."""
    out: Complex = vectors[..., 0] + 1j * vectors[..., 1]
    return out


def as_vectors(numbers: Complex) -> Array:
    """Return complex numbers as ``(..., 2)`` real ones."""
    return np.stack((numbers.real, numbers.imag), axis=-1)


def unit(angle: Array) -> Complex:
    """Return unit vectors at angles."""
    out: Complex = np.exp(1j * angle)
    return out
