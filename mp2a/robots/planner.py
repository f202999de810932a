"""What decides where a robot drives: a choreography, seen by one of its robots."""

from typing import NamedTuple, Protocol

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
    blocked: bool
    """A stop signal keeps it from driving where it should."""
    turn_held: bool
    """A point keeps it from turning where it should."""
    error: bool
    """It is in its error state, for good."""
    done: bool
    """There is nothing more to come."""


class Planner(Protocol):
    """Decides for one robot."""

    def place(self) -> Array:
        """Pose ``(3,)`` in the planner's ground frame that the robot is to have at present."""

    def leader(self) -> Array:
        """Point ``(2,)`` in the planner's ground frame whose path the robot is to follow."""

    def decide(self, t: float, sensed: Sensed) -> Decision:
        """Decide at ``t`` s after the start; the pose is in the planner's ground frame."""


class ChoreographyPlanner:
    """One robot of a choreography. It needs no message of the others: each works out the virtual leaders by itself.

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
        n = len(dance.robots)
        # Of the others nothing is known here, so here they are lost; their own processes know better.
        self._poses, self._twists = np.tile(NO_POSE, (n, 1)), np.zeros((n, 2))
        self._points: list[Array | None] = [None] * n

    def place(self) -> Array:
        """Where the choreography has the robot at present."""
        out: Array = self.dance.slot_poses()[self._own]
        return out

    def leader(self) -> Array:
        """Where the robot's own leader is: the virtual leader, moved sideways into the robot's lane."""
        out: Array = self.dance.state.leaders.points[self._own]
        return out

    def decide(self, t: float, sensed: Sensed) -> Decision:
        """Run the choreography up to now."""
        own = self._own
        self._poses[own] = sensed.pose
        self._twists[own] = sensed.twist
        self._points[own] = self._now(t, sensed)
        commands = self.dance.step(t, self._poses, self._twists, self._points if self._has_lidar else None)
        error = bool(self.dance.state.errors.failed[own])
        wanted = self.dance.state.raw_command[own, 0]
        held = bool((sensed.stop_front and wanted > 0) or (sensed.stop_rear and wanted < 0))
        done = self.dance.done or (held and bool(self.dance.ended.all()))
        blocked = (held or bool(self.dance.blocked[own])) and not error
        turn_held = bool(self.dance.turn_held[own])
        return Decision(commands[own] * (not held, 1.0), blocked, turn_held, error, done)

    def _now(self, t: float, sensed: Sensed) -> Array | None:
        """Points where they are now, seen from the robot; as they came while it does not know where it is."""
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
    """Return the pose ``(3,)`` in the ground frame of a robot's fixed frame, in which it is at ``pose``, its place."""
    return compose(place, inverse(pose))
