"""Where frames are in each other: the newest transform of each, put together along the tree; for who has no tf2.

Between two transforms nothing is interpolated: each link of a chain is taken as it was last heard.
"""

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from mp2a.spatial import Array, quaternion_matrix

_NOT_A_ROTATION = 0.01
"""By which the length of a quaternion may differ from 1; as tf2 has it, for its square."""


class FrameTransform(NamedTuple):
    """A frame as seen from another one."""

    rotation: Array
    """``(3, 3)``: takes vectors of the frame into the other one."""
    translation: Array
    """``(3,)`` m: its origin in the other one."""
    age: float
    """s since the oldest link was true; 0 if none of them moves."""

    @property
    def pose(self) -> Array:
        """The frame's place in the plane, ``(3,)`` m, m, rad."""
        return np.array([*self.translation[:2], math.atan2(self.rotation[1, 0], self.rotation[0, 0])])

    def apply(self, points: Array) -> Array:
        """Return the points ``(k, 3)`` m of the frame in the other one."""
        out: Array = points @ self.rotation.T + self.translation
        return out


class _Link(NamedTuple):
    parent: str
    rotation: Array
    translation: Array
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

    def put(self, message: Any, fixed: bool = False) -> None:
        """Take in a ``geometry_msgs/TransformStamped``; one that is fixed never ages.

        What is not a translation and a rotation is left out, and so is what is older than the newest of these frames. A
        stamp in the future counts as the time at which it came, or a clock gone wrong would keep a lost robot driving.
        """
        moved, turned = message.transform.translation, message.transform.rotation
        translation, sides = np.array([moved.x, moved.y, moved.z]), np.array([turned.x, turned.y, turned.z, turned.w])
        length = np.linalg.norm(sides)
        if not (np.isfinite(translation).all() and abs(length - 1) < _NOT_A_ROTATION):
            return
        late = max(0.0, self._clock() - _seconds(message.header.stamp))
        true_at = math.inf if fixed else self._steady() - late
        child, parent = _name(message.child_frame_id), _name(message.header.frame_id)
        known = self._links.get(child)
        if known is not None and known.parent == parent and true_at < known.true_at < math.inf:
            return
        self._links[child] = _Link(parent, np.reshape(quaternion_matrix(*sides / length), (3, 3)), translation, true_at)

    def look_up(self, into: str, frame: str) -> FrameTransform | None:
        """Return a frame as seen from the frame ``into``; None if no chain leads from one to the other."""
        there, back = self._up(_name(frame)), self._up(_name(into))
        shared = next((name for name in there if name in back), None)
        if shared is None:
            return None
        of_frame, of_base = there[shared], back[shared]
        oldest = min(of_frame.true_at, of_base.true_at)
        age = 0.0 if math.isinf(oldest) else self._steady() - oldest
        inverse = of_base.rotation.T
        translation = inverse @ (of_frame.translation - of_base.translation)
        return FrameTransform(inverse @ of_frame.rotation, translation, age)

    def known(self) -> str:
        """Return which transforms there are, as text."""
        return ", ".join(f"{link.parent} to {child}" for child, link in self._links.items()) or "none"

    def _up(self, frame: str) -> dict[str, _Link]:
        """Return a frame in itself and in each of its parents, nearest first."""
        link = _Link(frame, np.eye(3), np.zeros(3), math.inf)
        out = {frame: link}
        while (up := self._links.get(link.parent)) is not None and up.parent not in out:
            link = _Link(
                up.parent, up.rotation @ link.rotation, up.rotation @ link.translation + up.translation,
                min(link.true_at, up.true_at),
            )  # fmt: skip
            out[link.parent] = link
        return out


def heading(q: Any) -> float:
    """Return the angle about the vertical, rad, of a body whose rotation is the ``geometry_msgs/Quaternion`` ``q``."""
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))


def _seconds(stamp: Any) -> float:
    """Return a stamp in s; ROS 1 and ROS 2 call its parts differently."""
    if hasattr(stamp, "secs"):
        return float(stamp.secs + stamp.nsecs * 1e-9)
    return float(stamp.sec + stamp.nanosec * 1e-9)


def _name(frame: str) -> str:
    """Return a frame's name without the slash that ROS 1 wrote before some."""
    return frame.lstrip("/")
