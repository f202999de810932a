"""The kernels: one formula each, and what numba compiles them to. Only building imports this module.

A formula takes the numbers of one sample of each input and returns those of the result; `mp2a.kernels.symbols` makes
machine code of it. What the formulas mean stands in `mp2a.segments.motion` and `mp2a.segments.load`.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numba

from mp2a.kernels.algebra import (
    Numbers,
    add,
    add_symmetric,
    apply,
    apply_symmetric,
    apply_transposed,
    cross,
    minus_twice,
    product,
    scaled,
    turned,
    twice_turning,
)
from mp2a.kernels.lanes import DOUBLE, SINGLE
from mp2a.kernels.reach import reach
from mp2a.kernels.recursion import recursion
from mp2a.kernels.samplewise import samplewise
from mp2a.kernels.symbols import LANES, Formula


def _compose(upper: Numbers, lower: Numbers) -> Numbers:
    r1, r2, p2 = upper[0:9], lower[0:9], lower[9:12]
    w1, v1, dw1, a1 = upper[12:15], upper[15:18], upper[18:21], upper[21:24]
    w2, v2, dw2, a2 = lower[12:15], lower[15:18], lower[18:21], lower[21:24]
    w = apply_transposed(r2, w1)
    v = apply_transposed(r2, add(v1, cross(w1, p2)))
    dw = apply_transposed(r2, dw1)
    a = apply_transposed(r2, add(a1, cross(dw1, p2)))
    return (
        product(r1, r2)
        + add(upper[9:12], apply(r1, p2))
        + add(w, w2)
        + add(v, v2)
        + add(add(dw, dw2), cross(w, w2))
        + add(add(a, a2), add(cross(w, v2), cross(v, w2)))
    )


def _force_of(
    load: Numbers, w: Numbers, v: Numbers, dw: Numbers, a: Numbers
) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """Momentum, spin, and the force of `mp2a.segments.load`."""
    m, h, j = load[0], load[1:4], load[4:10]
    momentum = scaled(cross(w, h), v, m)
    spin = add(apply_symmetric(j, w), cross(h, v))
    doubled = add(momentum, add(load[25:28], load[25:28]))
    linear = add(scaled(cross(dw, h), a, m), add(cross(w, doubled), load[13:16]))
    angular = add(apply_symmetric(j, dw), cross(h, a))
    angular = add(angular, apply_symmetric(load[16:22], w))
    angular = add(angular, cross(w, add(load[22:25], spin)))
    angular = add(angular, add(cross(v, momentum), load[10:13]))
    return momentum, spin, angular, linear


def _force(load: Numbers, velocity: Numbers, acceleration: Numbers) -> Numbers:
    _, _, angular, linear = _force_of(load, velocity[0:3], velocity[3:6], acceleration[0:3], acceleration[3:6])
    return angular + linear


def _carry(path: Numbers, force: Numbers) -> Numbers:
    linear = apply(path[0:9], force[3:6])
    return add(apply(path[0:9], force[0:3]), cross(path[9:12], linear)) + linear


def _move(load: Numbers, path: Numbers) -> Numbers:
    m, h, j = load[0], load[1:4], load[4:10]
    r, p, w, v = path[0:9], path[9:12], path[12:15], path[15:18]
    momentum, spin, angular_force, linear_force = _force_of(load, w, v, path[18:21], path[21:24])
    rate = add_symmetric(load[16:22], add_symmetric(twice_turning(w, j), minus_twice(h, v)))
    h = apply(r, h)
    linear = apply(r, add(load[25:28], momentum))
    angular = apply(r, add(load[22:25], spin))
    middle = scaled(h, p, 0.5 * m)
    rest = (
        scaled(h, p, m)
        + add_symmetric(turned(r, j), minus_twice(p, middle))
        + _carry(path, angular_force + linear_force)
        + add_symmetric(turned(r, rate), minus_twice(p, linear))
        + add(angular, cross(p, linear))
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
    "rnea_double": recursion(DOUBLE, bodies=False),
    "rnea_double_bodies": recursion(DOUBLE, bodies=True),
    "rnea_lanes": recursion(DOUBLE, bodies=False, lanewise=True),
    "rnea_lanes_bodies": recursion(DOUBLE, bodies=True, lanewise=True),
    "reach": reach(DOUBLE),
    "rnea_single": recursion(SINGLE, bodies=False),
    "rnea_single_bodies": recursion(SINGLE, bodies=True),
}
"""What the shared object holds, by name."""
