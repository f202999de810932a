"""Waiting for a real robot to be there."""

import time

import numpy as np

from mp2a.exceptions import DependencyError
from mp2a.robots.interface import Robot


def wait_until_ready(robot: Robot, what: str, longest: float = 30.0) -> None:
    """Wait until a robot knows its pose and (if it has a LIDAR) has seen points.

    Raises
    ------
    DependencyError
        If something is missing for too long; says what.
    """
    deadline = time.monotonic() + longest
    pose = twist = points = False
    while True:
        sensed = robot.sense()
        pose, twist = bool(np.isfinite(sensed.pose).all()), bool(np.isfinite(sensed.twist).all())
        points = points or sensed.points is not None or not robot.has_lidar
        if pose and twist and points:
            return
        if time.monotonic() > deadline:
            missing = [name for name, there in (("pose", pose), ("odometry", twist), ("points", points)) if not there]
            raise DependencyError(
                f"{what}: no {' and no '.join(missing)} for {longest:g} s; are its topics right and its nodes on?"
            )
        time.sleep(0.05)
