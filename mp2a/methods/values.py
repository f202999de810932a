"""Numbers that are handed on as they are: from the first robot to all, and from each to those that hang on it."""

import numpy as np

from mp2a.program.operations import NOTHING, add
from mp2a.program.recorder import MethodRecorder, Output, Program
from mp2a.schedule import MOTION, Schedule

_MESSAGES = {MOTION: {"values": np.zeros(1)}}
"""The number of samples says how many there are."""


def record_broadcast(schedule: Schedule, rank: int, *, first: bool) -> Program:
    """Record a broadcast along `mp2a.schedule.broadcast`, which the ``first`` robots of their trees begin."""
    recorder = MethodRecorder(schedule, _MESSAGES, rank)
    own = recorder.input("values")
    values = own if first else NOTHING
    for round_ in recorder.recurrence("broadcast"):
        (came,) = recorder.exchange(round_, values=values)
        values = add(values, came)
    return recorder.program({"values": Output(values, ())})


def record_to_children(schedule: Schedule, rank: int) -> Program:
    """Record the round of `mp2a.schedule.parent_to_child`; what hangs on the base gets nothing."""
    recorder = MethodRecorder(schedule, _MESSAGES, rank)
    values, came = recorder.input("values"), NOTHING
    for round_ in recorder.recurrence("parent to child"):
        (came,) = recorder.exchange(round_, values=values)
    return recorder.program({"values": Output(came, ())})
