"""Formulas as machine code for eight samples at once.

LLVM turns plain loops into vector instructions or not by a hair. Here a formula, a plain Python function of numbers, is
run once with symbols (`Symbol`) that write down each operation for LLVM, as one of a vector with a sample in each of
its eight lanes: that always becomes vector instructions (one AVX-512 instruction, two of AVX, four of SSE2 or NEON).
The same formula with doubles instead of vectors is for the last samples that do not fill a vector. Samples lie in
memory one after the other, so eight of them are transposed in registers, on the way in and on the way out.

Only building the kernels imports this module.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

LANES = 8

Numbers = tuple[Any, ...]
"""Numbers of a formula: symbols."""

Formula = Callable[..., Numbers]
"""Takes the numbers of one sample of each input and returns those of the result."""

_DOUBLE = ir.DoubleType()
_VECTOR = ir.VectorType(_DOUBLE, LANES)
_INDEX = ir.IntType(64)
_LANE = ir.IntType(32)

# A product and a sum may become one fused instruction. Nothing else of fast mathematics: "nnan" would allow anything
# for a sample that is not a number, and nothing here would gain by the rest.
_FLAGS = ("contract",)


class Symbol:
    """A number of a formula (a double, or a vector of one for each lane), which notes down what is done with it."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: Any) -> None:
        self.builder, self.value = builder, value

    def __add__(self, other: Symbol) -> Symbol:
        return Symbol(self.builder, self.builder.fadd(self.value, other.value, flags=_FLAGS))

    def __sub__(self, other: Symbol) -> Symbol:
        return Symbol(self.builder, self.builder.fsub(self.value, other.value, flags=_FLAGS))

    def __mul__(self, other: Symbol) -> Symbol:
        return Symbol(self.builder, self.builder.fmul(self.value, other.value, flags=_FLAGS))

    def __rmul__(self, number: float) -> Symbol:
        kind = self.value.type
        constant = ir.Constant(kind, [number] * LANES if kind == _VECTOR else number)
        return Symbol(self.builder, self.builder.fmul(constant, self.value, flags=_FLAGS))

    def __neg__(self) -> Symbol:
        return Symbol(self.builder, self.builder.fneg(self.value))


def _pieces(columns: int) -> Iterator[tuple[int, int]]:
    """Cut a row of numbers into loads of 8, 4, 2 and 1, so that none reads beyond the row: first column and width."""
    first = 0
    for width in (LANES, 4, 2, 1):
        while columns - first >= width:
            yield first, width
            first += width


def _address(builder: ir.IRBuilder, start: Any, place: int, width: int) -> Any:
    """Address of ``width`` numbers, typed as a vector."""
    pointer = builder.gep(start, [ir.Constant(_INDEX, place)])
    return builder.bitcast(pointer, ir.VectorType(_DOUBLE, width).as_pointer())


def _resize(builder: ir.IRBuilder, value: Any, width: int) -> Any:
    """Drop lanes, or append undefined ones."""
    have = value.type.count
    if have == width:
        return value
    lanes = [lane if lane < have else have for lane in range(width)]  # a lane of the second, undefined vector
    mask = ir.Constant(ir.VectorType(_LANE, width), lanes)
    return builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), mask)


def _transpose(builder: ir.IRBuilder, rows: Sequence[Any], stages: Sequence[int]) -> list[Any]:
    """Transpose 8x8 numbers in registers by swapping blocks of 4, 2 and 1, in the order of ``stages``.

    With few columns the order matters for how much of the work LLVM can drop: largest blocks first when reading,
    last when writing.
    """
    table = list(rows)
    for stage in stages:
        first = [lane if not lane & stage else LANES + (lane ^ stage) for lane in range(LANES)]
        second = [lane | stage if not lane & stage else LANES + lane for lane in range(LANES)]
        masks = [ir.Constant(ir.VectorType(_LANE, LANES), lanes) for lanes in (first, second)]
        for i in range(LANES):
            if not i & stage:
                pair = table[i], table[i | stage]
                table[i], table[i | stage] = (builder.shuffle_vector(*pair, mask) for mask in masks)
    return table


def _load_block(builder: ir.IRBuilder, start: Any, columns: int) -> Numbers:
    """Read eight rows, as one vector for each column."""
    out: list[Any] = []
    for first, width in _pieces(columns):
        rows = []
        for lane in range(LANES):
            read = builder.load(_address(builder, start, lane * columns + first, width))
            read.align = 1  # numpy promises nothing of where an array starts, and processors take it as it comes
            rows.append(_resize(builder, read, LANES))
        out += _transpose(builder, rows, (4, 2, 1))[:width]
    return tuple(Symbol(builder, value) for value in out)


def _store_block(builder: ir.IRBuilder, start: Any, values: Numbers) -> None:
    """Write eight rows, given as one vector for each column."""
    undefined = ir.Constant(_VECTOR, ir.Undefined)
    for first, width in _pieces(len(values)):
        columns = [value.value for value in values[first : first + width]]
        rows = _transpose(builder, columns + [undefined] * (LANES - width), (1, 2, 4))
        for lane in range(LANES):
            target = _address(builder, start, lane * len(values) + first, width)
            builder.store(_resize(builder, rows[lane], width), target).align = 1


def _load_row(builder: ir.IRBuilder, start: Any, columns: int) -> Numbers:
    reads = [builder.load(builder.gep(start, [ir.Constant(_INDEX, i)])) for i in range(columns)]
    for read in reads:
        read.align = 1
    return tuple(Symbol(builder, read) for read in reads)


def _store_row(builder: ir.IRBuilder, start: Any, values: Numbers) -> None:
    for i, value in enumerate(values):
        builder.store(value.value, builder.gep(start, [ir.Constant(_INDEX, i)])).align = 1


def samplewise(formula: Formula, columns: Sequence[int], *, block: bool) -> Any:
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
                start = builder.mul(first, ir.Constant(_INDEX, count))
                samples.append(load(builder, builder.gep(builder.extract_value(sources, i), [start]), count))
            result = formula(*samples)
            store(builder, builder.gep(target, [builder.mul(first, ir.Constant(_INDEX, len(result)))]), result)
            return context.get_dummy_value()

        return types.void(out, inputs, types.int64), emit

    return call
