"""One sample, called from Python with nothing in between: the interpreter calls compiled code.

For a chain of seven bodies the recursion takes half a microsecond, and whatever a line of Python does takes a tenth
of one. So the arrays are looked at here, as numpy lays them out (its C interface: ``PyArrayObject``).
Only building the kernels imports this module; `mp2a.kernels.direct` has what calls it.
"""

from typing import Any

# Compiled functions take plain global numbers, not attributes.
from mp2a.kernels.direct import (
    ANSWER,
    ARRAY_TYPE,
    ARRAYS,
    AXES,
    CODE,
    FIRST,
    FLAGS,
    JOB,
    NUMBER_TYPE,
    PLACE,
    RECORD,
    SCRATCH,
    SHAPE,
    SIZE,
    SOURCE,
    VERDICT,
    VERDICT_PLACE,
)
from mp2a.kernels.primitives import call, compiled, doubles_at, int_at, integers_at, new_reference

_TYPE, _DATA, _AXES, _SHAPE, _NUMBER_TYPE, _FLAGS = 1, 2, 3, 4, 7, 8
"""Fields of an array object, each in a word of eight bytes."""


@compiled
def _fits(array: Any, plan: Any, record: Any) -> Any:
    """Tell whether an object is an array of doubles of the shape in a plan's record, one number behind the other."""
    fields = integers_at(array)
    if fields[_TYPE] != plan[ARRAY_TYPE] or fields[_NUMBER_TYPE] != plan[NUMBER_TYPE]:
        return False
    if int_at(array + 8 * _AXES) != plan[record + AXES]:
        return False
    shape = integers_at(fields[_SHAPE])
    for axis in range(plan[record + AXES]):
        if shape[axis] != plan[record + SHAPE + axis]:
            return False
    return int_at(array + 8 * _FLAGS) & plan[record + FLAGS] == plan[record + FLAGS]


def direct_call(plan_array: Any, arguments_at: Any, count: Any) -> Any:
    """Run a kernel on arrays; the address of what Python gets.

    ``plan_array`` is the address of an array of the numbers that `mp2a.kernels.direct` describes, and ``arguments_at``
    that of the addresses of the arrays. A result is only written if it is valid, for it may overlap the input.
    """
    plan_at = integers_at(plan_array)[_DATA]
    plan, arguments = integers_at(plan_at), integers_at(arguments_at)
    fits = count == plan[ARRAYS]
    for k in range(plan[ARRAYS]):
        fits = fits and _fits(arguments[k], plan, FIRST + k * RECORD)
    answer = 2
    if fits:
        job = integers_at(plan[JOB])
        for k in range(plan[ARRAYS]):
            record = FIRST + k * RECORD
            if not plan[record + SOURCE]:
                job[plan[record + PLACE]] = arguments[k] + 8 * _DATA
        plan[VERDICT] = 0
        call(plan[CODE], (plan_at + 8 * JOB, 0, 1, plan_at + 8 * SCRATCH, plan_at + 8 * VERDICT_PLACE))
        answer = plan[VERDICT]
        if not answer:
            for k in range(plan[ARRAYS]):
                record = FIRST + k * RECORD
                if plan[record + SOURCE]:
                    source, target = doubles_at(plan[record + SOURCE]), doubles_at(integers_at(arguments[k])[_DATA])
                    for i in range(plan[record + SIZE]):
                        target[i] = source[i]
    return new_reference(plan[ANSWER + answer])
