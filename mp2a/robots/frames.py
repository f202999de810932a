"""Where frames are in each other: the newest transform of each, put together along the tree; for who has no tf2.

Between two transforms nothing is interpolated: each link of a chain is taken as it was last heard.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from mp2a.robots.odometry import Quaternion, rotation
from mp2a.spatial import Array

_NOT_A_ROTATION = 0.01
"""By which the length of a quaternion may differ from 1; as tf2 has it, for its square."""


class _Vector(Protocol):
    x: float
    y: float
    z: float


class _Stamp(Protocol):
    sec: int
    nanosec: int


class _Header(Protocol):
    stamp: _Stamp
    frame_id: str


class _Turned(Protocol):
    translation: _Vector
    rotation: Quaternion


class TransformStamped(Protocol):
    """A ``geometry_msgs/TransformStamped`` of ROS 2."""

    header: _Header
    child_frame_id: str
    transform: _Turned


class Found(NamedTuple):
    """A frame as seen from another one."""

    turn: Array
    """``(3, 3)``: takes vectors of the frame into the other one."""
    shift: Array
    """``(3,)`` m: its origin in the other one."""
    age: float
    """s since the oldest link was true; 0 if none of them moves."""

    @property
    def heading(self) -> float:
        """Angle about the vertical, rad."""
        return math.atan2(self.turn[1, 0], self.turn[0, 0])

    def apply(self, points: Array) -> Array:
        """Points ``(k, 3)`` m of the frame in the other one."""
        out: Array = points @ self.turn.T + self.shift
        return out


@dataclass
class _Unit:
    """A quaternion of length 1."""

    x: float
    y: float
    z: float
    w: float


class _Link(NamedTuple):
    parent: str
    turn: Array
    shift: Array
    true_at: float
    """s; infinite for what does not move."""


class Transforms:
    """The newest transform of each frame into its parent.

    Parameters
    ----------
    clock
        That the stamps go by, s.
    steady
        By which transforms age once they have come, s: whoever sets the clock does not make them older or younger.
    """

    def __init__(self, clock: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._steady = clock, steady
        self._links: dict[str, _Link] = {}

    def put(self, message: TransformStamped, fixed: bool = False) -> None:
        """Take in a transform; one that is fixed never ages.

        What is not a shift and a rotation is left out, and so is what is older than the newest of these frames. A stamp
        in the future counts as the time at which it came, or a clock gone wrong would keep a lost robot driving.
        """
        moved, turned = message.transform.translation, message.transform.rotation
        shift, sides = np.array([moved.x, moved.y, moved.z]), np.array([turned.x, turned.y, turned.z, turned.w])
        length = np.linalg.norm(sides)
        if not (np.isfinite(shift).all() and abs(length - 1) < _NOT_A_ROTATION):
            return
        stamp = message.header.stamp
        late = max(0.0, self._clock() - (stamp.sec + stamp.nanosec * 1e-9))
        true_at = math.inf if fixed else self._steady() - late
        child, parent = _name(message.child_frame_id), _name(message.header.frame_id)
        known = self._links.get(child)
        if known is not None and known.parent == parent and true_at < known.true_at < math.inf:
            return
        self._links[child] = _Link(parent, rotation(_Unit(*sides / length)), shift, true_at)

    def look_up(self, into: str, frame: str) -> Found | None:
        """Return a frame as seen from the frame ``into``; None if no chain leads from one to the other."""
        there, back = self._up(_name(frame)), self._up(_name(into))
        shared = next((name for name in there if name in back), None)
        if shared is None:
            return None
        turn, shift, true_at = there[shared]
        base_turn, base_shift, base_true_at = back[shared]
        oldest = min(true_at, base_true_at)
        age = 0.0 if math.isinf(oldest) else self._steady() - oldest
        return Found(base_turn.T @ turn, base_turn.T @ (shift - base_shift), age)

    def known(self) -> str:
        """Tell which there are."""
        return ", ".join(f"{link.parent} to {child}" for child, link in self._links.items()) or "none"

    def _up(self, frame: str) -> dict[str, tuple[Array, Array, float]]:
        """Turn, shift and time of a frame in itself and in each of its parents, nearest first."""
        turn, shift, true_at = np.eye(3), np.zeros(3), math.inf
        out = {frame: (turn, shift, true_at)}
        while (link := self._links.get(frame)) is not None and link.parent not in out:
            turn, shift = link.turn @ turn, link.turn @ shift + link.shift
            frame, true_at = link.parent, min(true_at, link.true_at)
            out[frame] = (turn, shift, true_at)
        return out


def _name(frame: str) -> str:
    """ROS 1 wrote a slash before some names."""
    return frame.lstrip("/")
