"""What a robot's controller is to do next."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.spatial import Array


class Setpoints(NamedTuple):
    """Where robots are to be and how they are to move there, ground frame; of the robots of this process.

    A robot that has failed (see `mp2a.formation.March`) keeps its last pose and has speed and turn rate zero.
    """

    pose: Array
    """x m, y m, heading rad, ``(m, 3)``"""
    speed: Array
    """Forward, along the heading, ``(m,)``, m/s."""
    turn_rate: Array
    """``(m,)``, rad/s, positive to the left."""
    acceleration: Array | None = None
    """Forward m/s² and of the turn rate rad/s², ``(m, 2)``; None where nobody knows it."""
    failed: NDArray[np.bool_] | None = None
    """``(m,)``: robots in their error state; None where none can be."""

    @property
    def twist(self) -> Array:
        """Forward speed and turn rate, ``(m, 2)``: what a velocity command holds."""
        return np.stack((self.speed, self.turn_rate), axis=-1)
