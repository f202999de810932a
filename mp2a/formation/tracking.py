"""A skid-steer robot on its setpoint: the law of Kanayama and others (1990), from pose and setpoint to a command."""

from typing import NamedTuple

import numpy as np

from mp2a.se2 import relative, wrap
from mp2a.spatial import Array

_SLOW = 0.05
"""m/s, below which a place has no direction of its own."""


_FAR = 0.5
"""m, beyond which an error counts as no larger: a robot far off heads back at an angle, and does not spin."""


class Gains(NamedTuple):
    """How hard a robot is held to its setpoint."""

    along: float = 1.5
    """1/s"""
    across: float = 4.0
    """1/m²"""
    heading: float = 4.0
    """1/m; critically damped with heading² = 4 across."""


def track(place: Array, velocity: Array, poses: Array, gains: Gains | None = None) -> Array:
    """Return speeds that take robots to their setpoints and along with them, before any limit.

    A skid-steer robot cannot move sideways, so it heads where its place moves to, which in a bend of a wide formation
    is not where the formation heads. A robot whose place stands does not turn: what it is off to the side stays.

    Parameters
    ----------
    place
        Setpoints ``(m, 3)``, m, m, rad.
    velocity
        Of them, ``(m, 3)``: ahead and to the left m/s, turn rate rad/s, in their own frames.
    poses
        Where the robots are, ``(m, 3)``.
    gains
        Of the law.

    Returns
    -------
    numpy.ndarray
        ``(m, 2)`` forward speed and turn rate, m/s and rad/s.
    """
    k = gains or Gains()
    along, side = velocity[:, 0], velocity[:, 1]
    backwards = np.where(along < 0, -1.0, 1.0)
    size = np.hypot(along, side)
    drift = np.where(size > _SLOW, np.arctan2(side * backwards, np.abs(along)), 0.0)
    speed = backwards * size * np.cos(np.where(size > _SLOW, 0.0, np.arctan2(side, np.abs(along))))
    ahead, left, off = relative(poses, place).T
    ahead, left = np.clip((ahead, left), -_FAR, _FAR)
    off = wrap(off + drift)
    linear = speed * np.cos(off) + k.along * ahead
    angular = velocity[:, 2] + speed * (k.across * left + k.heading * np.sin(off))
    return np.stack((linear, angular), axis=-1)
