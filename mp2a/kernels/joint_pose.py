"""Where a joint places its body in the parent, by its kind. Only building the kernels imports this module."""

from typing import Any

from mp2a.kernels import steps
from mp2a.kernels.lanes import Real
from mp2a.kernels.primitives import compiled

# Compiled functions take plain global numbers, not attributes.
from mp2a.kernels.tables import (
    BODY_CONSTANTS,
    CONTINUOUS,
    FRAME_CONSTANTS,
    FREE,
    KIND,
    PLANAR,
    Q_COLUMN,
    REVOLUTE,
    SCREW,
    TOPOLOGY,
)


def joint_turn(real: Real, *, per_lane: bool = False) -> Any:
    """Make the step for joints with one degree of freedom.

    Returns
    -------
    Callable
        ``f(i, invalid, tables, q)`` to the turn (`mp2a.kernels.steps`), the place, how far the joint has slid, and
        what is invalid.
    """
    take, take_two = real.take_columns(1), real.take_columns(2)
    one, two, three = (real.record(count, per_lane=per_lane) for count in (1, 2, 3))
    angle, added_angle, slide = real.lift(steps.angle, 2), real.lift(steps.added_angle, 2), real.lift(steps.slide, 3)
    constant_turn, fraction, steady = (
        real.lift(steps.constant_turn, 2),
        real.lift(steps.fraction),
        real.lift(steps.at_rest, 3),
    )
    invalid_angle, invalid_length = real.lift(steps.invalid_angle), real.lift(steps.invalid_length)

    @compiled
    def turn_of(i: Any, invalid: Any, tables: Any, q: Any) -> Any:
        body_constants, frame_constants, topology = tables
        kind, column = topology[i * TOPOLOGY + KIND], topology[i * TOPOLOGY + Q_COLUMN]
        record, offset = i * BODY_CONSTANTS, i * FRAME_CONSTANTS + 20
        tilt, at_rest = two(body_constants, record), three(body_constants, record + 2)
        x, place = take(q, column)[0], steady((at_rest,))
        if kind == REVOLUTE:
            turn = angle((x, one(body_constants, record + 15)[0]))
            invalid = invalid_angle((invalid, x, one(body_constants, record + 15)[0]))
        elif kind == CONTINUOUS:
            pair = take_two(q, column)
            turn = added_angle((pair[0], pair[1], two(frame_constants, offset)))
            invalid = invalid_length((invalid, pair))
        else:
            if kind == SCREW:
                shares = two(body_constants, record + 16)
                turned = fraction((x, shares[0]))
                turn = angle((turned, one(body_constants, record + 15)[0]))
                invalid = invalid_angle((invalid, turned, one(body_constants, record + 15)[0]))
                x = fraction((x, shares[1]))
            else:
                turn = constant_turn((two(frame_constants, offset),))
            place = slide((x, at_rest, tilt))
        return turn + tilt, place, x, invalid

    return turn_of


def joint_pose(real: Real) -> Any:
    """Make the step for joints with several degrees of freedom.

    Returns
    -------
    Callable
        ``f(i, invalid, tables, q)`` to rotation and place, 12 numbers, and what is invalid.
    """
    four, seven = real.take_columns(4), real.take_columns(7)
    three, nine = real.record(3), real.record(9)
    planar, spherical, free = (real.lift(formula, 12) for formula in (steps.planar, steps.spherical, steps.free))
    invalid_length = real.lift(steps.invalid_length)

    @compiled
    def pose_of(i: Any, invalid: Any, tables: Any, q: Any) -> Any:
        body_constants, frame_constants, topology = tables
        frame, place = nine(frame_constants, i * FRAME_CONSTANTS + 9), three(body_constants, i * BODY_CONSTANTS + 2)
        kind, column = topology[i * TOPOLOGY + KIND], topology[i * TOPOLOGY + Q_COLUMN]
        if kind == FREE:
            y = seven(q, column)
            pose = free((y, frame, place))
            invalid = invalid_length((invalid, y[3:7]))
        else:
            x = four(q, column)
            if kind == PLANAR:
                pose = planar((x, frame, place))
                invalid = invalid_length((invalid, x[2:4]))
            else:
                pose = spherical((x, frame, place))
                invalid = invalid_length((invalid, x))
        return pose, invalid

    return pose_of
