"""What compiled code needs and numba does not have: atomic numbers, functions by address, and memory by address.

Only building the kernels imports this module.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from mp2a.kernels.symbols import INDEX

_INT = ir.IntType(32)

compiled = numba.njit(forceinline=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Decorator of the functions that kernels consist of. They are inlined, and cannot be called from Python, for which
numba would add a quarter to the time of a build."""


@intrinsic
def integers_at(context: Any, address: Any) -> Any:
    """``integers_at(address)``: the 64-bit integers that begin at an address."""
    result = types.CPointer(types.int64)

    def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(result))

    return result(types.int64), emit


@intrinsic
def doubles_at(context: Any, address: Any) -> Any:
    """``doubles_at(address)``: the doubles that begin at an address."""
    result = types.CPointer(types.float64)

    def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(result))

    return result(types.int64), emit


@intrinsic
def load_atomic(context: Any, numbers: Any, place: Any) -> Any:
    """``load_atomic(numbers, place)``: an integer that other threads write."""

    def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
        return builder.load_atomic(builder.gep(arguments[0], [arguments[1]]), "seq_cst", 8)

    return types.int64(numbers, types.int64), emit


@intrinsic
def store_atomic(context: Any, numbers: Any, place: Any, value: Any) -> Any:
    """``store_atomic(numbers, place, value)`` writes an integer that other threads read."""

    def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
        builder.store_atomic(arguments[2], builder.gep(arguments[0], [arguments[1]]), "seq_cst", 8)
        return context.get_dummy_value()

    return types.void(numbers, types.int64, types.int64), emit


@intrinsic
def add_atomic(context: Any, numbers: Any, place: Any, value: Any) -> Any:
    """``add_atomic(numbers, place, value)`` adds to an integer; what it was before."""

    def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
        return builder.atomic_rmw("add", builder.gep(arguments[0], [arguments[1]]), arguments[2], "seq_cst")

    return types.int64(numbers, types.int64, types.int64), emit


@intrinsic
def pause(context: Any) -> Any:
    """``pause()``: tell the processor that this thread waits for another one, where it can be told."""

    def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
        machine, nothing = platform.machine(), ir.FunctionType(ir.VoidType(), [])
        if machine in ("x86_64", "AMD64"):
            builder.call(cgutils.get_or_insert_function(builder.module, nothing, "llvm.x86.sse2.pause"), [])
        elif machine in ("aarch64", "arm64"):
            form = ir.FunctionType(ir.VoidType(), [_INT])
            hint = cgutils.get_or_insert_function(builder.module, form, "llvm.aarch64.hint")
            builder.call(hint, [ir.Constant(_INT, 1)])
        return context.get_dummy_value()

    return types.void(), emit


def prefetch(*, writing: bool) -> Any:
    """Make ``f(pointer, place)``: have the number at a place brought to where it can be read, or written, at once."""

    @intrinsic
    def bring(context: Any, pointer: Any, place: Any) -> Any:
        def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
            place = builder.gep(arguments[0], [arguments[1]])
            kinds = [place.type, _INT, _INT, _INT]
            function = ir.FunctionType(ir.VoidType(), kinds)
            bring = cgutils.get_or_insert_function(builder.module, function, "llvm.prefetch.p0")
            builder.call(bring, [place, *(ir.Constant(_INT, number) for number in (int(writing), 3, 1))])
            return context.get_dummy_value()

        return types.void(pointer, types.int64), emit

    return bring


@intrinsic
def call(context: Any, address: Any, arguments: Any) -> Any:
    """``call(address, arguments)`` calls a C function that takes 64-bit integers or pointers and returns nothing."""

    def emit(context: Any, builder: Any, form: Any, given: Sequence[Any]) -> Any:
        numbers = cgutils.unpack_tuple(builder, given[1])
        builder.call(_function(builder, given[0], ir.VoidType(), [INDEX] * len(numbers)), numbers)
        return context.get_dummy_value()

    return types.void(types.int64, arguments), emit


@intrinsic
def call_int(context: Any, address: Any, count: Any, arguments: Any) -> Any:
    """``call_int(address, count, arguments)`` calls a C function that takes an int, then pointers, and returns an int.

    An empty tuple and a count of 0 call one that takes nothing, since the int goes into a register that it ignores.
    """

    def emit(context: Any, builder: Any, form: Any, given: Sequence[Any]) -> Any:
        numbers = [builder.trunc(given[1], _INT), *cgutils.unpack_tuple(builder, given[2])]
        function = _function(builder, given[0], _INT, [number.type for number in numbers])
        return builder.sext(builder.call(function, numbers), INDEX)

    return types.int64(types.int64, types.int64, arguments), emit


@intrinsic
def int_slot(context: Any) -> Any:
    """``int_slot()``: the address of an int of this call, for C functions that write one."""

    def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
        return builder.ptrtoint(cgutils.alloca_once_value(builder, ir.Constant(_INT, 0)), INDEX)

    return types.int64(), emit


@intrinsic
def int_at(context: Any, address: Any) -> Any:
    """``int_at(address)``: the int that lies at an address."""

    def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
        return builder.sext(builder.load(builder.inttoptr(arguments[0], _INT.as_pointer())), INDEX)

    return types.int64(types.int64), emit


@intrinsic
def new_reference(context: Any, address: Any) -> Any:
    """``new_reference(address)``: the address of an object of Python's, which is counted as held once more."""

    def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
        # Objects that live for ever (Python 3.12 and later) have the count's upper bits set, and may keep them.
        place = builder.inttoptr(arguments[0], _INT.as_pointer())
        more = builder.add(builder.load(place), ir.Constant(_INT, 1))
        with builder.if_then(builder.icmp_unsigned("!=", more, ir.Constant(_INT, 0))):
            builder.store(more, place)
        return arguments[0]

    return types.int64(types.int64), emit


def _function(builder: Any, address: Any, result: Any, arguments: Sequence[Any]) -> Any:
    return builder.inttoptr(address, ir.FunctionType(result, arguments).as_pointer())
