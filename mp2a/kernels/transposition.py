"""Tables of samples, turned in registers between rows of a sample and vectors of a column.

Only building the kernels imports this module.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from mp2a.kernels.lanes import Real
from mp2a.kernels.symbols import INDEX, read, read_rows, splat, transpose, write, write_rows


def gather(real: Real, columns: int) -> Any:
    """``gather(pointer, stride, first, last)``: rows ``first … first + lanes - 1`` of a table, a vector a column.

    Rows behind ``last`` are read as ``last``.
    """
    lanes, vector = real.lanes, real.vector

    @intrinsic
    def gather(context: Any, pointer: Any, stride: Any, first: Any, last: Any) -> Any:
        result = types.UniTuple(vector, columns)

        def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
            starts = _row_starts(builder, lanes, *arguments)
            return context.make_tuple(builder, result, read_rows(builder, starts, columns))

        return result(pointer, types.int64, types.int64, types.int64), emit

    return gather


def scatter(real: Real) -> Any:
    """``scatter(pointer, stride, first, last, vectors)``: `gather` the other way."""
    lanes = real.lanes

    @intrinsic
    def scatter(context: Any, pointer: Any, stride: Any, first: Any, last: Any, vectors: Any) -> Any:
        def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
            starts = _row_starts(builder, lanes, *arguments[:4])
            write_rows(builder, cgutils.unpack_tuple(builder, arguments[4]), starts)
            return context.get_dummy_value()

        return types.void(pointer, *[types.int64] * 3, vectors), emit

    return scatter


def transpose_in(real: Real) -> Any:
    """``transpose_in(table, stride, first, last, column, columns, target, place)``: a square of a table, transposed.

    From ``column`` on, of at most ``columns`` columns; rows as in `gather`. A vector for each column goes to
    ``target`` from ``place`` on.
    """
    lanes = real.lanes

    @intrinsic
    def transpose_in(
        context: Any, table: Any, stride: Any, first: Any, last: Any, column: Any, columns: Any, target: Any,
        place: Any,
    ) -> Any:  # fmt: skip
        def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
            table, stride, first, last, column, columns, target, place = arguments
            starts = _row_starts(builder, lanes, builder.gep(table, [column]), stride, first, last)

            def take(mask: Any | None) -> None:
                rows = [_read_some(builder, start, lanes, mask) for start in starts]
                begin = builder.gep(target, [place])
                for k, value in enumerate(transpose(builder, rows, reading=True)):
                    write(builder, value, begin, k * lanes)

            _whole_or_masked(builder, lanes, column, columns, take)
            return context.get_dummy_value()

        return types.void(table, *[types.int64] * 5, target, types.int64), emit

    return transpose_in


def transpose_out(real: Real) -> Any:
    """``transpose_out(table, stride, first, last, column, columns, source, place)``: `transpose_in` the other way."""
    lanes = real.lanes

    @intrinsic
    def transpose_out(
        context: Any, table: Any, stride: Any, first: Any, last: Any, column: Any, columns: Any, source: Any,
        place: Any,
    ) -> Any:  # fmt: skip
        def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
            table, stride, first, last, column, columns, source, place = arguments
            starts = _row_starts(builder, lanes, builder.gep(table, [column]), stride, first, last)

            def give(mask: Any | None) -> None:
                begin = builder.gep(source, [place])
                values = [read(builder, begin, k * lanes, lanes) for k in range(lanes)]
                for start, row in zip(starts, transpose(builder, values, reading=False), strict=True):
                    _write_some(builder, row, start, mask)

            _whole_or_masked(builder, lanes, column, columns, give)
            return context.get_dummy_value()

        return types.void(table, *[types.int64] * 5, source, types.int64), emit

    return transpose_out


def _row_starts(builder: Any, lanes: int, pointer: Any, stride: Any, first: Any, last: Any) -> list[Any]:
    starts = []
    for lane in range(lanes):
        row = builder.add(first, ir.Constant(INDEX, lane))
        row = builder.select(builder.icmp_signed("<", row, last), row, last)
        starts.append(builder.gep(pointer, [builder.mul(row, stride)]))
    return starts


def _whole_or_masked(builder: Any, lanes: int, column: Any, columns: Any, work: Callable[[Any | None], None]) -> None:
    """Do the work for whole vectors where so many columns are left, else for the lanes of the columns there are."""
    left = builder.sub(columns, column)
    with builder.if_else(builder.icmp_signed(">=", left, ir.Constant(INDEX, lanes)), likely=True) as (whole, part):
        with whole:
            work(None)
        with part:
            kind = ir.VectorType(INDEX, lanes)
            work(builder.icmp_signed("<", ir.Constant(kind, list(range(lanes))), splat(builder, left, kind)))


def _read_some(builder: Any, start: Any, lanes: int, mask: Any | None) -> Any:
    if mask is None:
        return read(builder, start, 0, lanes)
    kind = ir.VectorType(start.type.pointee, lanes)
    place = builder.bitcast(start, kind.as_pointer())
    form = ir.FunctionType(kind, [place.type, ir.IntType(32), mask.type, kind])
    name = f"llvm.masked.load.{_suffix(kind)}.p0"
    function = cgutils.get_or_insert_function(builder.module, form, name)
    return builder.call(function, [place, ir.Constant(ir.IntType(32), 1), mask, ir.Constant(kind, None)])


def _write_some(builder: Any, value: Any, start: Any, mask: Any | None) -> None:
    if mask is None:
        write(builder, value, start, 0)
        return
    place = builder.bitcast(start, value.type.as_pointer())
    form = ir.FunctionType(ir.VoidType(), [value.type, place.type, ir.IntType(32), mask.type])
    name = f"llvm.masked.store.{_suffix(value.type)}.p0"
    function = cgutils.get_or_insert_function(builder.module, form, name)
    builder.call(function, [value, place, ir.Constant(ir.IntType(32), 1), mask])


def _suffix(kind: Any) -> str:
    return f"v{kind.count}f{64 if kind.element == ir.DoubleType() else 32}"
