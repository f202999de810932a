"""One sample, called from Python with nothing in between: the interpreter calls compiled code.

For a chain of seven bodies the recursion takes half a microsecond, and whatever a line of Python does takes a tenth
of one. So the arrays are looked at here, as numpy lays them out (its C interface: ``PyArrayObject``).
Only building the kernels imports this module; `mp2a.kernels.direct` has what calls it.
"""

from typing import Any

# Compiled functions take plain global numbers, not attributes.
from mp2a.kernels import POINTER
from mp2a.kernels.direct import (
    ANSWER,
    ARRAY_TYPE,
    ARRAYS,
    CODE,
    FIRST,
    FLAGS,
    FORM,
    JOB,
    PLACE,
    RECORD,
    SCRATCH,
    SIZE,
    SOURCE,
    VERDICT,
    VERDICT_PLACE,
)
from mp2a.kernels.primitives import call, compiled, doubles_at, int_at, integers_at, new_reference
from mp2a.kernels.replay import is_plain


@compiled
def _fits(array: Any, plan: Any, record_at: Any) -> Any:
    """Tell whether an object is an array as a plan's record wants it."""
    flags = integers_at(record_at)[FLAGS]
    return (
        integers_at(array)[1] == plan[ARRAY_TYPE]
        and is_plain(array + POINTER, integers_at(record_at + 8 * FORM), 0)
        and int_at(array + POINTER + 48) & flags == flags
    )


@compiled
def _copy_results(plan: Any, arguments: Any) -> None:
    for k in range(plan[ARRAYS]):
        record = FIRST + k * RECORD
        if plan[record + SOURCE]:
            source, target = doubles_at(plan[record + SOURCE]), doubles_at(integers_at(arguments[k] + POINTER)[0])
            for i in range(plan[record + SIZE]):
                target[i] = source[i]


def direct_call(plan_array: Any, arguments_at: Any, count: Any) -> Any:
    """Run a kernel on arrays; the address of what Python gets.

    ``plan_array`` is the address of an array of the numbers that `mp2a.kernels.direct` describes, and ``arguments_at``
    that of the addresses of the arrays. A result is only written if it is valid, for it may overlap the input.
    """
    plan_at = integers_at(plan_array + POINTER)[0]
    plan, arguments = integers_at(plan_at), integers_at(arguments_at)
    fits = count == plan[ARRAYS]
    for k in range(plan[ARRAYS]):
        fits = fits and _fits(arguments[k], plan, plan_at + 8 * (FIRST + k * RECORD))
    answer = 2
    if fits:
        job = integers_at(plan[JOB])
        for k in range(plan[ARRAYS]):
            record = FIRST + k * RECORD
            if not plan[record + SOURCE]:
                job[plan[record + PLACE]] = arguments[k] + POINTER
        plan[VERDICT] = 0
        call(plan[CODE], (plan_at + 8 * JOB, 0, 1, plan_at + 8 * SCRATCH, plan_at + 8 * VERDICT_PLACE))
        answer = plan[VERDICT]
        if not answer:
            _copy_results(plan, arguments)
    return new_reference(plan[ANSWER + answer])
