"""Transforms as they come over ``/tf``: where one frame is in another, for who has no tf2."""

from typing import Any

import numpy as np

from mp2a.robots.odometry import rotation
from mp2a.spatial import Array


class Transforms:
    """The newest transform of each frame into its parent, and when it came; nothing is interpolated."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Array, int | None]] = {}

    def put(self, transform: Any, stamp: int | None) -> None:
        """Take in a ``geometry_msgs/TransformStamped`` that came at ``stamp`` ns; None: it holds for ever."""
        moved = np.eye(4)
        shift = transform.transform.translation
        moved[:3, :3], moved[:3, 3] = rotation(transform.transform.rotation), (shift.x, shift.y, shift.z)
        self._parents[_name(transform.child_frame_id)] = _name(transform.header.frame_id), moved, stamp

    def look_up(self, into: str, frame: str, since: int) -> Array | None:
        """Matrix ``(4, 4)`` that takes points of ``frame`` into another; None if unknown or older than ``since`` ns."""
        ours, theirs = self._up(_name(frame), since), self._up(_name(into), since)
        common = next((name for name in ours if name in theirs), None)
        if common is None:
            return None
        out: Array = np.linalg.inv(theirs[common]) @ ours[common]
        return out

    def known(self) -> str:
        """Tell which there are."""
        return ", ".join(f"{parent} to {child}" for child, (parent, _, _) in self._parents.items()) or "none"

    def _up(self, frame: str, since: int) -> dict[str, Array]:
        """Matrices from a frame into itself and each one above it, nearest first."""
        out = {frame: np.eye(4)}
        while frame in self._parents:
            parent, moved, stamp = self._parents[frame]
            if parent in out or (stamp is not None and stamp < since):
                break
            out[parent] = moved @ out[frame]
            frame = parent
        return out


def _name(frame: str) -> str:
    return frame.lstrip("/")
