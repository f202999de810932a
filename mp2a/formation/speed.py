r"""How fast a leader may go along its path: limits of speed, of turn rate and of acceleration."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mp2a.exceptions import InputError
from mp2a.spatial import Array


@dataclass(frozen=True)
class Limits:
    """What the leader keeps to, the turn rate through a lower speed in bends.

    Attributes
    ----------
    speed
        m/s. A robot at the edge of a wide shape is faster in a bend than the leader.
    turn_rate
        rad/s
    acceleration
        Along the path, both ways, m/s².

    Raises
    ------
    InputError
        If one of them is not positive and finite.
    """

    speed: float = 0.7
    turn_rate: float = 0.5
    acceleration: float = 0.5

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < float("inf"):
                raise InputError(f"{name}: got {value!r}, expected a positive number")


class SpeedProfile(NamedTuple):
    """The motion along a path from rest to rest, with constant acceleration between knots ``(k,)``."""

    time: Array
    """s"""
    arc: Array
    """m"""
    speed: Array
    """m/s"""

    def at(self, time: float) -> tuple[float, float, float]:
        """Return arc length m, speed m/s and acceleration m/s² at a time; at rest before and after."""
        if not 0 <= time < self.time[-1]:
            return float(self.arc[0 if time < 0 else -1]), 0.0, 0.0
        i = int(np.searchsorted(self.time, time, side="right")) - 1
        acceleration = float((self.speed[i + 1] - self.speed[i]) / (self.time[i + 1] - self.time[i]))
        since = time - float(self.time[i])
        speed = float(self.speed[i]) + acceleration * since
        return float(self.arc[i]) + (float(self.speed[i]) + speed) / 2 * since, speed, acceleration


def profile(arc: Array, curvature: Array, limits: Limits) -> SpeedProfile:
    """Return the fastest motion within the limits that starts and ends at rest.

    Speed squared is linear in arc length where the acceleration is constant, so one pass forwards and one backwards
    over the knots find the largest speeds (Bobrow, Dubowsky and Gibson 1985, for a path with these limits).

    Parameters
    ----------
    arc
        Knots ``(k,)``, m, rising; a corner of the curvature has to be a knot.
    curvature
        Largest absolute one between each knot and the next, ``(k - 1,)``, 1/m.
    limits
        Limits.
    """
    bend = np.maximum(np.append(curvature, 0.0), np.append(0.0, curvature))
    with np.errstate(divide="ignore"):
        square = np.minimum(limits.speed, limits.turn_rate / bend) ** 2
    square[[0, -1]] = 0.0
    gain = 2 * limits.acceleration * np.diff(arc)
    for i in range(len(gain)):
        square[i + 1] = min(square[i + 1], square[i] + gain[i])
    for i in range(len(gain) - 1, -1, -1):
        square[i] = min(square[i], square[i + 1] + gain[i])
    speed = np.sqrt(square)
    time = np.append(0.0, np.cumsum(2 * np.diff(arc) / (speed[1:] + speed[:-1])))
    return SpeedProfile(time, arc, speed)
