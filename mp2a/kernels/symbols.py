"""Formulas as vector instructions.

A formula, a plain Python function of numbers, is run once with symbols (`Symbol`) that write down each operation for
LLVM. A symbol is one number, or a vector with a sample in each of its lanes: that always becomes vector instructions
(eight doubles are one AVX-512 instruction, two of AVX, four of SSE2 or NEON), however LLVM's loop vectorizer feels.

Only building the kernels imports this module.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from llvmlite import ir

from mp2a.kernels.algebra import Zero

LANES = 8
"""Doubles of a vector."""

Formula = Callable[..., Any]
"""Takes the numbers of each input and returns those of the result."""

INDEX = ir.IntType(64)
_LANE = ir.IntType(32)

# A product and a sum may become one fused instruction. Nothing else of fast mathematics: "nnan" would allow anything
# for a sample that is not a number, and nothing here would gain by the rest.
_FLAGS = ("contract",)


class Symbol:
    """A number of a formula (one, or a vector of one for each lane), which notes down what is done with it."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: Any) -> None:
        self.builder, self.value = builder, value

    def __add__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, Zero) else self._note("fadd", other)

    def __sub__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, Zero) else self._note("fsub", other)

    def __mul__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, Zero) else self._note("fmul", other)

    def __rmul__(self, number: float) -> Symbol:
        return self._note("fmul", number)

    def __radd__(self, number: float) -> Symbol:
        return self._note("fadd", number)

    def __rsub__(self, number: float) -> Symbol:
        return self.constant(number) - self

    def __rtruediv__(self, number: float) -> Symbol:
        return self.constant(number)._note("fdiv", self)

    def __neg__(self) -> Symbol:
        return Symbol(self.builder, self.builder.fneg(self.value))

    def constant(self, number: float) -> Symbol:
        """Return a number of this symbol's kind."""
        kind = self.value.type
        return Symbol(self.builder, ir.Constant(kind, [number] * kind.count if _is_vector(kind) else number))

    def _note(self, operation: str, other: Symbol | float) -> Symbol:
        if not isinstance(other, Symbol):
            other = self.constant(other)
        a, b = self.value, other.value
        if _is_vector(a.type) and not _is_vector(b.type):
            b = splat(self.builder, b, a.type)
        elif _is_vector(b.type) and not _is_vector(a.type):
            a = splat(self.builder, a, b.type)
        return Symbol(self.builder, getattr(self.builder, operation)(a, b, flags=_FLAGS))


def _is_vector(kind: Any) -> bool:
    return isinstance(kind, ir.VectorType)


def splat(builder: ir.IRBuilder, number: Any, kind: Any) -> Any:
    """Put a number into every lane."""
    undefined = ir.Constant(kind, ir.Undefined)
    first = builder.insert_element(undefined, number, ir.Constant(_LANE, 0))
    return builder.shuffle_vector(first, undefined, ir.Constant(ir.VectorType(_LANE, kind.count), [0] * kind.count))


def pieces(columns: int, lanes: int) -> Iterator[tuple[int, int]]:
    """Cut a row of numbers into loads of 8, 4, 2 and 1, so that none reads beyond the row: first column and width."""
    first, width = 0, lanes
    while width:
        while columns - first >= width:
            yield first, width
            first += width
        width //= 2


def address(builder: ir.IRBuilder, start: Any, place: Any, width: int) -> Any:
    """Address of ``width`` numbers, typed as a vector."""
    real = start.type.pointee
    place = ir.Constant(INDEX, place) if isinstance(place, int) else place
    return builder.bitcast(builder.gep(start, [place]), ir.VectorType(real, width).as_pointer())


def read(builder: ir.IRBuilder, start: Any, place: Any, width: int) -> Any:
    """Read a vector."""
    value = builder.load(address(builder, start, place, width))
    # numpy promises nothing of where an array starts, and processors take it as it comes.
    value.align = 1
    return value


def write(builder: ir.IRBuilder, value: Any, start: Any, place: Any) -> None:
    """Write a vector."""
    builder.store(value, address(builder, start, place, value.type.count)).align = 1


def resize(builder: ir.IRBuilder, value: Any, width: int) -> Any:
    """Drop lanes, or append undefined ones."""
    have = value.type.count
    if have == width:
        return value
    lanes = [lane if lane < have else have for lane in range(width)]  # a lane of the second, undefined vector
    mask = ir.Constant(ir.VectorType(_LANE, width), lanes)
    return builder.shuffle_vector(value, ir.Constant(value.type, ir.Undefined), mask)


def transpose(builder: ir.IRBuilder, rows: Sequence[Any], *, reading: bool) -> list[Any]:
    """Transpose a square of numbers in registers by swapping ever smaller blocks, or ever larger ones.

    With few columns the order matters for how much of the work LLVM can drop: largest blocks first when reading,
    last when writing.
    """
    table, lanes = list(rows), len(rows)
    stages = [1 << k for k in range(lanes.bit_length() - 1)]
    for stage in reversed(stages) if reading else stages:
        first = [lane if not lane & stage else lanes + (lane ^ stage) for lane in range(lanes)]
        second = [lane | stage if not lane & stage else lanes + lane for lane in range(lanes)]
        masks = [ir.Constant(ir.VectorType(_LANE, lanes), order) for order in (first, second)]
        for i in range(lanes):
            if not i & stage:
                pair = table[i], table[i | stage]
                table[i], table[i | stage] = (builder.shuffle_vector(*pair, mask) for mask in masks)
    return table


def read_rows(builder: ir.IRBuilder, starts: Sequence[Any], columns: int) -> list[Any]:
    """Read rows of numbers, given by where they start, as one vector for each column."""
    lanes, out = len(starts), []
    for first, width in pieces(columns, lanes):
        rows = [resize(builder, read(builder, start, first, width), lanes) for start in starts]
        out += transpose(builder, rows, reading=True)[:width]
    return out


def write_rows(builder: ir.IRBuilder, values: Sequence[Any], starts: Sequence[Any]) -> None:
    """Write rows, given as one vector for each column."""
    lanes = len(starts)
    undefined = ir.Constant(values[0].type, ir.Undefined)
    for first, width in pieces(len(values), lanes):
        rows = transpose(builder, [*values[first : first + width]] + [undefined] * (lanes - width), reading=False)
        for row, start in zip(rows, starts, strict=True):
            write(builder, resize(builder, row, width), start, first)
