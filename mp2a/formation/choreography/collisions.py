"""Rectangles on the ground that come too close to each other."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.spatial import Array

_CHUNK = 200_000
"""Pairs and ticks looked at together."""


class Close(NamedTuple):
    """Two robots closer than a margin, over some ticks."""

    first: int
    second: int
    begin: int
    end: int
    """Last tick of it."""
    overlap: bool
    """Whether their bodies overlap."""


def overlaps(offset: Array, heading: Array, size: Array, other_heading: Array, other_size: Array) -> NDArray[np.bool_]:
    """Whether rectangles overlap or touch, by the separating axis theorem.

    Parameters
    ----------
    offset
        From the centre of one to the centre of the other, ``(..., 2)`` m.
    heading, size
        Of the one: rad, and ``(..., 2)`` half lengths along its own axes, m.
    other_heading, other_size
        Of the other.
    """
    turned = other_heading - heading
    c, s = np.abs(np.cos(turned)), np.abs(np.sin(turned))
    apart = np.zeros(offset.shape[:-1], dtype=bool)
    for angle, own, far in ((heading, size, other_size), (other_heading, other_size, size)):
        cosine, sine = np.cos(angle), np.sin(angle)
        x = np.abs(cosine * offset[..., 0] + sine * offset[..., 1])
        y = np.abs(cosine * offset[..., 1] - sine * offset[..., 0])
        apart |= x > own[..., 0] + c * far[..., 0] + s * far[..., 1]
        apart |= y > own[..., 1] + s * far[..., 0] + c * far[..., 1]
    return ~apart


def close_pairs(poses: Array, sizes: Array, margin: float, pause: int) -> list[Close]:
    """Find who comes too close to whom and when.

    Parameters
    ----------
    poses
        ``(T, n, 3)`` m and rad.
    sizes
        ``(n, 2)`` lengths and widths, m.
    margin
        What is to stay free between two bodies, m.
    pause
        Times of a pair that are at most so many ticks apart are reported as one.

    Returns
    -------
    list of Close
        Sorted by when they begin.
    """
    n = poses.shape[1]
    first, second = np.triu_indices(n, 1)
    found: dict[int, list[tuple[int, bool]]] = {}
    ticks = max(1, _CHUNK // max(len(first), 1))
    half = sizes / 2
    reach = np.hypot(*half.T)
    for begin in range(0, len(poses), ticks):
        part = poses[begin : begin + ticks]
        offset = part[:, second, :2] - part[:, first, :2]
        near = np.hypot(offset[..., 0], offset[..., 1]) <= reach[first] + reach[second] + 2 * margin
        tick, pair = np.nonzero(near)
        a, b = first[pair], second[pair]
        arguments = offset[tick, pair], part[tick, a, 2]
        close = overlaps(*arguments, half[a] + margin / 2, part[tick, b, 2], half[b] + margin / 2)
        touch = overlaps(*arguments, half[a], part[tick, b, 2], half[b])
        for k in np.flatnonzero(close):
            found.setdefault(int(pair[k]), []).append((begin + int(tick[k]), bool(touch[k])))
    out = []
    for which, times in found.items():
        for stretch in _stretches(times, pause):
            ends = stretch[0][0], stretch[-1][0]
            out.append(Close(int(first[which]), int(second[which]), *ends, any(touch for _, touch in stretch)))
    return sorted(out, key=lambda close: (close.begin, close.first, close.second))


def _stretches(times: list[tuple[int, bool]], pause: int) -> list[list[tuple[int, bool]]]:
    out: list[list[tuple[int, bool]]] = []
    for tick, touch in times:
        if out and tick - out[-1][-1][0] <= pause:
            out[-1].append((tick, touch))
        else:
            out.append([(tick, touch)])
    return out
