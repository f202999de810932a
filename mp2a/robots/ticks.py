"""What a robot knew, decided and was sent at one tick: for records and for who watches."""

from typing import NamedTuple

from mp2a.robots.interface import Sensed
from mp2a.spatial import Array


class DriveTick(NamedTuple):
    """What happened at one tick of one robot."""

    time: float
    """s since the start."""
    sensed: Sensed
    """What the robot knew, its pose in its own fixed frame; points are single precision."""
    pose: Array
    """``(3,)`` the same pose in the planner's ground frame, m and rad."""
    leader: Array
    """``(2,)`` m in the ground frame: the point whose path it is to follow."""
    command: Array
    """``(2,)`` sent."""
    share: float
    """Of a commanded turn that is taken to be left after slip."""
    blocked: bool
    error: bool
    done: bool
    stands: bool = False
    """Whether this is the last one: the drive has ended, and zero was sent."""

    @property
    def flags(self) -> tuple[bool, bool, bool, bool]:
        """What holds at this tick, in the order of `EVENTS`."""
        return self.blocked, self.error, self.sensed.human, self.done


EVENTS = (
    ("stops: something is in its way", "goes on"),
    ("is in its error state and stays there", ""),
    ("is driven by a human", "drives by itself again"),
    ("is at its end", "is not at its end any more"),
)
"""What is told when a flag is set, and when it is cleared."""
BEGINS = (False,) * len(EVENTS)
"""Flags before the first tick."""


def changes(before: tuple[bool, ...], now: tuple[bool, ...]) -> list[str]:
    """Return what has changed from the flags of one tick to those of the next, as texts."""
    changed = [pair[not after] for pair, was, after in zip(EVENTS, before, now, strict=True) if was != after]
    return [text for text in changed if text]


COLUMNS = (
    "time", "x", "y", "heading", "leader_x", "leader_y", "speed", "turn_rate", "linear_x", "angular_z",
    "share", "blocked", "error", "human",
)  # fmt: skip
"""Of a row: s, m and rad in the ground frame, m/s, rad/s; flags are 0 or 1."""


def table_row(tick: DriveTick) -> list[str]:
    """Return the texts of a tick for a table with `COLUMNS`."""
    numbers = (tick.time, *tick.pose, *tick.leader, *tick.sensed.twist, *tick.command, tick.share)
    return [*(f"{number:.6g}" for number in numbers), *(f"{flag:d}" for flag in tick.flags[:3])]
