"""The kernels: one formula each, and what numba compiles them to. Only building imports this module.

A formula takes the numbers of one sample of each input and returns those of the result; `mp2a.kernels.vector` makes
machine code of it. Vectors of 3 and 3x3 matrices are tuples too (matrices row by row), and symmetric matrices are
(xx, xy, xz, yy, yz, zz). What the formulas mean stands in `mp2a.segments.motion` and `mp2a.segments.load`.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numba

from mp2a.kernels.vector import LANES, Formula, Numbers, samplewise


def _add(a: Numbers, b: Numbers) -> Numbers:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _scaled(a: Numbers, b: Numbers, s: Any) -> Numbers:
    """Return ``a + b s``."""
    return a[0] + b[0] * s, a[1] + b[1] * s, a[2] + b[2] * s


def _cross(a: Numbers, b: Numbers) -> Numbers:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _apply(r: Numbers, x: Numbers) -> Numbers:
    return (
        r[0] * x[0] + r[1] * x[1] + r[2] * x[2],
        r[3] * x[0] + r[4] * x[1] + r[5] * x[2],
        r[6] * x[0] + r[7] * x[1] + r[8] * x[2],
    )


def _apply_transposed(r: Numbers, x: Numbers) -> Numbers:
    return (
        r[0] * x[0] + r[3] * x[1] + r[6] * x[2],
        r[1] * x[0] + r[4] * x[1] + r[7] * x[2],
        r[2] * x[0] + r[5] * x[1] + r[8] * x[2],
    )


def _apply_symmetric(j: Numbers, x: Numbers) -> Numbers:
    return (
        j[0] * x[0] + j[1] * x[1] + j[2] * x[2],
        j[1] * x[0] + j[3] * x[1] + j[4] * x[2],
        j[2] * x[0] + j[4] * x[1] + j[5] * x[2],
    )


def _product(a: Numbers, b: Numbers) -> Numbers:
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


def _turned(r: Numbers, j: Numbers) -> Numbers:
    """Return ``r j rᵀ`` of a symmetric j."""
    x = _apply_symmetric(j, r[0:3])
    y = _apply_symmetric(j, r[3:6])
    z = _apply_symmetric(j, r[6:9])
    return (
        r[0] * x[0] + r[1] * x[1] + r[2] * x[2],
        r[3] * x[0] + r[4] * x[1] + r[5] * x[2],
        r[6] * x[0] + r[7] * x[1] + r[8] * x[2],
        r[3] * y[0] + r[4] * y[1] + r[5] * y[2],
        r[6] * y[0] + r[7] * y[1] + r[8] * y[2],
        r[6] * z[0] + r[7] * z[1] + r[8] * z[2],
    )


def _minus_twice(a: Numbers, b: Numbers) -> Numbers:
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


def _twice_turning(w: Numbers, j: Numbers) -> Numbers:
    """Return ``w~ j + (w~ j)ᵀ`` of a symmetric j."""
    return (
        2.0 * (w[1] * j[2] - w[2] * j[1]),
        w[1] * j[4] - w[2] * j[3] + w[2] * j[0] - w[0] * j[2],
        w[1] * j[5] - w[2] * j[4] + w[0] * j[1] - w[1] * j[0],
        2.0 * (w[2] * j[1] - w[0] * j[4]),
        w[2] * j[2] - w[0] * j[5] + w[0] * j[3] - w[1] * j[1],
        2.0 * (w[0] * j[4] - w[1] * j[2]),
    )


def _add_symmetric(a: Numbers, b: Numbers) -> Numbers:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


def _compose(upper: Numbers, lower: Numbers) -> Numbers:
    r1, r2, p2 = upper[0:9], lower[0:9], lower[9:12]
    w1, v1, dw1, a1 = upper[12:15], upper[15:18], upper[18:21], upper[21:24]
    w2, v2, dw2, a2 = lower[12:15], lower[15:18], lower[18:21], lower[21:24]
    w = _apply_transposed(r2, w1)
    v = _apply_transposed(r2, _add(v1, _cross(w1, p2)))
    dw = _apply_transposed(r2, dw1)
    a = _apply_transposed(r2, _add(a1, _cross(dw1, p2)))
    return (
        _product(r1, r2)
        + _add(upper[9:12], _apply(r1, p2))
        + _add(w, w2)
        + _add(v, v2)
        + _add(_add(dw, dw2), _cross(w, w2))
        + _add(_add(a, a2), _add(_cross(w, v2), _cross(v, w2)))
    )


def _force_of(
    load: Numbers, w: Numbers, v: Numbers, dw: Numbers, a: Numbers
) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """Momentum, spin, and the force of `mp2a.segments.load`."""
    m, h, j = load[0], load[1:4], load[4:10]
    momentum = _scaled(_cross(w, h), v, m)
    spin = _add(_apply_symmetric(j, w), _cross(h, v))
    doubled = _add(momentum, _add(load[25:28], load[25:28]))
    linear = _add(_scaled(_cross(dw, h), a, m), _add(_cross(w, doubled), load[13:16]))
    angular = _add(_apply_symmetric(j, dw), _cross(h, a))
    angular = _add(angular, _apply_symmetric(load[16:22], w))
    angular = _add(angular, _cross(w, _add(load[22:25], spin)))
    angular = _add(angular, _add(_cross(v, momentum), load[10:13]))
    return momentum, spin, angular, linear


def _force(load: Numbers, velocity: Numbers, acceleration: Numbers) -> Numbers:
    _, _, angular, linear = _force_of(load, velocity[0:3], velocity[3:6], acceleration[0:3], acceleration[3:6])
    return angular + linear


def _carry(path: Numbers, force: Numbers) -> Numbers:
    linear = _apply(path[0:9], force[3:6])
    return _add(_apply(path[0:9], force[0:3]), _cross(path[9:12], linear)) + linear


def _move(load: Numbers, path: Numbers) -> Numbers:
    m, h, j = load[0], load[1:4], load[4:10]
    r, p, w, v = path[0:9], path[9:12], path[12:15], path[15:18]
    momentum, spin, angular_force, linear_force = _force_of(load, w, v, path[18:21], path[21:24])
    rate = _add_symmetric(load[16:22], _add_symmetric(_twice_turning(w, j), _minus_twice(h, v)))
    h = _apply(r, h)
    linear = _apply(r, _add(load[25:28], momentum))
    angular = _apply(r, _add(load[22:25], spin))
    middle = _scaled(h, p, 0.5 * m)
    rest = (
        _scaled(h, p, m)
        + _add_symmetric(_turned(r, j), _minus_twice(p, middle))
        + _carry(path, angular_force + linear_force)
        + _add_symmetric(_turned(r, rate), _minus_twice(p, linear))
        + _add(angular, _cross(p, linear))
        + linear
    )
    return m, *rest


def _kernel(formula: Formula, columns: Sequence[int]) -> Callable[..., None]:
    """Loop over samples, eight at once while there are so many.

    Returns
    -------
    Callable
        ``f(count, out, *inputs)`` for numba, with the number of samples and, for each array of ``(count, columns)``
        doubles, the address of a pointer to it.
    """
    block, single = samplewise(formula, columns, block=True), samplewise(formula, columns, block=False)

    @numba.njit(forceinline=True)
    def run(count: Any, out: Any, inputs: Any) -> None:
        full = count - count % LANES
        for row in range(0, full, LANES):
            block(out, inputs, row)
        for row in range(full, count):
            single(out, inputs, row)

    def two(count: Any, out: Any, a: Any, b: Any) -> None:
        run(count, out[0], (a[0], b[0]))

    def three(count: Any, out: Any, a: Any, b: Any, c: Any) -> None:
        run(count, out[0], (a[0], b[0], c[0]))

    entries: dict[int, Callable[..., None]] = {2: two, 3: three}
    return entries[len(columns)]


KERNELS = {
    "compose": _kernel(_compose, (24, 24)),
    "move": _kernel(_move, (28, 24)),
    "force": _kernel(_force, (28, 6, 6)),
    "carry": _kernel(_carry, (24, 6)),
}
"""What the shared object holds, by name."""
