"""The robots of a scenario: which model each role has, and their sizes and limits as arrays."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mp2a.exceptions import InputError
from mp2a.formation.choreography.scenario import Scenario
from mp2a.formation.robot_models import RobotModel
from mp2a.spatial import Array


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
    def fastest(self) -> Array:
        """Limits of commands, ``(n, 2)``, m/s and rad/s."""
        return np.column_stack((self.max_speed, self.max_turn_rate))

    @property
    def radius(self) -> Array:
        """Distance from the middle of each robot to its corners, ``(n,)`` m."""
        out: Array = np.hypot(self.length, self.width) / 2
        return out


def models(scenario: Scenario, robots: RobotModel | Mapping[str, RobotModel]) -> tuple[RobotModel, ...]:
    """Return the models of a scenario's robots, in their order.

    Raises
    ------
    InputError
        If a role has no model, or a model is for a role that is not in the scenario.
    """
    if isinstance(robots, RobotModel):
        return (robots,) * len(scenario.robots)
    missing = [role for role in scenario.robots if role not in robots]
    unknown = [role for role in robots if role not in scenario.robots]
    if missing or unknown:
        got = f"none for {missing[0]}" if missing else f"one for unknown robot {unknown[0]}"
        raise InputError(f"robots: got {got}, expected a model for every robot of the scenario")
    return tuple(robots[role] for role in scenario.robots)
