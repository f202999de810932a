"""How many vector instructions the compiled recursion takes a body, counted in what the compiler makes of its formulas.

A formula is compiled for this processor by itself, on vectors of samples; what is counted are instructions on vectors
of `mp2a.kernels.symbols.LANES` doubles, whatever the processor's own are.
"""

import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import llvmlite.binding as llvm
from llvmlite import ir

from mp2a.kernels import steps
from mp2a.kernels.symbols import LANES, Symbol, read, transpose, write

_KINDS = {
    "fused": re.compile(r"\tvfn?m(?:add|sub)\d+[ps]d\b"),
    "products": re.compile(r"\tv?mul[ps]d\b"),
    "sums": re.compile(r"\tv?(?:add|sub)[ps]d\b"),
    "others": re.compile(r"\tv?(?:cmp|blend|perm|unpck|shuf|p?xor|p?and|psll|padd|ptern|ptest|insert|extract)\w*\b"),
}


class Count(NamedTuple):
    """Instructions on vectors of `LANES` doubles."""

    fused: float = 0.0
    """Products with a sum in one instruction."""
    products: float = 0.0
    sums: float = 0.0
    others: float = 0.0
    """Comparisons, choices, shuffles, whole numbers; not loads and stores."""

    def __add__(self, other: Any) -> "Count":
        """Sum, kind by kind."""
        return Count(*(a + b for a, b in zip(self, other, strict=True)))

    def share(self, part: float) -> "Count":
        """Part of all counts."""
        return Count(*(part * number for number in self))

    @property
    def operations(self) -> float:
        """Arithmetic on numbers, for one sample: a fused one counts as two."""
        return 2 * self.fused + self.products + self.sums


def body(*, rows: bool, bodies: bool) -> dict[str, Count]:
    """Count what a revolute body takes for `LANES` samples.

    Parameters
    ----------
    rows
        Whether the samples' rows have to be transposed, as on arrays ``(T, n)``.
    bodies
        Whether motion and force of every body are asked for.

    Returns
    -------
    dict of str to Count
        By part of the work.
    """
    motion = 12 if bodies else 9
    found = {
        "sine and cosine": formula(_angle, 1, 1, 1),
        "motion": formula(steps.revolute, motion, 4, 3, 1, 1),
        "wrench": formula(steps.wrench, motion, 1, 3, 6),
        "way back": formula(steps.total, 6, 6) + formula(steps.wrench_to_parent, 6, 4, 3),
    }
    if bodies:
        found["user's frames"] = formula(steps.reported, motion, 9) + formula(steps.turned, 6, 9)
    if rows:
        # Three squares in and one out serve as many bodies as there are lanes.
        squares = [_square(reading=True)] * 3 + [_square(reading=False)]
        found["transposition"] = sum(squares, Count()).share(1 / LANES)
    return found


WAY_BACK = ("way back",)
"""Parts of the work that are done on the way back; the others on the way out, which is over by then."""


def chains() -> tuple[int, int]:
    """Count the operations that wait for each other: from a body's motion to its child's, and from wrench to wrench.

    A product and a sum count as one where the processor can join them.
    """
    motion, rest = [_Link(0)] * 9, _Link(-1000)
    outwards = steps.revolute(tuple(motion), (rest,) * 4, (rest,) * 3, rest, rest)
    wrench = steps.total((_Link(0),) * 6, (rest,) * 6)
    inwards = steps.wrench_to_parent(wrench, (rest,) * 4, (rest,) * 3)
    return max(link.last for link in _links(outwards)), max(link.last for link in _links(inwards))


class _Link:
    """A number of a formula that knows how many operations had to come before it."""

    def __init__(self, last: int, *, product: bool = False) -> None:
        self.last, self.product = last, product

    def __mul__(self, other: Any) -> "_Link":
        return _Link(max(self.last, other.last if isinstance(other, _Link) else self.last) + 1, product=True)

    __rmul__ = __mul__

    def __add__(self, other: "_Link") -> "_Link":
        first, second = sorted((self, other), key=lambda link: link.last)
        # The later of two products can be joined with the sum.
        joined = second.last if second.product else second.last + 1
        return _Link(max(joined, first.last + 1))

    __sub__ = __add__


def _links(results: Any) -> list[_Link]:
    return [results] if isinstance(results, _Link) else [link for result in results for link in _links(result)]


def _angle(q: Symbol, offset: Symbol, invalid: Symbol) -> tuple[Symbol, ...]:
    return *steps.angle(q, offset), steps.invalid_angle(invalid, q, offset)


def formula(function: Callable[..., Any], *sizes: int) -> Count:
    """Count a formula's instructions; of its inputs those of one number are not tuples."""

    def work(builder: ir.IRBuilder, values: Sequence[Any]) -> Sequence[Any]:
        symbols, first, inputs = [Symbol(builder, value) for value in values], 0, []
        for size in sizes:
            inputs.append(symbols[first] if size == 1 else tuple(symbols[first : first + size]))
            first += size
        return [result.value for result in _flat(function(*inputs))]

    return _count(work, sum(sizes))


def _flat(results: Any) -> list[Symbol]:
    return [results] if isinstance(results, Symbol) else [symbol for result in results for symbol in _flat(result)]


def _square(*, reading: bool) -> Count:
    return _count(lambda builder, values: transpose(builder, values, reading=reading), LANES)


def _count(work: Callable[[ir.IRBuilder, Sequence[Any]], Sequence[Any]], inputs: int) -> Count:
    found = _tally(work, inputs)
    # How many instructions one on eight doubles is here.
    parts = _tally(lambda builder, values: [builder.fmul(*values)], 2)["products"]
    return Count(**{kind: number / parts for kind, number in found.items()})


def _tally(work: Callable[[ir.IRBuilder, Sequence[Any]], Sequence[Any]], inputs: int) -> dict[str, int]:
    module = ir.Module()
    real = ir.DoubleType().as_pointer()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [real, real]), "counted")
    for argument in function.args:
        argument.add_attribute("noalias")
    builder = ir.IRBuilder(function.append_basic_block())
    source, target = function.args
    results = work(builder, [read(builder, source, k * LANES, LANES) for k in range(inputs)])
    for k, result in enumerate(results):
        write(builder, result, target, k * LANES)
    builder.ret_void()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=3
    )
    lines = machine.emit_assembly(llvm.parse_assembly(str(module))).splitlines()
    return {kind: sum(bool(pattern.match(line)) for line in lines) for kind, pattern in _KINDS.items()}
