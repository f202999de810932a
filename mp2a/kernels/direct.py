"""Kernels as functions of Python's that take one sample, for callers to whom a microsecond matters.

A plan has all that a kernel needs for a model. `mp2a.kernels.direct_call`, which the interpreter calls as it calls
functions of its own, looks at the arrays and runs the kernel. It does not give up the interpreter's lock, so the
memory of a plan serves one call at a time.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a import kernels
from mp2a.joint_kinematics import BaseMotion
from mp2a.kernels.batch import TABLES, pack_base
from mp2a.kernels.model_cache import ModelCache
from mp2a.kernels.tables import AT, SCALAR, KernelJob, ModelTables
from mp2a.model import Model
from mp2a.spatial import Array

CODE, JOB, SCRATCH, VERDICT_PLACE, VERDICT, ARRAY_TYPE, ANSWER, ARRAYS, FIRST = *range(7), 9, 10
"""Numbers of a plan: addresses of the kernel's code, of its job, scratch memory and verdict; the verdict; the
addresses of the type of arrays and of the three answers; how many arrays there are, and where the first one's record
begins."""

PLACE, SOURCE, SIZE, FLAGS, FORM = range(5)
"""Numbers of a record: the place in the job that an input goes to; where a result comes from, else 0; how many numbers
it has; flags that the array must have; and its form, as `mp2a.kernels.replay` describes it for a read."""

RECORD = 10

_WRITEABLE = 0x0400
"""numpy's flag."""

_METH_FASTCALL = 0x0080

_MOST_BODIES = 4000
"""More take some tenths of a millisecond, in which other threads should have the interpreter; and what a call takes
beside is then little."""

DirectCall = Callable[..., bool | None]
"""``f(*results, *inputs)``: True if it did it; False if a number is not as it should be; None if it does not take such
arrays. In both cases the results are as before."""


class Operand(NamedTuple):
    """An array of a call."""

    shape: tuple[int, ...]
    place: int = 0
    """Of an input: the place in the job."""
    source: Array | None = None
    """Of a result: where the kernel puts it."""


def direct(
    kernel: str, model: Model, tables: ModelTables, ends: tuple[int, int, int, int], results: tuple[int, ...],
    operands: Sequence[Operand], held: object = None,
) -> DirectCall | None:  # fmt: skip
    """Make a function of a kernel; None if there are no compiled kernels, or too many bodies.

    Parameters
    ----------
    kernel
        Its name.
    model, tables
        n bodies, and the kernel's tables of them.
    ends, results
        Numbers of the `mp2a.kernels.tables.KernelJob` from ``base`` to ``tip_stride`` and from ``torque`` on.
    operands
        Arrays that the function takes, results first.
    held
        What else has to live as long as the function does.
    """
    run, entry = kernels.compiled(kernel), kernels.compiled("direct_call")
    if run is None or entry is None or not is_usual() or len(model) > _MOST_BODIES:
        return None
    at, scratch = kernels.pointer, np.empty(tables.scratch)
    constants = at(tables.body_constants), at(tables.frame_constants), at(tables.topology)
    # Columns that a kernel has no use for are looked up all the same.
    columns = (at(scratch), 1) * 3
    sizes = len(model), 1, model.nq, model.nv, 1
    job = KernelJob._make((*sizes, *constants, *ends, 0, 0, 0, *columns, *results))
    numbers: NDArray[np.int64] = np.array(job, dtype=np.int64)
    plan: NDArray[np.int64] = np.zeros(FIRST + RECORD * len(operands), dtype=np.int64)
    plan[CODE], plan[JOB], plan[SCRATCH] = kernels.address(run), numbers.ctypes.data, scratch.ctypes.data
    plan[VERDICT_PLACE] = plan.ctypes.data + 8 * VERDICT
    plan[ARRAY_TYPE], plan[ARRAYS] = id(np.ndarray), len(operands)
    plan[ANSWER:ARRAYS] = id(True), id(False), id(None)
    for record, operand in zip(plan[FIRST:].reshape(-1, RECORD), operands, strict=True):
        record[PLACE], record[SIZE] = operand.place, np.prod(operand.shape)
        if operand.source is not None:
            record[SOURCE], record[FLAGS] = operand.source.ctypes.data, _WRITEABLE
        form = kernels.number_type(np.dtype(np.float64)), len(operand.shape), 0, *operand.shape
        record[FORM : FORM + len(form)] = form
    call: DirectCall = bound("direct_call", plan, (numbers, scratch, tables, operands, held))
    return call


def bound(entry: str, plan: NDArray[np.int64], held: object) -> Any:
    """Make a function of compiled code that the interpreter calls with a plan's numbers and what the function is given.

    Parameters
    ----------
    entry
        Kernel with the arguments of a ``METH_FASTCALL`` function.
    plan
        Its numbers.
    held
        What else has to live as long as the function does.
    """
    owner = plan.view(_Plan)
    owner.held = held
    return _new_function()(ctypes.addressof(_method(entry)), owner, None)


def _direct_rnea(model: Model) -> DirectCall | None:
    if model.armature.any() or model.has_joint_forces:  # of which the kernel does not know
        return None
    at, torque, root = kernels.pointer, np.empty(model.nv), np.empty(6)
    base, tip = pack_base(BaseMotion.at_rest(model.gravity)), np.zeros(6)
    tables = TABLES.get(model, SCALAR, False)
    ends, results = (at(base), 0, at(tip), 0), (at(torque), 1, 0, 1, at(root), 0)
    operands = (
        Operand((model.nv,), source=torque),
        Operand((model.nq,), AT.q),
        Operand((model.nv,), AT.v),
        Operand((model.nv,), AT.a),
    )
    return direct("rnea_scalar", model, tables, ends, results, operands, (base, tip, root))


def _direct_aba(model: Model) -> DirectCall | None:
    if model.has_joint_forces:
        return None
    at, acceleration, base = kernels.pointer, np.empty(model.nv), pack_base(BaseMotion.at_rest(model.gravity))
    tables = TABLES.get(model, SCALAR, False, True)
    ends, results = (at(base), 0, 0, 0), (at(acceleration), 1, 0, 0, 0, 0)
    operands = (
        Operand((model.nv,), source=acceleration),
        Operand((model.nq,), AT.q),
        Operand((model.nv,), AT.v),
        Operand((model.nv,), AT.a),
    )
    return direct("aba_scalar", model, tables, ends, results, operands, base)


def _direct_placements(model: Model) -> DirectCall | None:
    at, rotation, translation = kernels.pointer, np.empty((len(model), 3, 3)), np.empty((len(model), 3))
    tables = TABLES.get(model, SCALAR, True)
    results = 0, 0, at(rotation), 0, at(translation), 0
    operands = (
        Operand(rotation.shape, source=rotation),
        Operand(translation.shape, source=translation),
        Operand((model.nq,), AT.q),
    )
    return direct("placements_scalar", model, tables, (0, 0, 0, 0), results, operands)


RNEA, ABA, PLACEMENTS = ModelCache(_direct_rnea), ModelCache(_direct_aba), ModelCache(_direct_placements)
"""``f(torque, q, v, a)`` and ``f(acceleration, q, v, torque)`` of models, in their own gravity, and
``f(rotation, translation, q)``."""


class _Plan(np.ndarray):
    """A plan and what has to live as long as it."""

    held: object


class _Method(ctypes.Structure):
    """``PyMethodDef``."""

    _fields_ = (
        ("name", ctypes.c_char_p), ("code", ctypes.c_void_p), ("flags", ctypes.c_int), ("description", ctypes.c_char_p),
    )  # fmt: skip


@cache
def _method(entry: str) -> _Method:
    code = kernels.compiled(entry)
    assert code is not None
    return _Method(entry.encode(), kernels.address(code), _METH_FASTCALL, None)


@cache
def _new_function() -> Any:
    """Return ``PyCFunction_NewEx``, which makes a function of compiled code and what it is bound to."""
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.argtypes, make.restype = [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p], ctypes.py_object
    return make


@cache
def is_usual() -> bool:
    """Tell whether this interpreter has objects of the usual form, and the lock that plans rely on."""
    has_lock = getattr(sys, "_is_gil_enabled", lambda: True)()
    return has_lock and object.__basicsize__ == 2 * ctypes.sizeof(ctypes.c_void_p) == 16 and sys.byteorder == "little"
