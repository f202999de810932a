"""What happens to robots in a run that is worth telling: an explicit small set of kinds, and who it happened to."""

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.spatial import Array


class EventKind(Enum):
    """What happened; recordings hold the value."""

    COLLISION = "collision"
    ERROR_STATE = "error state"
    STOP = "stop"
    GO_ON = "go on"
    CONTACT = "contact"
    CATCH_UP = "catch up"
    CAUGHT_UP = "caught up"


_SENTENCES = {
    EventKind.COLLISION: "drives into",
    EventKind.ERROR_STATE: "is in its error state and stays there",
    EventKind.STOP: "stops: something is in its way",
    EventKind.GO_ON: "goes on",
    EventKind.CONTACT: "has an obstacle inside its radius",
    EventKind.CATCH_UP: "is far behind and catches up",
    EventKind.CAUGHT_UP: "has caught up",
}
GOOD_NEWS = (EventKind.GO_ON, EventKind.CAUGHT_UP)
"""Kinds that tell the end of a state; all others are warnings."""
STATES: tuple[tuple[EventKind, EventKind | None], ...] = (
    (EventKind.ERROR_STATE, None),
    (EventKind.STOP, EventKind.GO_ON),
    (EventKind.CONTACT, None),
    (EventKind.CATCH_UP, EventKind.CAUGHT_UP),
)
"""States of a robot: the kind that tells its begin, and the one that tells its end."""
SOLID = "a wall or an obstacle"
"""What is called so that is no robot."""


class RobotEvent(NamedTuple):
    """Something that happened to a robot."""

    time: float
    """s"""
    robot: int
    """From 0; of a collision the one that drove into the other, or if both did the one with the lower number."""
    place: tuple[float, float]
    """m in the ground frame."""
    kind: EventKind
    other: int | None = None
    """Of a collision: the other robot, or None for a wall or an obstacle."""

    def text(self, roles: Sequence[str]) -> str:
        """Return the event as a sentence, for robots that are called ``roles``."""
        sentence = f"{roles[self.robot]} {_SENTENCES[self.kind]}"
        if self.kind is not EventKind.COLLISION:
            return sentence
        return f"{sentence} {SOLID if self.other is None else roles[self.other]}"


def numbered(n: int) -> tuple[str, ...]:
    """Return R1, R2, …: the names of n robots that have no other ones."""
    return tuple(f"R{i + 1}" for i in range(n))


class StateChanges:
    """Tells when robots come into the `STATES` and leave them.

    Parameters
    ----------
    robots
        Numbers of the m robots.
    """

    def __init__(self, robots: NDArray[np.intp]) -> None:
        self._robots = robots
        self._last = np.zeros((len(STATES), len(robots)), dtype=bool)

    def events(self, time: float, poses: Array, states: Sequence[NDArray[np.bool_]]) -> list[RobotEvent]:
        """Return what has changed since the last call.

        Parameters
        ----------
        time
            s
        poses
            ``(m, 3)`` of the robots, m and rad.
        states
            Which robots are in each of the `STATES` now, ``(m,)`` each.
        """
        now = np.stack(list(states))
        out = []
        for state, k in np.argwhere(now != self._last):
            if kind := STATES[state][int(not now[state, k])]:
                x, y = poses[k, :2].tolist()
                out.append(RobotEvent(time, int(self._robots[k]), (x, y), kind))
        self._last = now
        return out
