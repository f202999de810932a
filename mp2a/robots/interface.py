"""What a robot takes and gives, whatever is behind it."""

from typing import NamedTuple, Protocol

import numpy as np

from mp2a.spatial import Array

NO_POSE: Array = np.full(3, np.nan)
"""A look-up of the pose that failed."""


class Sensed(NamedTuple):
    """What a robot knows of itself at one moment."""

    pose: Array
    """``(3,)`` m, m, rad in its fixed frame; not a number if the look-up failed."""
    twist: Array
    """``(2,)`` measured forward speed and turn rate, m/s and rad/s; not a number if there was none."""
    points: Array | None
    """``(k, 2)`` m in its own frame if a scan has come since the last call, else None."""
    human: bool = False
    """Whether a human drives it at present."""
    stop_front: bool = False
    """Whether another program of the robot forbids driving forward."""
    stop_rear: bool = False
    """Whether another program of the robot forbids driving backward."""


class Robot(Protocol):
    """One robot: a command goes in; pose, velocity and points come out. Nothing here waits."""

    has_lidar: bool
    """Whether points are to be expected, so that their absence is a failure."""

    def sense(self) -> Sensed:
        """Return what is known now."""

    def send(self, command: Array) -> None:
        """Drive at a forward speed and turn rate ``(2,)``, m/s and rad/s, from now on."""

    def warn(self, text: str | None) -> None:
        """Say a text aloud; None: beep."""

    def close(self) -> None:
        """Stop the robot and let go of it."""


class Clock(Protocol):
    """The clock that a loop goes by, real or simulated."""

    def now(self) -> float:
        """Return the time since the start, s; negative before."""

    def wait(self, done: bool) -> bool:
        """Wait for the next tick; ``done`` says whether the caller is through. Returns whether all are."""
