"""Robots out of recordings."""

from mp2a.exceptions import InputError
from mp2a.robots.adapters import Made, Order
from mp2a.robots.records.recorded import RecordedPace, RecordedRobot, report


def make(order: Order) -> Made:
    """Open the recordings of this process' robots."""
    found = order.found
    if found.recording is None:
        raise InputError("recording: got none, expected --recording PATH, or recording = in the robots file")
    robots = [RecordedRobot(role, found.recording, found.interfaces[role], found.begin) for role in order.roles]
    return Made(
        robots,
        RecordedPace(order.period, robots),
        epochs=[robot.epoch for robot in robots],
        report=lambda good: [line for robot in robots for line in report(robot, good)],
    )
