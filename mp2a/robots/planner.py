"""What decides where a robot drives: a choreography, seen by one of its robots."""

from typing import NamedTuple

import numpy as np

from mp2a.formation.choreography.runner import Choreography
from mp2a.robots.interface import Sensed
from mp2a.se2 import compose, inverse
from mp2a.spatial import Array


class Decision(NamedTuple):
    """What a robot is to do now."""

    command: Array
    """``(2,)`` m/s and rad/s before slip and acceleration are looked at."""
    blocked: str
    """What keeps it from driving where it should; empty if nothing does."""
    turn_held: bool
    """A point keeps it from turning where it should."""
    error: str
    """What brought it into its error state, where it stays; empty if it is not in it."""
    over: bool
    """Its leader is through with the scenario."""
    done: bool
    """There is nothing more to come: it is in its place, or in its error state, or has waited long enough."""


HELD_PATIENCE = 10.0
"""s that a robot at whose end something is in the way waits for it to go away; ours."""
_ROUNDING = 1e-9
"""s: ticks that are played back are as far apart as they were, to rounding."""
_BY_SIGNAL = "another program's stop signal"


class ChoreographyPlanner:
    """Decides for one robot of a choreography, without a word from the others: each works out the leaders by itself.

    Parameters
    ----------
    dance
        Not begun; of one robot here.
    has_lidar
        Whether points are to come; if so, their absence is an error.
    points_age
        s that points are old when they come; they are moved by what the robot has driven since.
    """

    def __init__(self, dance: Choreography, has_lidar: bool, points_age: float = 0.0) -> None:
        self.dance, self._has_lidar, self._points_age = dance, has_lidar, points_age
        [self._own] = dance.here
        self._held_since = np.inf

    def place(self) -> Array:
        """Return the pose ``(3,)`` in the ground frame that the robot is to have at present, m and rad."""
        out: Array = self.dance.slot_poses()[self._own]
        return out

    def destination(self) -> Array:
        """Return the point ``(2,)`` m of the ground frame where the robot is to be at present, on its lane."""
        out: Array = self.dance.state.expected[-1, self._own]
        return out

    def leader(self) -> Array:
        """Return the point ``(2,)`` m whose path the robot follows: its virtual leader, moved into its lane."""
        out: Array = self.dance.state.leaders.points[self._own]
        return out

    def decide(self, t: float, sensed: Sensed) -> Decision:
        """Run the choreography up to ``t`` s after the start; the pose is in the ground frame."""
        own, dance = self._own, self.dance
        points = [sensed.points] if self._has_lidar else None
        [command] = dance.step(t, sensed.pose[None], sensed.twist[None], points, [t - self._points_age])
        error, speed = dance.state.errors.cause(own), dance.state.raw_command[own, 0]
        held = bool((sensed.stop_front and speed > 0) or (sensed.stop_rear and speed < 0))
        blocked = "" if error else _BY_SIGNAL if held else self._in_the_way(speed)
        over = bool(dance.ended[own])
        if over and blocked:  # it may get free for a moment, and be held again
            self._held_since = min(self._held_since, t)
        waited = t - self._held_since > HELD_PATIENCE - _ROUNDING
        stays = bool(error) or (waited if blocked else bool(dance.settled[own]))
        return Decision(command * (not held, 1.0), blocked, bool(dance.turn_held[own]), error, over, over and stays)

    def _in_the_way(self, speed: float) -> str:
        if not self.dance.blocked[self._own]:
            return ""
        return f"something {'in front of' if speed > 0 else 'behind'} it"


def origin_of(place: Array, pose: Array) -> Array:
    """Return the pose ``(3,)`` in the ground frame of the fixed frame in which a robot at ``place`` is at ``pose``."""
    return compose(place, inverse(pose))
