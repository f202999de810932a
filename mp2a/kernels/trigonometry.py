"""Sine and cosine of numbers and vectors, to rounding for angles of moderate size.

The angle less a multiple of π/2 lies within ±π/4, where short polynomials are exact to rounding (coefficients: double
from Sun's fdlibm, ``k_sin.c`` and ``k_cos.c``; single from Moshier's Cephes, ``sinf.c``). The multiple is found by
adding a number so large that the sum has no fraction, and taken off in three parts.
"""

from typing import NamedTuple

from llvmlite import ir

from mp2a.kernels import LARGEST_ANGLE
from mp2a.kernels.symbols import Symbol


class _Format(NamedTuple):
    largest: float
    """Angle up to which the result is exact to rounding."""
    whole: float
    """1.5 × 2^(bits of the mantissa - 1)"""
    quarter: tuple[float, float, float]
    """π/2 in three parts, of which multiples are exact."""
    sine: tuple[float, ...]
    """Coefficients of x³, x⁵, …"""
    cosine: tuple[float, ...]
    """Coefficients of x⁴, x⁶, …"""


_DOUBLE = _Format(
    LARGEST_ANGLE,
    1.5 * 2.0**52,
    (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21),
    (
        -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
        2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10,
    ),
    (
        4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
        -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11,
    ),
)  # fmt: skip
_SINGLE = _Format(
    4e3,
    1.5 * 2.0**23,
    (1.5703125, 4.837512969970703125e-4, 7.54978995489188216e-8),
    (-1.6666654611e-1, 8.3321608736e-3, -1.9515295891e-4),
    (4.166664568298827e-2, -1.388731625493765e-3, 2.443315711809948e-5),
)


def sine_and_cosine(x: Symbol) -> tuple[Symbol, Symbol]:
    """Sine and cosine of an angle; nothing is said of angles beyond `largest_angle`."""
    form, build = _format(x), x.builder
    raised = x * 0.63661977236758134308 + form.whole
    multiple = raised - form.whole
    for part in form.quarter:
        x = x - multiple * part
    square = x * x
    sine = x + x * square * _polynomial(square, form.sine)
    cosine = 1.0 - 0.5 * square + square * square * _polynomial(square, form.cosine)

    # The last bits of the raised angle count the quarter turns, also where the angle is not a number.
    bits = ir.IntType(64 if form is _DOUBLE else 32)
    lanes = raised.value.type.count if isinstance(raised.value.type, ir.VectorType) else 0
    kind = ir.VectorType(bits, lanes) if lanes else bits
    turns = build.bitcast(raised.value, kind)

    def constant(number: int) -> ir.Constant:
        return ir.Constant(kind, [number] * lanes if lanes else number)

    def flipped(value: ir.Value, when: ir.Value) -> Symbol:
        """Change the sign where the second bit is set."""
        sign = build.shl(build.and_(when, constant(2)), constant(bits.width - 2))
        return Symbol(build, build.bitcast(build.xor(build.bitcast(value, kind), sign), value.type))

    odd = build.icmp_signed("!=", build.and_(turns, constant(1)), constant(0))
    return (
        flipped(build.select(odd, cosine.value, sine.value), turns),
        flipped(build.select(odd, sine.value, cosine.value), build.add(turns, constant(1))),
    )


def largest_angle(x: Symbol) -> float:
    """Angle up to which `sine_and_cosine` is exact to rounding, rad."""
    return _format(x).largest


def _format(x: Symbol) -> _Format:
    kind = x.value.type
    real = kind.element if isinstance(kind, ir.VectorType) else kind
    return _DOUBLE if real == ir.DoubleType() else _SINGLE


def _polynomial(x: Symbol, coefficients: tuple[float, ...]) -> Symbol:
    total = x.constant(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = x * total + coefficient
    return total
