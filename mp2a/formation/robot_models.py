"""The robots a formation is made of: their size and what they can do."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RobotModel:
    """A robot seen from above, and its limits."""

    name: str
    length: float
    """m, along its x axis, which points forward."""
    width: float
    """m"""
    max_speed: float
    """m/s, forward and backward."""
    max_turn_rate: float
    """rad/s"""
    max_acceleration: float
    """m/s²"""
    max_turn_acceleration: float
    """rad/s²"""


HUSKY = RobotModel("HUSKY", 0.99, 0.67, 1.0, 2.0, 3.0, 6.0)
"""Size and speed: the thesis, chapter 2. Other limits: Clearpath's configuration for ROS Noetic."""

TRADR = RobotModel("TRADR", 0.73, 0.60, 0.5, 2.0, 3.0, 6.0)
"""Size and speed: the thesis, chapter 2. Other limits are not published; HUSKY's are assumed."""

ROBOTS = {model.name.lower(): model for model in (HUSKY, TRADR)}
"""By name in lower case."""
