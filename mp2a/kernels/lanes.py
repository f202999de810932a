"""A vector type for numba: loops and branches are compiled Python, arithmetic is formulas on vectors.

numba's own vectorizer takes a loop or leaves it by a hair. A value of `Vector` is a vector by its type, and what
`Real.lift` makes of a formula is vector instructions and nothing else. Memory is given by pointers, since numba's
arrays cannot be passed by programs that do without numba.

Only building the kernels imports this module.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, models, register_model

from mp2a.kernels.symbols import INDEX, Formula, Symbol, read, read_rows, splat, transpose, write


class Vector(types.Type):  # type: ignore[misc]
    """Type of a vector with a number in each lane."""

    def __init__(self, real: Any, lanes: int) -> None:
        self.real, self.lanes = real, lanes
        super().__init__(name=f"Vector({real}, {lanes})")


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Vector) -> None:
        super().__init__(manager, kind, ir.VectorType(manager.lookup(kind.real).get_value_type(), kind.lanes))


@dataclass(frozen=True)
class Real:
    """A number format and what numba's compiled functions can do with vectors of it."""

    name: str
    kind: Any
    """numba's type."""
    lanes: int

    @property
    def vector(self) -> Vector:
        """The type of its vectors."""
        return Vector(self.kind, self.lanes)

    @property
    def pointer(self) -> Any:
        """The type of a pointer to numbers."""
        return types.CPointer(self.kind)

    def at(self) -> Any:
        """``at(address)``: pointer to numbers at an address."""
        return _pointer_to(self.pointer)

    def load(self) -> Any:
        """``load(pointer, place)``: the numbers from a place on, one for each lane."""
        lanes, vector = self.lanes, self.vector

        @intrinsic
        def load(context: Any, pointer: Any, place: Any) -> Any:
            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                return read(builder, arguments[0], arguments[1], lanes)

            return vector(pointer, types.int64), emit

        return load

    def store(self) -> Any:
        """``store(pointer, place, vector)`` writes a vector."""

        @intrinsic
        def store(context: Any, pointer: Any, place: Any, vector: Any) -> Any:
            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                write(builder, arguments[2], arguments[0], arguments[1])
                return context.get_dummy_value()

            return types.void(pointer, types.int64, vector), emit

        return store

    def record(self, count: int) -> Any:
        """``record(pointer, place)``: tuple of ``count`` numbers."""
        kind = self.kind

        @intrinsic
        def record(context: Any, pointer: Any, place: Any) -> Any:
            result = types.UniTuple(kind, count)

            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                start = builder.gep(arguments[0], [arguments[1]])
                numbers = [builder.load(builder.gep(start, [ir.Constant(INDEX, i)])) for i in range(count)]
                return context.make_tuple(builder, result, numbers)

            return result(pointer, types.int64), emit

        return record

    def vectors(self, count: int) -> Any:
        """``vectors(pointer, place)``: tuple of ``count`` vectors that lie one after the other."""
        lanes, vector = self.lanes, self.vector

        @intrinsic
        def vectors(context: Any, pointer: Any, place: Any) -> Any:
            result = types.UniTuple(vector, count)

            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                start = builder.gep(arguments[0], [arguments[1]])
                return context.make_tuple(
                    builder, result, [read(builder, start, i * lanes, lanes) for i in range(count)]
                )

            return result(pointer, types.int64), emit

        return vectors

    def put(self) -> Any:
        """``put(pointer, place, vectors)`` writes a tuple of vectors one after the other."""
        lanes = self.lanes

        @intrinsic
        def put(context: Any, pointer: Any, place: Any, vectors: Any) -> Any:
            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                start = builder.gep(arguments[0], [arguments[1]])
                for i, value in enumerate(cgutils.unpack_tuple(builder, arguments[2])):
                    write(builder, value, start, i * lanes)
                return context.get_dummy_value()

            return types.void(pointer, types.int64, vectors), emit

        return put

    def take_columns(self, count: int) -> Any:
        """``take_columns(pointer, mask, step, column)``: vectors at ``(column & mask) * step``, and of the next columns."""
        lanes, vector = self.lanes, self.vector

        @intrinsic
        def take(context: Any, pointer: Any, mask: Any, step: Any, column: Any) -> Any:
            result = types.UniTuple(vector, count)

            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                pointer, *ring = arguments
                places = [_column_place(builder, k, *ring) for k in range(count)]
                return context.make_tuple(builder, result, [read(builder, pointer, at, lanes) for at in places])

            return result(pointer, *[types.int64] * 3), emit

        return take

    def put_columns(self) -> Any:
        """``put_columns(pointer, mask, step, column, vectors)``: `take_columns` the other way."""

        @intrinsic
        def put(context: Any, pointer: Any, mask: Any, step: Any, column: Any, vectors: Any) -> Any:
            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                pointer, *ring, packed = arguments
                for k, value in enumerate(cgutils.unpack_tuple(builder, packed)):
                    write(builder, value, pointer, _column_place(builder, k, *ring))
                return context.get_dummy_value()

            return types.void(pointer, *[types.int64] * 3, vectors), emit

        return put

    def put_apart(self) -> Any:
        """``put_apart(pointer, place, step, vectors)`` writes a tuple of vectors ``step`` numbers apart."""

        @intrinsic
        def put(context: Any, pointer: Any, place: Any, step: Any, vectors: Any) -> Any:
            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                pointer, place, step, packed = arguments
                for k, value in enumerate(cgutils.unpack_tuple(builder, packed)):
                    at = builder.add(place, builder.mul(step, ir.Constant(INDEX, k)))
                    write(builder, value, pointer, at)
                return context.get_dummy_value()

            return types.void(pointer, types.int64, types.int64, vectors), emit

        return put

    def zero(self) -> Any:
        """``zero()``: a vector of zeros."""
        vector = self.vector

        @intrinsic
        def zero(context: Any) -> Any:
            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                return ir.Constant(context.get_value_type(vector), None)

            return vector(), emit

        return zero

    def is_nan(self) -> Any:
        """``is_nan(vector)``: whether any lane is not a number, 1 or 0."""

        @intrinsic
        def is_nan(context: Any, vector: Any) -> Any:
            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                lanes = builder.fcmp_unordered("uno", arguments[0], arguments[0])
                bits = builder.bitcast(lanes, ir.IntType(lanes.type.count))
                return builder.zext(builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0)), INDEX)

            return types.int64(vector), emit

        return is_nan

    def gather(self, columns: int) -> Any:
        """``gather(pointer, stride, first, last)``: rows ``first … first + lanes - 1`` of a table, a vector a column.

        Rows behind ``last`` are read as ``last``.
        """
        lanes, vector = self.lanes, self.vector

        @intrinsic
        def gather(context: Any, pointer: Any, stride: Any, first: Any, last: Any) -> Any:
            result = types.UniTuple(vector, columns)

            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                starts = _row_starts(builder, lanes, *arguments)
                return context.make_tuple(builder, result, read_rows(builder, starts, columns))

            return result(pointer, types.int64, types.int64, types.int64), emit

        return gather

    def turn_in(self) -> Any:
        """``turn_in(table, stride, first, last, column, columns, target, place)``: a square of a table, transposed.

        From ``column`` on, of at most ``columns`` columns; rows as in `gather`. A vector for each column goes to
        ``target`` from ``place`` on.
        """
        lanes = self.lanes

        @intrinsic
        def turn_in(
            context: Any, table: Any, stride: Any, first: Any, last: Any, column: Any, columns: Any, target: Any, place: Any
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

        return turn_in

    def turn_out(self) -> Any:
        """``turn_out(table, stride, first, last, column, columns, source, place)``: `turn_in` the other way."""
        lanes = self.lanes

        @intrinsic
        def turn_out(
            context: Any, table: Any, stride: Any, first: Any, last: Any, column: Any, columns: Any, source: Any, place: Any
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

        return turn_out

    def lift(self, formula: Formula, outputs: int = 1) -> Any:
        """Make a formula a function that numba's compiled functions can call, with one tuple of all its arguments.

        Parameters
        ----------
        formula
            Takes vectors, numbers, or tuples of them, and returns a symbol or a tuple of symbols.
        outputs
            How many it returns.
        """
        vector = self.vector

        @intrinsic
        def call(context: Any, inputs: Any) -> Any:
            result = vector if outputs == 1 else types.UniTuple(vector, outputs)

            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                packed = cgutils.unpack_tuple(builder, arguments[0])
                symbols = [_symbols(builder, kind, value) for kind, value in zip(inputs.types, packed, strict=True)]
                made = formula(*symbols)
                values = [_as_vector(builder, symbol, vector, context) for symbol in _flat(made)]
                assert len(values) == outputs, (formula.__name__, len(values))
                return values[0] if outputs == 1 else context.make_tuple(builder, result, values)

            return result(inputs), emit

        return call


DOUBLE = Real("double", types.float64, 8)
SINGLE = Real("single", types.float32, 16)


@intrinsic
def integers(context: Any, address: Any) -> Any:
    """Pointer to 64-bit integers at an address."""
    return _pointer_form(types.CPointer(types.int64))


def _pointer_to(kind: Any) -> Any:
    @intrinsic
    def at(context: Any, address: Any) -> Any:
        return _pointer_form(kind)

    return at


def _pointer_form(kind: Any) -> tuple[Any, Callable[..., Any]]:
    def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(kind))

    return kind(types.int64), emit


def _symbols(builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, types.BaseTuple):
        return tuple(Symbol(builder, part) for part in cgutils.unpack_tuple(builder, value))
    return Symbol(builder, value)


def _flat(made: Any) -> list[Symbol]:
    if isinstance(made, Symbol):
        return [made]
    return [symbol for part in made for symbol in _flat(part)]


def _as_vector(builder: Any, symbol: Symbol, vector: Vector, context: Any) -> Any:
    kind = context.get_value_type(vector)
    return symbol.value if symbol.value.type == kind else splat(builder, symbol.value, kind)


def _column_place(builder: Any, k: int, mask: Any, step: Any, column: Any) -> Any:
    return builder.mul(builder.and_(builder.add(column, ir.Constant(INDEX, k)), mask), step)


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
