r"""The queue of positions: what a robot has been told of the way its predecessor went, and the place a spacing back.

The thesis (4.3) has each robot keep a queue of positions of the one it follows, filled at 10 Hz, and follow the path in
it. Here a queue is a path by arc length: places and directions, and between two of them the cubic that has both
(Hermite), whose error falls with the fourth power of their distance, so that the robots of a long line stay on the
leader's path. Handing such a path on from robot to robot amplifies no wave on it (the interpolation's largest
eigenvalue over all wavelengths and shifts is 1).

Queues of all robots are rows of the same arrays; no step goes through the robots one by one.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.plane import Complex, Motion, point, triple, turn
from mp2a.spatial import Array

PLACES = 40
"""Places a queue holds; `_STEPS` of them to a spacing."""
_STEPS = 32
_SLOW, _STILL = 1e-4, 1e-9
"""m/s and m"""


class Trail(NamedTuple):
    """Queues of m robots; the last place is where the predecessor is now, and moves on with it."""

    arc: Array
    """Length of the path up to each place, ``(m, PLACES)``, m, rising"""
    place: Complex
    """``(m, PLACES)``, ground frame, m"""
    direction: Complex
    """Of unit length, along the path, ``(m, PLACES)``"""
    step: Array
    """Least distance between two places, ``(m,)``, m"""
    speed: Array
    """Of the predecessor along its path, ``(m,)``, m/s"""
    acceleration: Array
    """Of that speed, ``(m,)``, m/s²"""
    gap: Array
    """Length of path between robot and predecessor that is wanted at present, ``(m,)``, m"""


def begin(own: Array, predecessor: Array, spacing: Array) -> Trail:
    """Queues before the start: the way from each robot's own place to its predecessor's.

    A robot that is closer than its spacing waits until its predecessor is a spacing ahead. One that is in the same
    place has no path at all yet, and waits as well. One that is further away closes up, see `follow`.

    Parameters
    ----------
    own, predecessor
        Poses ``(m, 3)``.
    spacing
        ``(m,)``, m.
    """
    way = point(predecessor) - point(own)
    length = np.abs(way)
    gap = np.maximum(length, spacing)
    m = len(own)
    arc, place = np.zeros((m, PLACES)), np.repeat(point(own)[:, None], PLACES, axis=1)
    direction = np.repeat(turn(own[:, 2])[:, None], PLACES, axis=1)
    arc[:, -1], place[:, -1], direction[:, -1] = length, point(predecessor), turn(predecessor[:, 2])
    return Trail(arc, place, direction, gap / _STEPS, np.zeros(m), np.zeros(m), gap)


def extend(trail: Trail, predecessor: Motion) -> Trail:
    """Put down where the predecessor is now.

    One that stands adds nothing, nor does one that an obstacle pushes back until it is past the last place again:
    nobody behind it reverses.
    """
    velocity = point(predecessor.velocity)
    speed = np.abs(velocity)
    moving = speed > _SLOW  # of what is slower, rounding might choose the direction
    heading = turn(predecessor.pose[:, 2])
    towards = np.where(moving, velocity / np.where(moving, speed, 1.0), trail.direction[:, -1] * np.conj(heading))
    place, direction = point(predecessor.pose), heading * towards
    onwards = (np.conj(trail.direction[:, -1]) * (place - trail.place[:, -1])).real > _STILL
    full = onwards & (trail.arc[:, -1] - trail.arc[:, -2] >= trail.step)

    def shifted(values: NDArray[Any]) -> NDArray[Any]:
        return np.where(full[:, None], np.roll(values, -1, axis=1), values)

    arc, places, directions = shifted(trail.arc), shifted(trail.place), shifted(trail.direction)
    length = arc[:, -2] + arc_length(places[:, -2], directions[:, -2], place, direction)
    arc[:, -1] = np.where(onwards, length, arc[:, -1])
    places[:, -1] = np.where(onwards, place, places[:, -1])
    directions[:, -1] = np.where(onwards, direction, directions[:, -1])
    # Rate of the velocity in the ground's axes, along the path.
    pull = point(predecessor.rate) + 1j * predecessor.velocity[:, 2] * velocity
    acceleration = (np.conj(towards) * pull).real
    return trail._replace(
        arc=arc,
        place=places,
        direction=directions,
        speed=np.where(onwards, speed, 0.0),
        acceleration=np.where(onwards, acceleration, 0.0),
    )


def arc_length(place: Complex, direction: Complex, other: Complex, towards: Complex) -> Array:
    """Length of the circular arc between two places with given directions; exact on lines and circles."""
    half = np.angle(towards * np.conj(direction)) / 2
    out: Array = np.abs(other - place) / np.sinc(half / np.pi)
    return out


def seen_from(trail: Trail, rows: NDArray[np.intp], points: Complex) -> tuple[Complex, NDArray[np.bool_]]:
    """Where points lie as seen from the paths in queues.

    Parameters
    ----------
    trail
        Queues.
    rows
        Which queue for each point, ``(k,)``.
    points
        Ground frame, ``(k,)``, m.

    Returns
    -------
    tuple of numpy.ndarray
        Arc length of the nearest place and, as imaginary part, how far to the left of it, ``(k,)``, m; and whether the
        point lies ahead of the queue's end, where the predecessor is.
    """
    away = points[:, None] - trail.place[rows]
    nearest = np.abs(away).argmin(1)
    k = np.arange(len(points))
    there = away[k, nearest] * np.conj(trail.direction[rows, nearest])
    ahead = (nearest == PLACES - 1) & (there.real > 0)
    return trail.arc[rows, nearest] + there, ahead


def follow(trail: Trail, spacing: Array, catch_up: float, tick: float) -> tuple[Motion, Trail]:
    """Motion of the place a gap back on each queue, and the queues with the next tick's gap.

    Parameters
    ----------
    trail
        Queues.
    spacing
        ``(m,)``, m.
    catch_up
        Speed at which a gap that is too long closes, m/s.
    tick
        s.

    Returns
    -------
    tuple
        `Motion` in the ground frame, heading along the path, ``(m, 3)`` each; and the queues.
    """
    wanted = trail.arc[:, -1] - trail.gap
    waiting = wanted <= trail.arc[:, 0]
    at = np.maximum(wanted, trail.arc[:, 0])
    rows = np.arange(len(at))
    left = np.clip((trail.arc <= at[:, None]).sum(1) - 1, 0, PLACES - 2)
    length = trail.arc[rows, left + 1] - trail.arc[rows, left]
    there = length <= 0
    length = np.where(there, 1.0, length)
    share = np.where(there, 0.0, (at - trail.arc[rows, left]) / length)
    first, second = trail.place[rows, left], trail.place[rows, left + 1]
    place, slope, bend, twist = _cubic(
        first, second, trail.direction[rows, left], trail.direction[rows, left + 1], length, share
    )
    place, slope = np.where(there, first, place), np.where(there, trail.direction[rows, left], slope)
    bend, twist = np.where(there, 0.0, bend), np.where(there, 0.0, twist)
    closing = trail.gap > spacing
    gap = np.where(closing, np.maximum(spacing, trail.gap - catch_up * tick), spacing)
    rate = np.where(waiting, 0.0, trail.speed + (trail.gap - gap) / tick)
    rate_rate = np.where(waiting, 0.0, trail.acceleration)
    scale, curve = np.abs(slope), bend / slope
    turning = twist / slope - curve**2
    pose = triple(place, np.angle(slope))
    velocity = triple(scale * rate + 0j, curve.imag * rate)
    speed_rate = scale * (rate_rate + curve.real * rate**2)
    motion = Motion(pose, velocity, triple(speed_rate + 0j, turning.imag * rate**2 + curve.imag * rate_rate))
    return motion, trail._replace(gap=gap)


def _cubic(
    first: Complex, second: Complex, start: Complex, end: Complex, length: Array, share: Array
) -> tuple[Complex, Complex, Complex, Complex]:
    """Cubic between two places with given directions at a share of its length, and its derivatives by arc length."""
    f, way = share, (second - first) / length
    a, b, c = start, 3 * way - 2 * start - end, start + end - 2 * way
    place = first + length * f * (a + f * (b + f * c))
    return (
        place,
        a + f * (2 * b + 3 * f * c),
        (2 * b + 6 * f * c) / length,
        6 * c / length**2,
    )
