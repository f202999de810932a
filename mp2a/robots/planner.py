"""What decides where a robot drives: a choreography, seen by one of its robots."""

from typing import NamedTuple

import numpy as np

from mp2a.exceptions import InputError
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.pose_history import PoseHistory
from mp2a.robots.interface import NO_POSE, Sensed
from mp2a.se2 import act, act_inverse, compose, inverse
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


PATIENCE = 10.0
"""s that a robot at whose end something is in the way waits for it to go away; ours."""
_ROUNDING = 1e-9
"""s: ticks that are played back are as far apart as they were, to rounding."""
_BY_SIGNAL = "another program's stop signal"


class ChoreographyPlanner:
    """Decides for one robot of a choreography, without a word from the others: each works out the leaders by itself.

    Parameters
    ----------
    dance
        Not begun; used by this alone.
    role
        Which of its robots.
    has_lidar
        Whether points are to come; if so, their absence is an error.
    points_age
        s that points are old when they come; they are moved by what the robot has driven since.
    """

    def __init__(self, dance: Choreography, role: str, has_lidar: bool, points_age: float = 0.0) -> None:
        if role not in dance.robots:
            raise InputError(f"role: got {role!r}, expected one of {', '.join(dance.robots)}")
        self.dance, self._has_lidar, self._points_age = dance, has_lidar, points_age
        self._history = PoseHistory(1)
        self._own = dance.robots.index(role)
        self._error, self._held_since = "", np.inf
        n = len(dance.robots)
        # Of the others nothing is known here, so here they are lost; their own processes know better.
        self._poses, self._twists = np.tile(NO_POSE, (n, 1)), np.zeros((n, 2))
        self._points: list[Array | None] = [None] * n

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
        self._poses[own] = sensed.pose
        self._twists[own] = sensed.twist
        self._points[own] = self._now(t, sensed)
        commands = dance.step(t, self._poses, self._twists, self._points if self._has_lidar else None)
        state = dance.state
        if state.errors.failed[own] and not self._error:
            self._error = "its pose was lost" if state.errors.lost_poses[own] else "its LIDAR was silent"
        speed = state.raw_command[own, 0]
        held = bool((sensed.stop_front and speed > 0) or (sensed.stop_rear and speed < 0))
        blocked = "" if self._error else _BY_SIGNAL if held else self._in_the_way(speed)
        over = bool(dance.ended[own])
        if over and blocked:  # it may get free for a moment, and be held again
            self._held_since = min(self._held_since, t)
        waited = t - self._held_since > PATIENCE - _ROUNDING
        stays = bool(self._error) or (waited if blocked else bool(dance.settled[own]))
        command = commands[own] * (not held, 1.0)
        return Decision(command, blocked, bool(dance.turn_held[own]), self._error, over, over and stays)

    def _in_the_way(self, speed: float) -> str:
        if not self.dance.blocked[self._own]:
            return ""
        return f"something {'in front of' if speed > 0 else 'behind'} it"

    def _now(self, t: float, sensed: Sensed) -> Array | None:
        """Return points where they are now, seen from the robot; as they came while it does not know where it is."""
        if not np.isfinite(sensed.pose).all():
            return sensed.points
        self._history.add(t, sensed.pose[None])
        if sensed.points is None:
            return None
        then = self._history.at(np.array([t - self._points_age]))[0]
        if (then == sensed.pose).all():  # it stands: rounding shall not move points from cell to cell
            return sensed.points
        return act_inverse(sensed.pose, act(then, sensed.points))


def origin_of(place: Array, pose: Array) -> Array:
    """Return the pose ``(3,)`` in the ground frame of the fixed frame in which a robot at ``place`` is at ``pose``."""
    return compose(place, inverse(pose))
