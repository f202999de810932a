"""How a skid-steer robot answers to a velocity command: slip and limited acceleration."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import positive
from mp2a.exceptions import InputError
from mp2a.se2 import compose, drive
from mp2a.spatial import Array


class TurnSlip(NamedTuple):
    """Share of the commanded turn rate that is left after the wheels have slipped sideways.

    It falls linearly from `standing` to `driving` with the robot's speed, and stays there above `full_speed`.
    """

    standing: float = 0.834
    """On the spot. Default: measured with Clearpath's HUSKY in a physics engine, 0.417 of 0.5 rad/s."""
    driving: float = 0.834
    """At `full_speed`."""
    full_speed: float = 0.5
    """m/s"""

    def ratio(self, speeds: ArrayLike) -> Array:
        """Share at speeds of any sign, m/s."""
        out: Array = np.interp(np.abs(speeds), (0.0, self.full_speed), (self.standing, self.driving))
        return out

    def check(self) -> None:
        """Raise InputError unless both shares lie above 0 and not above 1, and the speed is positive."""
        for name, value in zip(("standing", "driving"), self[:2], strict=True):
            if positive(f"slip.{name}", value) > 1:
                raise InputError(f"slip.{name}: got {value}, expected a share of at most 1")
        positive("slip.full_speed", self.full_speed)


NO_SLIP = TurnSlip(1.0, 1.0)
"""Wheels that do not slip: a constant command drives a circle of radius v/ω."""

PHYSICS_ENGINE_SLIP = TurnSlip(0.834, 0.322)
"""Measured with Clearpath's HUSKY in a physics engine: 0.5 rad/s give 0.417 standing and 0.161 at 0.5 m/s."""


SLIPS = {"none": NO_SLIP, "mild": TurnSlip(), "hard": PHYSICS_ENGINE_SLIP}
"""Slip by name."""


class Response(NamedTuple):
    """Motion during a short time; arrays ``(n, 2)`` of m/s and rad/s."""

    mean: Array
    end: Array


def respond(twists: Array, targets: Array, most: Array, dt: float) -> Response:
    """Let speeds approach their targets with limited acceleration.

    Parameters
    ----------
    twists, targets
        ``(n, 2)`` now and wanted, m/s and rad/s.
    most
        ``(n, 2)`` greatest accelerations, m/s² and rad/s².
    dt
        s

    Returns
    -------
    Response
        Mean over the time and value at its end, exact for constant acceleration until the target is reached.
    """
    time = np.minimum(np.abs(targets - twists) / most, dt)
    end = speeds_after(twists, targets, most, dt)
    return Response(((twists + end) / 2 * time + end * (dt - time)) / dt, end)


def speeds_after(twists: Array, targets: Array, most: Array, dt: float) -> Array:
    """Return the speeds ``(n, 2)`` after ``dt`` s in which they approach their targets with limited acceleration."""
    change = most * dt
    return twists + np.clip(targets - twists, -change, change)


def drive_arcs(poses: Array, twists: Array, dt: float | Array) -> Array:
    """Return the poses ``(n, 3)`` after arcs of constant twists ``(n, 2)`` for ``dt`` s, one for all or ``(n,)``."""
    return compose(poses, drive(twists, dt))
