"""Formulas of segments, each under the name of its kernel.

What they mean stands in `mp2a.algebra.motion`, `mp2a.algebra.inertia` and `mp2a.program.operations`.
"""

from typing import Any

from mp2a.kernels import algebra
from mp2a.kernels.algebra import (
    Numbers,
    add,
    add_symmetric,
    apply,
    apply_symmetric,
    apply_transposed,
    cross,
    minus_twice,
    scaled,
    sub,
    turned,
    twice_turning,
)


def compose(upper: Numbers, lower: Numbers) -> Numbers:
    """Put a path above another one."""
    r1, r2, p2 = upper[0:9], lower[0:9], lower[9:12]
    w1, v1, dw1, a1 = upper[12:15], upper[15:18], upper[18:21], upper[21:24]
    w2, v2, dw2, a2 = lower[12:15], lower[15:18], lower[18:21], lower[21:24]
    w = apply_transposed(r2, w1)
    v = apply_transposed(r2, add(v1, cross(w1, p2)))
    dw = apply_transposed(r2, dw1)
    a = apply_transposed(r2, add(a1, cross(dw1, p2)))
    return (
        algebra.product(r1, r2)
        + add(upper[9:12], apply(r1, p2))
        + add(w, w2)
        + add(v, v2)
        + add(add(dw, dw2), cross(w, w2))
        + add(add(a, a2), add(cross(w, v2), cross(v, w2)))
    )


def force_of(
    composite: Numbers, w: Numbers, v: Numbers, dw: Numbers, a: Numbers
) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """Return momentum, spin, and the force in two parts."""
    m, h, j = composite[0], composite[1:4], composite[4:10]
    momentum = scaled(cross(w, h), v, m)
    spin = add(apply_symmetric(j, w), cross(h, v))
    doubled = add(momentum, add(composite[25:28], composite[25:28]))
    linear = add(scaled(cross(dw, h), a, m), add(cross(w, doubled), composite[13:16]))
    angular = add(apply_symmetric(j, dw), cross(h, a))
    angular = add(angular, apply_symmetric(composite[16:22], w))
    angular = add(angular, cross(w, add(composite[22:25], spin)))
    angular = add(angular, add(cross(v, momentum), composite[10:13]))
    return momentum, spin, angular, linear


def force(composite: Numbers, velocity: Numbers, acceleration: Numbers) -> Numbers:
    """Return the force that a composite inertia takes."""
    _, _, angular, linear = force_of(composite, velocity[0:3], velocity[3:6], acceleration[0:3], acceleration[3:6])
    return angular + linear


def transform_force(path: Numbers, force: Numbers) -> Numbers:
    """Take a force from the lower to the upper end of a path."""
    linear = apply(path[0:9], force[3:6])
    return add(apply(path[0:9], force[0:3]), cross(path[9:12], linear)) + linear


def transform(composite: Numbers, path: Numbers) -> Numbers:
    """Take a composite inertia from the lower to the upper end of a path."""
    m, h, j = composite[0], composite[1:4], composite[4:10]
    r, p, w, v = path[0:9], path[9:12], path[12:15], path[15:18]
    momentum, spin, angular_force, linear_force = force_of(composite, w, v, path[18:21], path[21:24])
    rate = add_symmetric(composite[16:22], add_symmetric(twice_turning(w, j), minus_twice(h, v)))
    h = apply(r, h)
    linear = apply(r, add(composite[25:28], momentum))
    angular = apply(r, add(composite[22:25], spin))
    middle = scaled(h, p, 0.5 * m)
    rest = (
        scaled(h, p, m)
        + add_symmetric(turned(r, j), minus_twice(p, middle))
        + transform_force(path, angular_force + linear_force)
        + add_symmetric(turned(r, rate), minus_twice(p, linear))
        + add(angular, cross(p, linear))
        + linear
    )
    return m, *rest


def force_from_parent(path: Numbers, force: Numbers) -> Numbers:
    """Take a force from the upper to the lower end of a path."""
    linear = force[3:6]
    angular = sub(force[0:3], cross(path[9:12], linear))
    return apply_transposed(path[0:9], angular) + apply_transposed(path[0:9], linear)


def velocity_across(path: Numbers) -> Numbers:
    """Return the velocity of a path's lower end relative to its upper one."""
    return path[12:18]


def acceleration_from_base(path: Numbers, gravity: Numbers) -> Numbers:
    """Return the spatial acceleration of a body whose path reaches the base, which falls with -g."""
    return path[18:21] + sub(path[21:24], apply_transposed(path[0:9], gravity))


def to_classical(acceleration: Numbers, velocity: Numbers) -> Numbers:
    """Return the classical acceleration of a spatial one."""
    return acceleration[0:3] + add(acceleration[3:6], cross(velocity[0:3], velocity[3:6]))


def acceleration_across(path: Numbers, velocity: Numbers) -> Numbers:
    """Return H q̈ and the velocity products of a path whose lower end has a velocity."""
    w, turning, sliding = velocity[0:3], path[12:15], path[15:18]
    w_parent, place = sub(w, turning), apply_transposed(path[0:9], path[9:12])
    linear = add(cross(w_parent, add(cross(w_parent, place), sliding)), cross(w, sliding))
    return add(path[18:21], cross(w, turning)) + add(path[21:24], linear)


def operator_across(path: Numbers) -> Numbers:
    """Return ``Pᵀ Rᵀ`` across a path, a 6x6 matrix row by row."""
    r, p = path[0:9], path[9:12]
    zero = p[0].constant(0.0)
    nothing = (zero, zero, zero)
    turned = [(r[i], r[3 + i], r[6 + i]) for i in range(3)]
    above = [row + nothing for row in turned]
    below = [cross(p, row) + row for row in turned]
    return tuple(number for row in (*above, *below) for number in row)


def transpose_matrix(a: Numbers) -> Numbers:
    """Return the transpose of a 6x6 matrix."""
    return tuple(a[6 * j + i] for i in range(6) for j in range(6))


def apply_matrix(a: Numbers, x: Numbers) -> Numbers:
    """Return ``a x`` with a 6x6 matrix."""
    return tuple(_dot(a[6 * i : 6 * i + 6], x) for i in range(6))


def subtract(a: Numbers, b: Numbers) -> Numbers:
    """Return ``a - b``."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


def body_inertia(external: Numbers, body: Numbers) -> Numbers:
    """Return the composite inertia of one body that is pushed from outside, from that without."""
    zero = external[0].constant(0.0)
    return tuple(zero + x for x in body[:10]) + tuple(zero - x for x in external) + (zero,) * 12


def body_force(velocity: Numbers, acceleration: Numbers, body: Numbers) -> Numbers:
    """Return the force that moves a body with a classical acceleration, from its composite inertia."""
    w, dw, a = velocity[0:3], acceleration[0:3], acceleration[3:6]
    mass, moment, inertia = body[0], body[1:4], body[4:10]
    spin = apply_symmetric(inertia, w)
    angular = add(add(apply_symmetric(inertia, dw), cross(w, spin)), cross(moment, a))
    return angular + scaled(add(cross(dw, moment), cross(w, cross(w, moment))), a, mass)


def product(a: Numbers, b: Numbers) -> Numbers:
    """Return ``a b`` of 6x6 matrices, row by row."""
    return tuple(_dot(a[6 * i : 6 * i + 6], b[j::6]) for i in range(6) for j in range(6))


def push(a: Numbers, x: Numbers, y: Numbers) -> Numbers:
    """Return ``a x + y`` with a 6x6 matrix."""
    return tuple(_dot(a[6 * i : 6 * i + 6], x) + y[i] for i in range(6))


def _dot(a: Numbers, b: Numbers) -> Any:
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total
