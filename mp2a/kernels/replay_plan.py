"""The interpreter's way into a rank's program: a function of Python's that is compiled code.

It keeps the interpreter's lock. That is no longer than other threads wait for it anyway: where a message does not come,
compiled code gives up after some thousands of looks, and Python waits without the lock.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mp2a.kernels.direct import bound, is_usual

OUTSIDE, PROGRAM, LAST, BEGIN, GIVEN, COUNT, AXES, ARRAY_TYPE, AT, ANSWER = range(10)
"""Numbers of a plan: addresses of what lies outside and of the program, as `mp2a.kernels.replay` has them; the step to
stop before, and the first that is not about arguments; where the addresses of arguments go, and how many there are; how
many axes the first has without one of samples; the address of the type of arrays; the step it came to; and the
addresses of the three answers."""


class ReplayCall(NamedTuple):
    """The way into a program."""

    call: Callable[..., bool | None]
    """``f(*arguments)``: True if all was done; False if the arguments are not such as the program takes, and nothing
    was done; None if there is more to do from a step on."""
    at: Callable[[], int]
    """That step, or MPI's error, negated."""


def replay_call(
    outside: int, program: int, last: int, begin: int, given: int, count: int, axes: int
) -> ReplayCall | None:
    """Make the way into a program; None if this interpreter is not the usual one."""
    if not is_usual():
        return None
    numbers = outside, program, last, begin, given, count, axes, id(np.ndarray), 0, id(True), id(False), id(None)
    plan = np.array(numbers, dtype=np.int64)

    def at() -> int:
        return int(plan[AT])

    return ReplayCall(bound("replay_call", plan, None), at)
