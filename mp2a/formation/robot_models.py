"""The robots a formation is made of: size and limits."""

from dataclasses import dataclass

from mp2a.exceptions import InputError


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
        for field in ("length", "width", "max_speed", "max_turn_rate", "max_acceleration", "max_turn_acceleration"):
            value = getattr(self, field)
            if not 0 < value < float("inf"):
                raise InputError(f"{field}: got {value} for robot {self.name}, expected a positive number")


HUSKY = RobotModel("HUSKY", 0.99, 0.67, 1.0, 2.0, 3.0, 6.0)
"""Clearpath's HUSKY: size and speed from the thesis, chapter 2; the other limits are its ROS Noetic controller's."""

TRADR = RobotModel("TRADR", 0.73, 0.60, 0.5, 2.5, 1.0, 5.0)
"""The tracked TRADR: size and speed from the thesis, chapter 2. Its turn rate is that of tracks 0.397 m apart at
±0.5 m/s (the thesis has both robots turn faster than 180°/s). Nobody publishes its accelerations: 1 m/s² a track is
assumed."""

ROBOTS = {model.name.lower(): model for model in (HUSKY, TRADR)}
"""Every robot by lower-case name. A new robot is one more entry."""
