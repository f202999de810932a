"""The rounds of one rank, step after step, without the interpreter between them.

`mp2a.program.compiled` makes the steps. Whatever lies outside comes as an address, MPI's two functions, the other
kernels and the system's ``sched_yield``; requests and statuses are memory that only MPI reads. So the compiled code
refers to nothing, and one file serves any MPI. Only building the kernels imports this module.
"""

from typing import Any

from mp2a.kernels import STEPS
from mp2a.kernels.primitives import call, call_int, compiled, doubles_at, int_at, int_slot, integers_at

FIRST, STARTALL, TESTALL, STATUSES, LOOKS, YIELDS = range(6)
"""Numbers of a program: the addresses of its steps, of MPI's functions and of memory for statuses; how often to look
for messages before giving up; whether to leave the processor to others between looks."""

WHAT, COUNT, ARRAYS, STEP = 0, 1, 2, 6
"""Numbers of a step: what to do, for how many samples, and the addresses of four arrays, the result and the inputs; of
a start and an await the requests and how many there are."""

START, AWAIT, ADD = (STEPS.index(step) for step in ("start", "await", "add"))
"""Steps that are no kernels."""


@compiled
def _start(program: Any, step: Any) -> Any:
    return call_int(program[STARTALL], step[COUNT], (step[ARRAYS],))


@compiled
def _await(program: Any, step: Any, yield_: Any) -> Any:
    """Look for messages; returns MPI's error, or -1 if they are not there after so many looks."""
    flag = int_slot()
    for look in range(program[LOOKS]):
        if look and program[YIELDS]:
            call_int(yield_, 0, ())
        error = call_int(program[TESTALL], step[COUNT], (step[ARRAYS], flag, program[STATUSES]))
        if error:
            return error
        if int_at(flag):
            return 0
    return -1


@compiled
def _add(step: Any) -> None:
    out, a, b = doubles_at(step[ARRAYS]), doubles_at(step[ARRAYS + 1]), doubles_at(step[ARRAYS + 2])
    for i in range(step[COUNT]):
        out[i] = a[i] + b[i]


def replay(outside_at: Any, program_at: Any, first: Any, last: Any) -> Any:
    """Do the steps from ``first`` on.

    ``outside_at`` is where the address of ``sched_yield`` lies, and then, for each step of `mp2a.kernels.STEPS`, the
    address of its kernel and how many inputs that takes.

    Returns ``last`` when done; the number of an await whose messages are not there; or an error code of MPI, negated.
    """
    outside, program = integers_at(outside_at), integers_at(program_at)
    kernels = integers_at(outside_at + 8)
    for at in range(first, last):
        step = integers_at(program[FIRST] + 8 * STEP * at)
        what, array = step[WHAT], program[FIRST] + 8 * (STEP * at + ARRAYS)
        error = 0
        if what == START:
            error = _start(program, step)
        elif what == AWAIT:
            error = _await(program, step, outside[0])
            if error == -1:
                return at
        elif what == ADD:
            _add(step)
        elif kernels[2 * what + 1] == 2:
            call(kernels[2 * what], (step[COUNT], array, array + 8, array + 16))
        else:
            call(kernels[2 * what], (step[COUNT], array, array + 8, array + 16, array + 24))
        if error:
            return -error
    return last
