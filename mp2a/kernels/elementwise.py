"""Formulas that take each sample by itself, eight samples at once.

Samples lie in memory one after the other, so eight of them are transposed in registers, on the way in and on the way
out. The same formula with single numbers instead of vectors is for the last samples that do not fill a vector.

Only building the kernels imports this module.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from mp2a.kernels.algebra import Numbers
from mp2a.kernels.symbols import INDEX, LANES, Formula, Symbol, read_rows, write_rows


def _starts(builder: ir.IRBuilder, start: Any, columns: int) -> list[Any]:
    """Addresses of eight rows that follow one another."""
    return [builder.gep(start, [ir.Constant(INDEX, lane * columns)]) for lane in range(LANES)]


def _load_block(builder: ir.IRBuilder, start: Any, columns: int) -> Numbers:
    """Read eight rows, as one vector for each column."""
    return tuple(Symbol(builder, value) for value in read_rows(builder, _starts(builder, start, columns), columns))


def _store_block(builder: ir.IRBuilder, start: Any, values: Numbers) -> None:
    """Write eight rows, given as one vector for each column."""
    write_rows(builder, [value.value for value in values], _starts(builder, start, len(values)))


def _load_row(builder: ir.IRBuilder, start: Any, columns: int) -> Numbers:
    reads = [builder.load(builder.gep(start, [ir.Constant(INDEX, i)])) for i in range(columns)]
    for read in reads:
        read.align = 1
    return tuple(Symbol(builder, read) for read in reads)


def _store_row(builder: ir.IRBuilder, start: Any, values: Numbers) -> None:
    for i, value in enumerate(values):
        builder.store(value.value, builder.gep(start, [ir.Constant(INDEX, i)])).align = 1


def elementwise(formula: Formula, columns: Sequence[int], *, block: bool) -> Any:
    """Make a formula a function that numba's compiled functions can call.

    Parameters
    ----------
    formula
        The formula.
    columns
        How many numbers a sample has, for each input.
    block
        Whether for eight samples at once, or for one.

    Returns
    -------
    numba intrinsic
        ``f(out, inputs, row)`` with a pointer to doubles, a tuple of such pointers, and the first sample. All of a
        block is read before any of it is written.
    """
    load, store = (_load_block, _store_block) if block else (_load_row, _store_row)

    @intrinsic
    def call(context: Any, out: Any, inputs: Any, row: Any) -> Any:
        def emit(context: Any, builder: ir.IRBuilder, form: Any, arguments: Sequence[Any]) -> Any:
            target, sources, first = arguments
            samples = []
            for i, count in enumerate(columns):
                start = builder.mul(first, ir.Constant(INDEX, count))
                samples.append(load(builder, builder.gep(builder.extract_value(sources, i), [start]), count))
            result = formula(*samples)
            store(builder, builder.gep(target, [builder.mul(first, ir.Constant(INDEX, len(result)))]), result)
            return context.get_dummy_value()

        return types.void(out, inputs, types.int64), emit

    return call
