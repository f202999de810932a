"""Commands within what a robot can do, without bending its path.

All on arrays ``(..., 2)`` of forward speed (m/s) and turn rate (rad/s).
"""

import numpy as np
from numpy.typing import ArrayLike

from mp2a.spatial import Array


def saturate(command: ArrayLike, most: ArrayLike) -> Array:
    """Slow a command down until it is within the limits; the curvature ω/v of the path stays.

    Parameters
    ----------
    command
        ``(..., 2)`` wanted.
    most
        ``(..., 2)`` greatest speed and turn rate, positive.

    Returns
    -------
    ndarray
        ``(..., 2)``: the command times the greatest share of at most 1 that is within the limits.
    """
    wanted, limit = np.asarray(command, float), np.asarray(most, float)
    excess = np.max(np.abs(wanted) / limit, axis=-1, keepdims=True)
    # A product with a share below 1 may round up past the limit, hence the clip.
    out: Array = np.clip(wanted / np.maximum(excess, 1.0), -limit, limit)
    return out


def approach(now: ArrayLike, wanted: ArrayLike, most: ArrayLike, dt: float) -> Array:
    """Go from one command towards another on a straight line, as fast as the accelerations allow.

    Speed and turn rate change by the same share of what is missing. So a robot that starts from rest or brakes to
    rest keeps to the curvature it is to have or had, and in between the curvature goes from one to the other.

    Parameters
    ----------
    now, wanted
        ``(..., 2)`` commands.
    most
        ``(..., 2)`` greatest acceleration, m/s² and rad/s², positive.
    dt
        s since ``now`` was sent.

    Returns
    -------
    ndarray
        ``(..., 2)``: the next command.
    """
    begin, end, limit = np.asarray(now, float), np.asarray(wanted, float), np.asarray(most, float) * dt
    missing = end - begin
    steps = np.max(np.abs(missing) / limit, axis=-1, keepdims=True)
    out: Array = np.where(steps <= 1.0, end, begin + missing / np.maximum(steps, 1.0))
    return out
