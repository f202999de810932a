"""Kernels of formulas that take each sample by itself, eight samples at once.

Samples lie in memory one after the other, so eight of them are transposed in registers, on the way in and on the way
out. The same formula with single numbers instead of vectors is for the last samples that do not fill a vector.

Only building the kernels imports this module.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir

from mp2a.kernels.algebra import Numbers
from mp2a.kernels.library import Elementwise
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


def elementwise(name: str, formula: Formula, form: Elementwise) -> str:
    """Write a kernel in LLVM's language: a loop over samples, eight at once while there are so many.

    Parameters
    ----------
    name
        Of the kernel; the function is ``mp2a_<name>(count, out, *inputs)``, with the number of samples and, for each
        array of ``(count, columns)`` doubles, or of a row of constants, the address of a pointer to it. All of a block
        of samples is read before any of it is written.
    formula
        What it works out.
    form
        How many numbers its inputs have.
    """
    module = ir.Module(name=name)
    arrays = [ir.DoubleType().as_pointer().as_pointer()] * (1 + len(form.inputs) + len(form.constants))
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [INDEX, *arrays]), f"mp2a_{name}")
    builder = ir.IRBuilder(function.append_basic_block())
    count, out, *inputs = (function.args[0], *(builder.load(array) for array in function.args[1:]))
    sampled, same = inputs[: len(form.inputs)], inputs[len(form.inputs) :]
    constants = [_load_row(builder, start, columns) for start, columns in zip(same, form.constants, strict=True)]

    def step(load: Any, store: Any) -> Callable[[Any], None]:
        def work(first: Any) -> None:
            given = [
                load(builder, _row(builder, *each, first), each[1]) for each in zip(sampled, form.inputs, strict=True)
            ]
            store(builder, _row(builder, out, form.result, first), formula(*given, *constants))

        return work

    full = builder.and_(count, ir.Constant(INDEX, -LANES))
    _loop(builder, ir.Constant(INDEX, 0), full, LANES, step(_load_block, _store_block))
    _loop(builder, full, count, 1, step(_load_row, _store_row))
    builder.ret_void()
    return str(module)


def _row(builder: ir.IRBuilder, start: Any, columns: int, first: Any) -> Any:
    return builder.gep(start, [builder.mul(first, ir.Constant(INDEX, columns))])


def _loop(builder: ir.IRBuilder, first: Any, last: Any, step: int, work: Callable[[Any], None]) -> None:
    """Do some work from ``first`` to ``last``, and go on behind."""
    before, body, behind = builder.block, builder.append_basic_block(), builder.append_basic_block()
    builder.cbranch(builder.icmp_signed("<", first, last), body, behind)
    builder.position_at_end(body)
    at = builder.phi(INDEX)
    work(at)
    following = builder.add(at, ir.Constant(INDEX, step))
    at.add_incoming(first, before)
    at.add_incoming(following, builder.block)
    builder.cbranch(builder.icmp_signed("<", following, last), body, behind)
    builder.position_at_end(behind)
