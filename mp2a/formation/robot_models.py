"""The robots a formation is made of: size and limits."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mp2a.exceptions import InputError
from mp2a.spatial import Array


@dataclass(frozen=True)
class RobotModel:
    """A skid-steer robot: it drives along its x axis and turns about its centre.

    Attributes
    ----------
    name
        What it is called.
    length, width
        Of the body along x and y, m; its origin is in the middle.
    max_speed, max_turn_rate
        m/s and rad/s, the same in both directions.
    max_acceleration, max_turn_acceleration
        m/s² and rad/s², also when braking.

    Raises
    ------
    InputError
        If a size or a limit is not positive and finite.
    """

    name: str
    length: float
    width: float
    max_speed: float
    max_turn_rate: float
    max_acceleration: float
    max_turn_acceleration: float

    def __post_init__(self) -> None:
        for field, value in vars(self).items():
            if field != "name" and not 0 < value < float("inf"):
                raise InputError(f"{field}: got {value} for robot {self.name}, expected a positive number")


HUSKY = RobotModel("HUSKY", 0.99, 0.67, 1.0, 2.0, 3.0, 6.0)
"""Clearpath's HUSKY: size and speed from the thesis, chapter 2; the other limits are its ROS Noetic controller's."""

TRADR = RobotModel("TRADR", 0.73, 0.60, 0.5, 2.5, 1.0, 5.0)
"""The tracked TRADR: size and speed from the thesis, chapter 2. Its turn rate is that of tracks 0.397 m apart at
±0.5 m/s (the thesis has both robots turn faster than 180°/s). Nobody publishes its accelerations: 1 m/s² a track is
assumed."""

ROBOTS = {model.name.lower(): model for model in (HUSKY, TRADR)}
"""Every robot by lower-case name. A new robot is one more entry."""


class Fleet(NamedTuple):
    """Sizes and limits of n robots as arrays ``(n,)``, m, m/s, rad/s, m/s², rad/s²."""

    length: Array
    width: Array
    max_speed: Array
    max_turn_rate: Array
    max_acceleration: Array
    max_turn_acceleration: Array

    @classmethod
    def of(cls, models: Sequence[RobotModel]) -> "Fleet":
        """Return the sizes and limits of models."""
        return cls(*(np.array([getattr(model, name) for model in models]) for name in cls._fields))

    @property
    def sizes(self) -> Array:
        """Lengths and widths, ``(n, 2)`` m."""
        return np.column_stack((self.length, self.width))

    @property
    def radius(self) -> Array:
        """Distance from the middle of each robot to its corners, ``(n,)`` m."""
        out: Array = np.hypot(self.length, self.width) / 2
        return out

    @property
    def fastest(self) -> Array:
        """Limits of commands, ``(n, 2)``, m/s and rad/s."""
        return np.column_stack((self.max_speed, self.max_turn_rate))

    @property
    def accelerations(self) -> Array:
        """Greatest accelerations, ``(n, 2)``, m/s² and rad/s²."""
        return np.column_stack((self.max_acceleration, self.max_turn_acceleration))
