"""Formulas of one body in the recursion of Newton and Euler (Luh, Walker and Paul 1980), for vectors of samples.

A state is what a body moves with, in its own frame: angular velocity, angular acceleration, acceleration of its origin
(classical, with gravity in it as that of the base), where it is asked for the origin's velocity, and where a path is
asked for the rotation from the body to where the path starts, row by row, and its place there: 9, 12 or 24 numbers.
A wrench is a torque and a force, 6 numbers. The frames are those of `mp2a.kernels.tables`: a joint with one degree of
freedom has z as its axis, and its body is turned against its parent about x by a constant angle, then about z.

A ``turn`` is (sine, cosine) of the angle about z and (cosine, sine) of the one about x.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from llvmlite import ir

from mp2a.kernels.algebra import (
    ZERO,
    Numbers,
    add,
    apply,
    apply_symmetric,
    apply_transposed,
    cross,
    product,
    scaled,
    sub,
)
from mp2a.kernels.formulas import transform, transform_force
from mp2a.kernels.symbols import Symbol
from mp2a.kernels.trigonometry import largest_angle, sine_and_cosine
from mp2a.spatial import quaternion_matrix


def _to_parent(turn: Numbers, x: Numbers) -> Numbers:
    """Vector of the body in the parent's frame."""
    sine, cosine, cosine_x, sine_x = turn
    y = sine * x[0] + cosine * x[1]
    return cosine * x[0] - sine * x[1], cosine_x * y - sine_x * x[2], sine_x * y + cosine_x * x[2]


def to_body(turn: Numbers, x: Numbers) -> Numbers:
    """Vector of the parent in the body's frame."""
    sine, cosine, cosine_x, sine_x = turn
    y = cosine_x * x[1] + sine_x * x[2]
    return cosine * x[0] + sine * y, cosine * y - sine * x[0], cosine_x * x[2] - sine_x * x[1]


def _parts(state: Numbers) -> list[Numbers]:
    return [state[k : k + 3] for k in range(0, len(state), 3)]


def _follow(state: Numbers, place: Numbers, into: Callable[[Numbers], Numbers]) -> tuple[Any, Any, Any, Any, Any]:
    """Motion of the parent at a place in its frame, turned into the body's: w, dw, a, v (or none), the rest."""
    w, dw, a, *more = _parts(state)
    v, rows, at = more[:1], more[1:4], state[21:]
    swept = cross(w, place)
    a = add(a, add(cross(dw, place), cross(w, swept)))
    along = [row[0] * place[0] + row[1] * place[1] + row[2] * place[2] for row in rows]
    rest = [*(into(row) for row in rows), *(number + step for number, step in zip(at, along, strict=True))]
    return into(w), into(dw), into(a), [into(add(x, swept)) for x in v], rest


def angle(q: Symbol, offset: Symbol) -> tuple[Symbol, Symbol]:
    """Sine and cosine of a revolute joint's angle about z."""
    return sine_and_cosine(q + offset)


def added_angle(cosine: Symbol, sine: Symbol, offset: Numbers) -> Numbers:
    """Sine and cosine of a continuous joint's angle about z, whose offset is given as (cosine, sine)."""
    return sine * offset[0] + cosine * offset[1], cosine * offset[0] - sine * offset[1]


def constant_turn(offset: Numbers) -> Numbers:
    """Sine and cosine about z of a body that does not turn, from (cosine, sine)."""
    return offset[1], offset[0]


def slide(q: Symbol, place: Numbers, tilt: Numbers) -> Numbers:
    """Place of a prismatic joint's body; ``tilt`` is (cosine, sine) of the angle about x."""
    return place[0], place[1] - tilt[1] * q, place[2] + tilt[0] * q


def at_rest(place: Numbers) -> Numbers:
    """Place of a body that does not slide, a vector a number."""
    return place


def fork(state: Numbers, offset: Numbers) -> tuple[Numbers, ...]:
    """State in a frame that is turned about z by an angle given as (cosine, sine)."""
    c, s = offset
    turned = ((c * x[0] + s * x[1], c * x[1] - s * x[0], x[2]) for x in _parts(state[:21]))
    return *turned, *state[21:]


def join(wrench: Numbers, offset: Numbers) -> tuple[Numbers, ...]:
    """Wrench in the frame before the turn of `fork`."""
    c, s = offset
    return tuple((c * x[0] - s * x[1], s * x[0] + c * x[1], x[2]) for x in _parts(wrench))


def revolute(state: Numbers, turn: Numbers, place: Numbers, rate: Symbol, growth: Symbol) -> tuple[Numbers, ...]:
    """State of a body that turns about z."""
    w, dw, a, v, rest = _follow(state, place, partial(to_body, turn))
    dw = dw[0] + w[1] * rate, dw[1] - w[0] * rate, dw[2] + growth
    return (w[0], w[1], w[2] + rate), dw, a, *v, *rest


def prismatic(state: Numbers, turn: Numbers, place: Numbers, rate: Symbol, growth: Symbol) -> tuple[Numbers, ...]:
    """State of a body that slides along z."""
    w, dw, a, v, rest = _follow(state, place, partial(to_body, turn))
    a = a[0] + 2.0 * w[1] * rate, a[1] - 2.0 * w[0] * rate, a[2] + growth
    return w, dw, a, *((x[0], x[1], x[2] + rate) for x in v), *rest


def screw(
    state: Numbers, turn: Numbers, place: Numbers, rate: Symbol, growth: Symbol, shares: Numbers
) -> tuple[Numbers, ...]:
    """State of a body that turns about z and slides along it by shares, one of which is 1 and the other 0."""
    w, dw, a, v, rest = _follow(state, place, partial(to_body, turn))
    turning, sliding = shares[0] * rate, shares[1] * rate
    dw = dw[0] + w[1] * turning, dw[1] - w[0] * turning, dw[2] + shares[0] * growth
    a = a[0] + 2.0 * w[1] * sliding, a[1] - 2.0 * w[0] * sliding, a[2] + shares[1] * growth
    return (w[0], w[1], w[2] + turning), dw, a, *((x[0], x[1], x[2] + sliding) for x in v), *rest


def no_path(zero: Symbol) -> Numbers:
    """Path from a body to itself."""
    one = zero.constant(1.0)
    return (zero,) * 12 + (one, zero, zero, zero, one, zero, zero, zero, one) + (zero,) * 3


def no_composite(zero: Symbol) -> Numbers:
    """Return the composite inertia of no body."""
    return (zero,) * 28


def composite_of(path: Numbers, mass: Symbol, moment: Numbers, inertia: Numbers) -> Numbers:
    """Return the composite inertia of a body about the start of the path to it."""
    w, v = path[0:3], path[9:12]
    spatial = sub(path[6:9], cross(w, v))
    return transform((mass, *moment, *inertia, *(ZERO,) * 18), (*path[12:24], *w, *v, *path[3:6], *spatial))


def with_external(composite: Numbers, path: Numbers, external: Numbers, rotation: Numbers) -> Numbers:
    """Add to a composite inertia a wrench from outside on the body at the path's end, in the user's frame of it."""
    turned_back = tuple(number for x in _parts(external) for number in apply_transposed(rotation, x))
    wrench = transform_force(path[12:24], turned_back)
    return *composite[:10], *(have - more for have, more in zip(composite[10:16], wrench, strict=True)), *composite[16:]


def path_to_user_frame(path: Numbers, rotation: Numbers) -> Numbers:
    """Path as `mp2a.algebra.motion` has it, to the user's frame of the body at its end."""
    turned = tuple(number for x in _parts(path[0:21]) for number in apply(rotation, x))
    return path_to_table_frame((*turned, *path[21:24]))


def path_to_table_frame(path: Numbers) -> Numbers:
    """Path as `mp2a.algebra.motion` has it, to the frame of the tables."""
    w, dw, a, v = _parts(path[0:12])
    return *path[12:24], *w, *v, *dw, *sub(a, cross(w, v))


def fraction(x: Symbol, part: Symbol) -> Symbol:
    """Part of a number."""
    return x * part


def screw_torque(wrench: Numbers, shares: Numbers) -> Symbol:
    """Torque or force of a `screw`."""
    return wrench[2] * shares[0] + wrench[5] * shares[1]


def general(state: Numbers, rotation: Numbers, place: Numbers, rates: Numbers, growths: Numbers) -> tuple[Numbers, ...]:
    """State of a body with any rotation and place; rates and growths are [angular; linear] in its own frame."""
    w, dw, a, v, rest = _follow(state, place, partial(apply_transposed, rotation))
    turning, sliding = rates[0:3], rates[3:6]
    coriolis = cross(w, sliding)
    a = add(add(a, growths[3:6]), add(cross(turning, sliding), add(coriolis, coriolis)))
    dw = add(add(dw, growths[0:3]), cross(w, turning))
    return add(w, turning), dw, a, *(add(x, sliding) for x in v), *rest


def wrench(state: Numbers, mass: Symbol, moment: Numbers, inertia: Numbers) -> tuple[Numbers, ...]:
    """Torque and force that move a body, about its origin; inertia about the origin."""
    w, dw, a, *_ = _parts(state)
    spin = apply_symmetric(inertia, w)
    torque = add(add(apply_symmetric(inertia, dw), cross(w, spin)), cross(moment, a))
    return torque, scaled(add(cross(dw, moment), cross(w, cross(w, moment))), a, mass)


def wrench_to_parent(wrench: Numbers, turn: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Wrench on a body with one degree of freedom, taken to its parent."""
    torque, force = (_to_parent(turn, x) for x in _parts(wrench))
    return add(torque, cross(place, force)), force


def general_wrench_to_parent(wrench: Numbers, rotation: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Wrench on a body with any rotation, taken to its parent."""
    torque, force = (apply(rotation, x) for x in _parts(wrench))
    return add(torque, cross(place, force)), force


def turned(x: Numbers, rotation: Numbers) -> list[Numbers]:
    """Vectors of the body in the user's frame of it."""
    return [apply(rotation, part) for part in _parts(x)]


def reported(state: Numbers, rotation: Numbers) -> list[Numbers]:
    """Velocity and acceleration, [angular; linear] each, in the user's frame of the body."""
    w, dw, a, v = turned(state, rotation)
    return [w, v, dw, a]


def without(wrench: Numbers, external: Numbers, rotation: Numbers) -> list[Numbers]:
    """Wrench less one from outside in the user's frame of the body."""
    pairs = zip(_parts(wrench), _parts(external), strict=True)
    return [scaled(have, apply_transposed(rotation, x), -1.0) for have, x in pairs]


def total(a: Numbers, b: Numbers) -> Numbers:
    """Sum."""
    return tuple(x + y for x, y in zip(a, b, strict=True))


def base_pose(zero: Symbol) -> Numbers:
    """Pose of the base in itself: a rotation, row by row, and a place."""
    one = zero.constant(1.0)
    return one, zero, zero, zero, one, zero, zero, zero, one, zero, zero, zero


def fork_pose(pose: Numbers, offset: Numbers) -> tuple[Numbers, ...]:
    """Pose of a frame that is turned about z by an angle given as (cosine, sine)."""
    return *fork(pose[0:9], offset), *pose[9:12]


def turned_pose(pose: Numbers, turn: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Pose of a body with one degree of freedom, from its parent's."""
    return *(to_body(turn, row) for row in _parts(pose[0:9])), add(pose[9:12], apply(pose[0:9], place))


def general_pose(pose: Numbers, rotation: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Pose of a body with any rotation, from its parent's."""
    return product(pose[0:9], rotation), add(pose[9:12], apply(pose[0:9], place))


def planar(q: Numbers, frame: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Rotation and place of a planar joint's body, q = x, y, cosine, sine."""
    x, y, c, s = q
    rotation = tuple(
        number
        for row in (frame[0:3], frame[3:6], frame[6:9])
        for number in (row[0] * c + row[1] * s, row[1] * c - row[0] * s, row[2])
    )
    return rotation, tuple(place[k] + frame[3 * k] * x + frame[3 * k + 1] * y for k in range(3))


def spherical(q: Numbers, frame: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Rotation and place of a spherical joint's body."""
    return product(frame, quaternion_matrix(*q)), place


def free(q: Numbers, frame: Numbers, place: Numbers) -> tuple[Numbers, ...]:
    """Rotation and place of a free joint's body, q = position, quaternion."""
    return product(frame, quaternion_matrix(*q[3:7])), add(place, apply(frame, q[0:3]))


def planar_rates(v: Numbers) -> Numbers:
    """[angular; linear] of a planar joint's v = x, y, turn."""
    zero = v[0].constant(0.0)
    return zero, zero, v[2], v[0], v[1], zero


def spherical_rates(v: Numbers) -> Numbers:
    """[angular; linear] of a spherical joint's v."""
    zero = v[0].constant(0.0)
    return (*v, zero, zero, zero)


def free_rates(v: Numbers) -> Numbers:
    """[angular; linear] of a free joint's v = [linear; angular]."""
    return v[3:6] + v[0:3]


def invalid_angle(invalid: Symbol, q: Symbol, offset: Symbol) -> Symbol:
    """``invalid``, but not a number where an angle is too large for `sine_and_cosine`."""
    return unless(_within(q + offset, largest_angle(q)), invalid)


def invalid_length(invalid: Symbol, numbers: Numbers) -> Symbol:
    """``invalid``, but not a number where numbers that have to have length 1 do not."""
    square = numbers[0] * numbers[0]
    for number in numbers[1:]:
        square = square + number * number
    return unless(_within(square - 1.0, 1e-6), invalid)


def invalid_results(invalid: Symbol, results: Numbers) -> Symbol:
    """``invalid``, but not a number where a result is not finite."""
    for result in results:
        invalid = invalid + 0.0 * result
    return invalid


def _within(x: Symbol, bound: float) -> ir.Value:
    build = x.builder
    above = build.fcmp_ordered("<=", x.value, x.constant(bound).value)
    return build.and_(above, build.fcmp_ordered(">=", x.value, x.constant(-bound).value))


def unless(sure: ir.Value, invalid: Symbol) -> Symbol:
    """``invalid``, but not a number where something is not sure."""
    return Symbol(invalid.builder, invalid.builder.select(sure, invalid.value, invalid.constant(float("nan")).value))
