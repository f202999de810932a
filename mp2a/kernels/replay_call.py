"""A rank's program, called from Python with nothing in between; only building the kernels imports this module."""

from typing import Any

# Compiled functions take plain global numbers, not attributes.
from mp2a.kernels import AXIS, POINTER
from mp2a.kernels.primitives import compiled, int_at, integers_at, new_reference
from mp2a.kernels.replay import replay
from mp2a.kernels.replay_plan import ANSWER, ARRAY_TYPE, AT, AXES, BEGIN, COUNT, GIVEN, LAST, OUTSIDE, PROGRAM

_replay = compiled(replay)


def replay_call(plan_array: Any, arguments_at: Any, count: Any) -> Any:
    """Do the first piece of a program with some arguments; the address of what Python gets.

    ``plan_array`` is the address of an array of the numbers of `mp2a.kernels.replay_plan`, and ``arguments_at`` that of
    the addresses of the arguments.
    """
    plan = integers_at(integers_at(plan_array + POINTER)[0])
    arguments, given, program = integers_at(arguments_at), integers_at(plan[GIVEN]), integers_at(plan[PROGRAM])
    arrays = count == plan[COUNT]
    for k in range(count if arrays else 0):
        arrays = arrays and integers_at(arguments[k])[1] == plan[ARRAY_TYPE]
        given[k] = arguments[k]
    answer = 1
    if arrays:
        program[AXIS] = int_at(arguments[0] + POINTER + 8) != plan[AXES]
        at = _replay(plan[OUTSIDE], plan[PROGRAM], 0, plan[LAST])
        plan[AT] = at
        if at == plan[LAST]:
            answer = 0
        elif at < 0 or at >= plan[BEGIN]:
            answer = 2
    return new_reference(plan[ANSWER + answer])
