r"""Affine maps of spatial vectors, the segment of the paper's three recurrences (eq. 7-10).

A piece of the chain acts on the spatial vector that enters it as :math:`x \mapsto C x + b` with a 6×6 matrix and a
vector of 6. Two pieces one after the other are again such a map, and putting pieces together is associative; that is
all a scan needs.

On the wire are, for T samples, the 36 T numbers of ``C``, then the 6 T of ``b``.
"""

import numpy as np

from mp2a.spatial import Array, apply

MATRIX_AND_VECTOR = "matrix+vector"
VECTOR = "vector"

DOUBLES = {MATRIX_AND_VECTOR: 42, VECTOR: 6}
"""Numbers a sample in each kind of message: the paper's ``A_b`` and ``B_b`` (eq. 12)."""


IDENTITY = np.eye(6).reshape(36)
"""The matrix of the piece that changes nothing."""
NO_VECTOR = np.zeros(6)
"""The vector of the piece that changes nothing, and no force."""
IDENTITY.flags.writeable = NO_VECTOR.flags.writeable = False


def product(outer: Array, inner: Array, out: Array | None = None) -> Array:
    """``C₂ C₁`` of matrices in rows of 36, ``(..., 36)``: ``inner`` first, then ``outer``; ``out`` is neither."""
    result = np.empty(inner.shape) if out is None else out
    c2, c1, c = (x.reshape(*x.shape[:-1], 6, 6) for x in (outer, inner, result))
    np.matmul(c2, c1, out=c)
    return result


def push(matrix: Array, entering: Array, added: Array, out: Array | None = None) -> Array:
    """``C x + b`` with the matrix in rows of 36, ``(..., 36)`` and ``(..., 6)`` twice; ``out`` may be ``added``."""
    pushed = apply(matrix.reshape(*matrix.shape[:-1], 6, 6), entering)
    return np.add(pushed, added, out=out)
