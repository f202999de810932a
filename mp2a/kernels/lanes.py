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
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from mp2a.kernels.symbols import INDEX, Formula, Symbol, read, splat, write
from mp2a.kernels.tables import CACHE_LINE


class Vector(types.Type):
    """Type of a vector with a number in each lane."""

    def __init__(self, real: Any, lanes: int) -> None:
        self.real, self.lanes = real, lanes
        super().__init__(name=f"Vector({real}, {lanes})")


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):
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

    def there(self) -> Any:
        """``there(address)``: the pointer to numbers that lies at an address."""
        kind = self.pointer

        @intrinsic
        def there(context: Any, address: Any) -> Any:
            return _pointer_at(kind)

        return there

    def aligned(self) -> Any:
        """``aligned(pointer)``: the pointer to the first number that starts a cache line."""

        @intrinsic
        def aligned(context: Any, pointer: Any) -> Any:
            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                number = builder.add(builder.ptrtoint(arguments[0], INDEX), ir.Constant(INDEX, CACHE_LINE - 1))
                number = builder.and_(number, ir.Constant(INDEX, -CACHE_LINE))
                return builder.inttoptr(number, arguments[0].type)

            return pointer(pointer), emit

        return aligned

    def ahead(self) -> Any:
        """``ahead(pointer, count)``: the pointer to a later number."""

        @intrinsic
        def ahead(context: Any, pointer: Any, count: Any) -> Any:
            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                return builder.gep(arguments[0], [arguments[1]])

            return pointer(pointer, types.int64), emit

        return ahead

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

    def record(self, count: int, *, per_lane: bool = False) -> Any:
        """``record(pointer, place)``: tuple of ``count`` numbers; with ``per_lane`` of vectors, one for each lane's."""
        kind = self.vector if per_lane else self.kind
        lanes = self.lanes

        @intrinsic
        def record(context: Any, pointer: Any, place: Any) -> Any:
            result = types.UniTuple(kind, count)

            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                pointer, place = arguments
                if per_lane:
                    start = builder.gep(pointer, [builder.mul(place, ir.Constant(INDEX, lanes))])
                    numbers = [read(builder, start, i * lanes, lanes) for i in range(count)]
                else:
                    start = builder.gep(pointer, [place])
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
        """``take_columns(view, column)``: vectors of a column and the next ones.

        A view is (pointer, mask, step): a column is at ``(column & mask) * step``.
        """
        lanes, vector = self.lanes, self.vector

        @intrinsic
        def take(context: Any, view: Any, column: Any) -> Any:
            result = types.UniTuple(vector, count)

            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                columns = _columns(builder, count, *arguments)
                return context.make_tuple(builder, result, [read(builder, *column, lanes) for column in columns])

            return result(view, types.int64), emit

        return take

    def no_columns(self, count: int) -> Any:
        """``no_columns(view, column)``: zeros, where `take_columns` would read."""
        vector = self.vector

        @intrinsic
        def take(context: Any, view: Any, column: Any) -> Any:
            result = types.UniTuple(vector, count)

            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                return ir.Constant(context.get_value_type(result), None)

            return result(view, types.int64), emit

        return take

    def put_columns(self) -> Any:
        """``put_columns(view, column, vectors)``: `take_columns` the other way."""

        @intrinsic
        def put(context: Any, view: Any, column: Any, vectors: Any) -> Any:
            def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
                values = cgutils.unpack_tuple(builder, arguments[2])
                for value, place in zip(values, _columns(builder, len(values), *arguments[:2]), strict=True):
                    write(builder, value, *place)
                return context.get_dummy_value()

            return types.void(view, types.int64, vectors), emit

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
SCALAR = Real("scalar", types.float64, 1)


@intrinsic
def integers(context: Any, address: Any) -> Any:
    """``integers(address)``: the pointer to 64-bit integers that lies at an address."""
    return _pointer_at(types.CPointer(types.int64))


def _pointer_at(kind: Any) -> tuple[Any, Callable[..., Any]]:
    def emit(context: Any, builder: Any, form: Any, arguments: Sequence[Any]) -> Any:
        pointer = context.get_value_type(kind)
        return builder.load(builder.inttoptr(arguments[0], pointer.as_pointer()))

    return kind(types.int64), emit


def _symbols(builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, types.BaseAnonymousTuple):
        return tuple(Symbol(builder, part) for part in cgutils.unpack_tuple(builder, value))
    return Symbol(builder, value)


def _flat(made: Any) -> list[Symbol]:
    if isinstance(made, Symbol):
        return [made]
    return [symbol for part in made for symbol in _flat(part)]


def _as_vector(builder: Any, symbol: Symbol, vector: Vector, context: Any) -> Any:
    kind = context.get_value_type(vector)
    return symbol.value if symbol.value.type == kind else splat(builder, symbol.value, kind)


def _columns(builder: Any, count: int, view: Any, column: Any) -> list[tuple[Any, Any]]:
    """Pointer and place of neighbouring columns."""
    pointer, mask, step = cgutils.unpack_tuple(builder, view)
    numbers = [builder.add(column, ir.Constant(INDEX, k)) for k in range(count)]
    return [(pointer, builder.mul(builder.and_(number, mask), step)) for number in numbers]
