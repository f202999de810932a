r"""The queue of positions: what a robot knows of the way its predecessor went, and the place a spacing back.

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

from mp2a.formation.constants import CLOSING_SPEED
from mp2a.formation.vectors import Complex, as_complex, unit
from mp2a.se2 import PlanarMotion
from mp2a.spatial import Array

LENGTH = 40
"""Places a queue holds; `_STEPS` of them to a spacing."""
_STEPS = 32
_SLOW, _STILL = 1e-4, 1e-9
"""m/s and m"""


class PathQueues(NamedTuple):
    """The queues of m robots; the last place is where the predecessor is now, and moves on with it."""

    arc: Array
    """Length of the path up to each place, ``(m, LENGTH)``, m, rising"""
    place: Complex
    """``(m, LENGTH)``, ground frame, m"""
    direction: Complex
    """Of unit length, along the path, ``(m, LENGTH)``"""
    step: Array
    """Least distance between two places, ``(m,)``, m"""
    speed: Array
    """Of the predecessor along its path, ``(m,)``, m/s"""
    acceleration: Array
    """Of that speed, ``(m,)``, m/s²"""
    gap: Array
    """Length of path between robot and predecessor that is wanted at present, ``(m,)``, m"""


def begin(own: Array, predecessor: Array, spacing: Array) -> PathQueues:
    """Return the queues before the start: the way from each robot's own place to its predecessor's.

    A robot that is closer than its spacing waits until its predecessor is a spacing ahead. One that is in the same
    place has no path at all yet, and waits as well. One that is further away closes up, see `follow`.

    Parameters
    ----------
    own, predecessor
        Poses ``(m, 3)``.
    spacing
        ``(m,)``, m.
    """
    way = as_complex(predecessor) - as_complex(own)
    length = np.abs(way)
    gap = np.maximum(length, spacing)
    m = len(own)
    arc, place = np.zeros((m, LENGTH)), np.repeat(as_complex(own)[:, None], LENGTH, axis=1)
    direction = np.repeat(unit(own[:, 2])[:, None], LENGTH, axis=1)
    arc[:, -1], place[:, -1], direction[:, -1] = length, as_complex(predecessor), unit(predecessor[:, 2])
    return PathQueues(arc, place, direction, gap / _STEPS, np.zeros(m), np.zeros(m), gap)


def extend(queues: PathQueues, predecessor: PlanarMotion) -> PathQueues:
    """Return queues with where the predecessor is now.

    One that stands adds nothing, nor does one that an obstacle pushes back until it is past the last place again:
    nobody behind it reverses.
    """
    velocity = as_complex(predecessor.velocity)
    speed = np.abs(velocity)
    moving = speed > _SLOW  # of what is slower, rounding might choose the direction
    heading = unit(predecessor.pose[:, 2])
    towards = np.where(moving, velocity / np.where(moving, speed, 1.0), queues.direction[:, -1] * np.conj(heading))
    place, direction = as_complex(predecessor.pose), heading * towards
    onwards = (np.conj(queues.direction[:, -1]) * (place - queues.place[:, -1])).real > _STILL
    full = onwards & (queues.arc[:, -1] - queues.arc[:, -2] >= queues.step)

    def shifted(values: NDArray[Any]) -> NDArray[Any]:
        return np.where(full[:, None], np.roll(values, -1, axis=1), values)

    arc, places, directions = shifted(queues.arc), shifted(queues.place), shifted(queues.direction)
    length = arc[:, -2] + arc_length(places[:, -2], directions[:, -2], place, direction)
    arc[:, -1] = np.where(onwards, length, arc[:, -1])
    places[:, -1] = np.where(onwards, place, places[:, -1])
    directions[:, -1] = np.where(onwards, direction, directions[:, -1])
    # Rate of the velocity in the ground's axes, along the path.
    pull = as_complex(predecessor.rate) + 1j * predecessor.velocity[:, 2] * velocity
    acceleration = (np.conj(towards) * pull).real
    return queues._replace(
        arc=arc,
        place=places,
        direction=directions,
        speed=np.where(onwards, speed, 0.0),
        acceleration=np.where(onwards, acceleration, 0.0),
    )


def arc_length(place: Complex, direction: Complex, other: Complex, towards: Complex) -> Array:
    """Return the length of the circular arc between two places with given directions; exact on lines and circles."""
    half = np.angle(towards * np.conj(direction)) / 2
    out: Array = np.abs(other - place) / np.sinc(half / np.pi)
    return out


def seen_from(queues: PathQueues, rows: NDArray[np.intp], points: Complex) -> tuple[Complex, NDArray[np.bool_]]:
    """Return where points lie as seen from the paths in queues.

    Parameters
    ----------
    queues
        Those of m robots.
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
    away = points[:, None] - queues.place[rows]
    nearest = np.abs(away).argmin(1)
    k = np.arange(len(points))
    there = away[k, nearest] * np.conj(queues.direction[rows, nearest])
    ahead = (nearest == LENGTH - 1) & (there.real > 0)
    return queues.arc[rows, nearest] + there, ahead


def follow(queues: PathQueues, spacing: Array, tick: float) -> tuple[PlanarMotion, PathQueues]:
    """Return the motion of the place a gap back on each queue, and the queues with the next tick's gap.

    A gap that is too long closes at `CLOSING_SPEED`.

    Parameters
    ----------
    queues
        Those of m robots.
    spacing
        ``(m,)``, m.
    tick
        s.

    Returns
    -------
    tuple
        The motion in the ground frame, heading along the path, ``(m, 3)`` each; and the queues.
    """
    wanted = queues.arc[:, -1] - queues.gap
    waiting = wanted <= queues.arc[:, 0]
    at = np.maximum(wanted, queues.arc[:, 0])
    rows = np.arange(len(at))
    left = np.clip((queues.arc <= at[:, None]).sum(1) - 1, 0, LENGTH - 2)
    length = queues.arc[rows, left + 1] - queues.arc[rows, left]
    there = length <= 0
    length = np.where(there, 1.0, length)
    share = np.where(there, 0.0, (at - queues.arc[rows, left]) / length)
    first, second = queues.place[rows, left], queues.place[rows, left + 1]
    place, slope, bend, twist = _cubic(
        first, second, queues.direction[rows, left], queues.direction[rows, left + 1], length, share
    )
    place, slope = np.where(there, first, place), np.where(there, queues.direction[rows, left], slope)
    bend, twist = np.where(there, 0.0, bend), np.where(there, 0.0, twist)
    closing = queues.gap > spacing
    gap = np.where(closing, np.maximum(spacing, queues.gap - CLOSING_SPEED * tick), spacing)
    rate = np.where(waiting, 0.0, queues.speed + (queues.gap - gap) / tick)
    rate_rate = np.where(waiting, 0.0, queues.acceleration)
    scale, curve = np.abs(slope), bend / slope
    turning = twist / slope - curve**2
    still = np.zeros(len(at))
    pose = np.stack((place.real, place.imag, np.angle(slope)), axis=-1)
    velocity = np.stack((scale * rate, still, curve.imag * rate), axis=-1)
    speed_rate, turn_rate_rate = scale * (rate_rate + curve.real * rate**2), turning.imag * rate**2
    rates = np.stack((speed_rate, still, turn_rate_rate + curve.imag * rate_rate), axis=-1)
    return PlanarMotion(pose, velocity, rates), queues._replace(gap=gap)


def _cubic(
    first: Complex, second: Complex, start: Complex, end: Complex, length: Array, share: Array
) -> tuple[Complex, Complex, Complex, Complex]:
    """Return the cubic between two places with directions, and its derivatives by arc length, at a share of it."""
    f, way = share, (second - first) / length
    a, b, c = start, 3 * way - 2 * start - end, start + end - 2 * way
    place = first + length * f * (a + f * (b + f * c))
    return (
        place,
        a + f * (2 * b + 3 * f * c),
        (2 * b + 6 * f * c) / length,
        6 * c / length**2,
    )
