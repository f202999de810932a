"""Shapes of formations: who hangs on whom, and where. A new shape is a function and a line in `SHAPES`."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.checks import count
from mp2a.exceptions import InputError
from mp2a.formation.vectors import as_complex
from mp2a.se2 import compose
from mp2a.spatial import Array


class Layout(NamedTuple):
    """The slots of robots relative to those they hang on. Robot 0 leads and hangs on the ground."""

    parents: NDArray[np.intp]
    """``(n,)``; -1 for the leader"""
    slots: Array
    """``(n, 3)``: x m, y m, heading rad in the parent's frame; of the leader, zeros"""
    follows: bool
    """Whether a robot follows the way its parent went, at the distance of its slot, and not the slot itself."""

    def poses(self, start: Array) -> Array:
        """Return the poses ``(n, 3)`` of all robots if the leader is at ``start`` ``(3,)``."""
        out = np.empty((len(self.parents), 3))
        for i, parent in enumerate(self.parents):
            out[i] = compose(start if parent < 0 else out[parent], self.slots[i])
        return out


def line(n: int, spacing: float) -> Layout:
    """Follow the leader: one behind the other, each on the way of the one before (paper, figures 1 and 11)."""
    slots = np.zeros((n, 3))
    slots[1:, 0] = -spacing
    return Layout(np.arange(n) - 1, slots, follows=True)


def column(n: int, spacing: float) -> Layout:
    """One behind the other, rigid: a bend sweeps the last one sideways."""
    return rigid(np.arange(n) - 1, -spacing * np.arange(n) + 0j)


def row(n: int, spacing: float) -> Layout:
    """Side by side, the leader in the middle (of an even number, the right one of the two)."""
    k = np.arange(n)
    side = np.where(k % 2 == 1, 1, -1) * ((k + 1) // 2)
    return rigid(np.maximum(k - 2, 0) - (k == 0), 1j * spacing * side)


def triangle(n: int, spacing: float) -> Layout:
    """Rows of one, two, three, … robots, the leader at the tip; neighbours at the same distance."""
    k = np.arange(n)
    rank = ((np.sqrt(8 * k + 1) - 1) / 2 + 1e-9).astype(np.intp)
    place = k - rank * (rank + 1) // 2
    parents = np.where(rank > 0, (rank - 1) * rank // 2 + np.minimum(place, rank - 1), -1)
    return rigid(parents, spacing * (-np.sqrt(0.75) * rank + 1j * (rank / 2 - place)))


def square(n: int, spacing: float) -> Layout:
    """Rows of ⌈√n⌉ robots, the leader in the middle of the first; behind it every robot hangs on the one in front."""
    width = int(np.ceil(np.sqrt(n)))
    front = row(width, spacing)
    k = np.arange(n)
    parents = np.where(k < width, np.resize(front.parents, n), k - width)
    across = 1j * as_complex(front.poses(np.zeros(3))).imag
    return rigid(parents, np.resize(across, n) - spacing * (k // width))


def polygon(n: int, spacing: float) -> Layout:
    """Corners of a regular polygon with the leader in front; the others hang on their neighbours, left and right."""
    k = np.arange(n)
    corner = np.where(k % 2 == 1, 1, -1) * ((k + 1) // 2)
    radius = spacing / (2 * np.sin(np.pi / n)) if n > 1 else 0.0
    around = radius * (np.exp(2j * np.pi * corner / n) - 1)
    return rigid(np.maximum(k - 2, 0) - (k == 0), around)


def box(n: int, spacing: float) -> Layout:
    """Three in a rigid triangle around a box that they carry (paper, figure 13); its middle is `centre`.

    Raises
    ------
    InputError
        If there are not three.
    """
    if n != 3:
        raise InputError(f"robots: got {n} for the shape 'box', expected 3")
    return polygon(3, spacing)


SHAPES: dict[str, Callable[[int, float], Layout]] = {
    "line": line,
    "column": column,
    "row": row,
    "triangle": triangle,
    "square": square,
    "polygon": polygon,
    "box": box,
}
"""Every shape by name: a function of the number of robots and their distance in m."""


def layout(shape: str, n: int, spacing: float) -> Layout:
    """Look a shape up.

    Raises
    ------
    InputError
        If there is no such shape, no robot, or the spacing is not positive and finite.
    """
    if shape not in SHAPES:
        raise InputError(f"shape: got {shape!r}, expected one of {', '.join(SHAPES)}")
    if not 0 < spacing < np.inf:
        raise InputError(f"spacing: got {spacing!r}, expected a positive number of metres")
    return SHAPES[shape](count("robots", n), float(spacing))


def rigid(parents: NDArray[np.intp], positions: NDArray[np.complexfloating]) -> Layout:
    """Return the layout of robots that keep their slots, all with the leader's heading.

    Parameters
    ----------
    parents
        ``(n,)``
    positions
        x + i y of each in the leader's frame, ``(n,)``, m.
    """
    relative = positions - np.where(parents >= 0, positions[parents], positions)
    return Layout(
        parents,
        np.column_stack((np.stack((relative.real, relative.imag), axis=-1), np.zeros(len(parents)))),
        follows=False,
    )


def centre(layout: Layout) -> Array:
    """Return the middle of a shape in the leader's frame, ``(2,)``, m: where the box is."""
    out: Array = layout.poses(np.zeros(3))[:, :2].mean(axis=0)
    return out
