"""The rounds of one rank, step after step, without the interpreter between them.

`mp2a.program.compiled` makes the steps. Whatever lies outside comes as an address, MPI's two functions, the other
kernels and the system's ``sched_yield``; requests and statuses are memory that only MPI reads. So the compiled code
refers to nothing, and one file serves any MPI. Only building the kernels imports this module.
"""

from typing import Any

from mp2a.kernels import AXIS, PLAIN, POINTER, TYPE
from mp2a.kernels.primitives import call, call_int, compiled, doubles_at, int_at, int_slot, integers_at

FIRST, STARTALL, TESTALL, STATUSES, LOOKS, YIELDS = range(6)
"""Numbers of a program: the addresses of its steps, of MPI's functions and of memory for statuses; how often to look
for messages before giving up; whether to leave the processor to others between looks. `mp2a.kernels.AXIS`: whether
arguments have an axis of samples."""

WHAT, COUNT, ARRAYS, STEP = 0, 1, 2, 7
"""Numbers of a step: what to do, for how many samples, and the addresses of five arrays, the result and the inputs.

Of a start and an await: the requests and how many there are. Of a read: where to put so many numbers (0: nowhere),
where the address of the array object lies, what none of them may be beyond, and the form of the array: what doubles
are known by, how many axes it has besides that of samples, and the lengths of all axes. Of a check of length: where so
many samples lie, how many numbers each has, and which of them have to have length 1. Copies and sums count numbers."""

START, AWAIT, READ, CHECK_LENGTH, COPY, ADD = range(6)
"""The first of `mp2a.kernels.STEPS`, which are no kernels."""

TYPE_AT, TYPE_BITS = TYPE

SLACK = 1e-6
"""By how much the square of a length may be off 1: half of what is an error, so that Python decides near the limit."""


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
def _copy(step: Any) -> None:
    out, a = doubles_at(step[ARRAYS]), doubles_at(step[ARRAYS + 1])
    for i in range(step[COUNT]):
        out[i] = a[i]


@compiled
def _add(step: Any) -> None:
    out, a, b = doubles_at(step[ARRAYS]), doubles_at(step[ARRAYS + 1]), doubles_at(step[ARRAYS + 2])
    for i in range(step[COUNT]):
        out[i] = a[i] + b[i]


@compiled
def is_plain(array_at: Any, form: Any, axis: Any) -> Any:
    """Tell whether an array object holds contiguous doubles and has the axes it should have."""
    array, axes = integers_at(array_at), form[1] + axis
    kind = integers_at(array[5] + TYPE_AT)[0] & TYPE_BITS
    plain = kind == form[0] and int_at(array_at + 8) == axes and int_at(array_at + 48) & PLAIN == PLAIN
    if plain:
        lengths = integers_at(array[2])
        for k in range(axes):
            plain &= lengths[k] == form[3 - axis + k]
    return plain


@compiled
def _read(step: Any, axis: Any) -> Any:
    """Copy an array that is as it should be; returns whether all numbers are within the bound, which no NaN is."""
    array_at = integers_at(step[ARRAYS + 1])[0] + POINTER
    if not is_plain(array_at, integers_at(step[ARRAYS + 3]), axis):
        return False
    given = doubles_at(integers_at(array_at)[0])
    bound, good = doubles_at(step[ARRAYS + 2])[0], True
    if step[ARRAYS]:
        out = doubles_at(step[ARRAYS])
        for i in range(step[COUNT]):
            out[i] = given[i]
    for i in range(step[COUNT]):
        good &= abs(given[i]) <= bound
    return good


@compiled
def _check_length(step: Any) -> Any:
    """Return whether some numbers of each sample have length 1."""
    given, width, first, last = doubles_at(step[ARRAYS]), step[ARRAYS + 1], step[ARRAYS + 2], step[ARRAYS + 3]
    good = True
    for sample in range(step[COUNT]):
        square = 0.0
        for i in range(sample * width + first, sample * width + last):
            square += given[i] * given[i]
        good &= abs(square - 1.0) <= SLACK
    return good


def replay(outside_at: Any, program_at: Any, first: Any, last: Any) -> Any:
    """Do the steps from ``first`` on.

    ``outside_at`` is where the address of ``sched_yield`` lies, and then, for each step of `mp2a.kernels.STEPS`, the
    address of its kernel. Each is given five arrays, of which it takes as many as it has, as C's calls allow.

    Returns ``last`` when done; the number of an await whose messages are not there, or of a read or a check that
    failed; or an error code of MPI, negated.
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
        elif what == READ:
            if not _read(step, program[AXIS]):
                return at
        elif what == CHECK_LENGTH:
            if not _check_length(step):
                return at
        elif what == COPY:
            _copy(step)
        elif what == ADD:
            _add(step)
        else:
            call(kernels[what], (step[COUNT], array, array + 8, array + 16, array + 24, array + 32))
        if error:
            return -error
    return last
