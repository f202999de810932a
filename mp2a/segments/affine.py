r"""Affine maps of spatial vectors, the segment of the paper's three recurrences (eq. 7-10).

A piece of the chain acts on the spatial vector that enters it as :math:`x \mapsto C x + b` with a 6×6 matrix and a
vector of 6. Two pieces one after the other are again such a map, and putting pieces together is associative; that is
all a scan needs.

A `Window` is the piece a robot has put together so far, kept in the buffer that goes on the wire: for T samples the
36 T numbers of ``C``, then the 6 T of ``b``.
"""

from typing import NamedTuple

import numpy as np

from mp2a.spatial import Array, apply

MATRIX_AND_VECTOR = "matrix+vector"
VECTOR = "vector"

DOUBLES = {MATRIX_AND_VECTOR: 42, VECTOR: 6}
"""Numbers a sample in each kind of message: the paper's ``A_b`` and ``B_b`` (eq. 12)."""


class Window(NamedTuple):
    """A piece of chain for each of some nodes, as views of one buffer."""

    buffer: Array
    """``(nodes, 42 T)``"""
    matrix: Array
    """``C``, ``(nodes, T, 6, 6)``"""
    vector: Array
    """``b``, ``(nodes, T, 6)``"""

    def outbox(self) -> dict[str, Array]:
        """Map each kind of message to what it carries, by node."""
        start = self.buffer.shape[1] // 42 * 36
        return {MATRIX_AND_VECTOR: self.buffer, VECTOR: self.buffer[:, start:]}


def window(nodes: int, samples: int) -> Window:
    """Empty window; see `view`."""
    return view(np.empty((nodes, 42 * samples)))


def view(buffer: Array) -> Window:
    """Window over a buffer ``(nodes, 42 T)``, sharing its memory."""
    nodes, samples = len(buffer), buffer.shape[1] // 42
    matrix = buffer[:, : 36 * samples].reshape(nodes, samples, 6, 6)
    vector = buffer[:, 36 * samples :].reshape(nodes, samples, 6)
    return Window(buffer, matrix, vector)


def compose(outer: tuple[Array, Array], inner: tuple[Array, Array]) -> tuple[Array, Array]:
    """Map of ``inner`` followed by ``outer``: ``(C₂ C₁, C₂ b₁ + b₂)`` on ``(..., 6, 6)`` and ``(..., 6)``."""
    (c2, b2), (c1, b1) = outer, inner
    return c2 @ c1, apply(c2, b1) + b2


def join(current: Window, kind: str, nodes: slice, data: Array, out: Window) -> None:
    """Put pieces that arrived before (for forces: behind) the windows of some nodes, into ``out``, without allocating.

    Parameters
    ----------
    current, out
        Windows of all nodes of this process; they share no memory.
    kind, data
        What arrived, ``(k, 42 T)`` or ``(k, 6 T)``. After a vector alone the window reaches the end of the chain and
        ``out.matrix`` of these nodes means nothing any more.
    nodes
        The k nodes.
    """
    matrix, vector = current.matrix[nodes], current.vector[nodes]
    samples = vector.shape[1]
    if kind == MATRIX_AND_VECTOR:
        arrived = view(data)
        np.matmul(matrix, arrived.matrix, out=out.matrix[nodes])
        entering = arrived.vector
    else:
        entering = data.reshape(-1, samples, 6)
    joined = out.vector[nodes]
    np.matmul(matrix, entering[..., None], out=joined[..., None])
    joined += vector
