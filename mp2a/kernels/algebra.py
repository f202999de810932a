"""Vectors and matrices of the formulas: tuples of numbers, which may be symbols.

Vectors of 3 and 3x3 matrices are tuples (matrices row by row), and symmetric matrices are (xx, xy, xz, yy, yz, zz).
"""

from typing import Any

Numbers = tuple[Any, ...]


class Zero:
    """A zero that formulas know of, so that nothing is computed with it."""

    def __add__(self, other: Any) -> Any:
        return other

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return -other

    def __rsub__(self, other: Any) -> Any:
        return other

    def __mul__(self, other: Any) -> "Zero":
        return self

    __rmul__ = __mul__

    def __neg__(self) -> "Zero":
        return self


ZERO = Zero()


def add(a: Numbers, b: Numbers) -> Numbers:
    """Return ``a + b``."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def sub(a: Numbers, b: Numbers) -> Numbers:
    """Return ``a - b``."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scaled(a: Numbers, b: Numbers, s: Any) -> Numbers:
    """Return ``a + b s``."""
    return a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s


def cross(a: Numbers, b: Numbers) -> Numbers:
    """Return ``a × b``."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def apply(r: Numbers, x: Numbers) -> Numbers:
    """Return ``r x``."""
    return (
        r[0] * x[0] + r[1] * x[1] + r[2] * x[2],
        r[3] * x[0] + r[4] * x[1] + r[5] * x[2],
        r[6] * x[0] + r[7] * x[1] + r[8] * x[2],
    )


def apply_transposed(r: Numbers, x: Numbers) -> Numbers:
    """Return ``rᵀ x``."""
    return (
        r[0] * x[0] + r[3] * x[1] + r[6] * x[2],
        r[1] * x[0] + r[4] * x[1] + r[7] * x[2],
        r[2] * x[0] + r[5] * x[1] + r[8] * x[2],
    )


def apply_symmetric(j: Numbers, x: Numbers) -> Numbers:
    """Return ``j x`` of a symmetric j."""
    return (
        j[0] * x[0] + j[1] * x[1] + j[2] * x[2],
        j[1] * x[0] + j[3] * x[1] + j[4] * x[2],
        j[2] * x[0] + j[4] * x[1] + j[5] * x[2],
    )


def product(a: Numbers, b: Numbers) -> Numbers:
    """Return ``a b``."""
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


def turned(r: Numbers, j: Numbers) -> Numbers:
    """Return ``r j rᵀ`` of a symmetric j."""
    x = apply_symmetric(j, r[0:3])
    y = apply_symmetric(j, r[3:6])
    z = apply_symmetric(j, r[6:9])
    return (
        r[0] * x[0] + r[1] * x[1] + r[2] * x[2],
        r[3] * x[0] + r[4] * x[1] + r[5] * x[2],
        r[6] * x[0] + r[7] * x[1] + r[8] * x[2],
        r[3] * y[0] + r[4] * y[1] + r[5] * y[2],
        r[6] * y[0] + r[7] * y[1] + r[8] * y[2],
        r[6] * z[0] + r[7] * z[1] + r[8] * z[2],
    )


def minus_twice(a: Numbers, b: Numbers) -> Numbers:
    """Return ``-(a~ b~ + (a~ b~)ᵀ) = 2 (a·b) 1 - a bᵀ - b aᵀ``."""
    xx, yy, zz = a[0] * b[0], a[1] * b[1], a[2] * b[2]
    return (
        2.0 * (yy + zz),
        -(a[0] * b[1] + a[1] * b[0]),
        -(a[0] * b[2] + a[2] * b[0]),
        2.0 * (xx + zz),
        -(a[1] * b[2] + a[2] * b[1]),
        2.0 * (xx + yy),
    )


def twice_turning(w: Numbers, j: Numbers) -> Numbers:
    """Return ``w~ j + (w~ j)ᵀ`` of a symmetric j."""
    return (
        2.0 * (w[1] * j[2] - w[2] * j[1]),
        w[1] * j[4] - w[2] * j[3] + w[2] * j[0] - w[0] * j[2],
        w[1] * j[5] - w[2] * j[4] + w[0] * j[1] - w[1] * j[0],
        2.0 * (w[2] * j[1] - w[0] * j[4]),
        w[2] * j[2] - w[0] * j[5] + w[0] * j[3] - w[1] * j[1],
        2.0 * (w[0] * j[4] - w[1] * j[2]),
    )


def add_symmetric(a: Numbers, b: Numbers) -> Numbers:
    """Return ``a + b`` of symmetric ones."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]
