"""One body on the way out: from the motion of its parent to its own. Only building the kernels imports this module."""

from typing import Any

from mp2a.kernels import steps
from mp2a.kernels.lanes import Real
from mp2a.kernels.primitives import compiled

# Compiled functions take plain global numbers, not attributes.
from mp2a.kernels.tables import (
    BODY_CONSTANTS,
    FORK,
    FRAME_CONSTANTS,
    FREE,
    KIND,
    PLANAR,
    PRISMATIC,
    Q_COLUMN,
    REVOLUTE,
    SCREW,
    SLOT,
    TOPOLOGY,
    V_COLUMN,
)


def forward_pass(real: Real, motion: int, *, per_lane: bool) -> Any:
    """Make the step to a body.

    Parameters
    ----------
    real
        Number format.
    motion
        Numbers of a state, 9 or 12.
    per_lane
        Whether each lane has a body of its own, as `mp2a.kernels.long` has them.

    Returns
    -------
    Callable
        ``f(i, state, invalid, tables, memory, views)`` to the body's state and what is invalid, with the tables of
        `mp2a.kernels.tables.ModelTables`, scratch memory, and where q, v and a are. It leaves in the body's slot what
        the backward pass needs: sine and cosine about z, or rotation and place.
    """
    lanes = real.lanes
    put, store = real.put(), real.store()
    two, three, nine = (real.record(count, per_lane=per_lane) for count in (2, 3, 9))
    take = real.take_columns(1)
    several = _several(real)
    fork, single, general = (
        real.lift(steps.fork, motion),
        _single(real, motion, per_lane=per_lane),
        real.lift(steps.general, motion),
    )

    @compiled
    def step(i: Any, state: Any, invalid: Any, tables: Any, memory: Any, views: Any) -> Any:
        body_constants, frame_constants, topology = tables
        q, v, a, _ = views
        row, record, frame = i * TOPOLOGY, i * BODY_CONSTANTS, i * FRAME_CONSTANTS
        slot = topology[row + SLOT]
        place = three(body_constants, record + 2)
        if topology[row + KIND] <= SCREW:
            if topology[row + FORK]:
                state = fork((state, two(frame_constants, frame + 18)))
            rate = take(v, topology[row + V_COLUMN])[0]
            growth = take(a, topology[row + V_COLUMN])[0]
            state, invalid, turn, x = single(i, state, invalid, tables, q, place, rate, growth)
            put(memory, slot, turn)
            if topology[row + KIND] >= PRISMATIC:
                store(memory, slot + 8 * lanes, x)
        else:
            pose, rates, growths, invalid = several(i, invalid, tables, views, nine(frame_constants, frame + 9), place)
            put(memory, slot, pose)
            state = general((state, pose[0:9], pose[9:12], rates, growths))
        return state, invalid

    return step


def _single(real: Real, motion: int, *, per_lane: bool) -> Any:
    """Joints with one degree of freedom."""
    take, take_two = real.take_columns(1), real.take_columns(2)
    one, two = real.record(1, per_lane=per_lane), real.record(2, per_lane=per_lane)
    screw, fraction = real.lift(steps.screw, motion), real.lift(steps.fraction)
    angle, added_angle, slide = real.lift(steps.angle, 2), real.lift(steps.added_angle, 2), real.lift(steps.slide, 3)
    constant_turn = real.lift(steps.constant_turn, 2)
    revolute, prismatic = real.lift(steps.revolute, motion), real.lift(steps.prismatic, motion)
    invalid_angle, invalid_length = real.lift(steps.invalid_angle), real.lift(steps.invalid_length)

    @compiled
    def single(i: Any, state: Any, invalid: Any, tables: Any, q: Any, place: Any, rate: Any, growth: Any) -> Any:
        body_constants, frame_constants, topology = tables
        kind, column = topology[i * TOPOLOGY + KIND], topology[i * TOPOLOGY + Q_COLUMN]
        tilt, offset = two(body_constants, i * BODY_CONSTANTS), i * FRAME_CONSTANTS + 20
        x = take(q, column)[0]
        if kind == PRISMATIC:
            turn = constant_turn((two(frame_constants, offset),))
            state = prismatic((state, turn + tilt, slide((x, place, tilt)), rate, growth))
        elif kind == SCREW:
            shares = two(body_constants, i * BODY_CONSTANTS + 16)
            invalid = invalid_angle(
                (invalid, fraction((x, shares[0])), one(body_constants, i * BODY_CONSTANTS + 15)[0])
            )
            turn = angle((fraction((x, shares[0])), one(body_constants, i * BODY_CONSTANTS + 15)[0]))
            x = fraction((x, shares[1]))
            state = screw((state, turn + tilt, slide((x, place, tilt)), rate, growth, shares))
        else:
            if kind == REVOLUTE:
                turn = angle((x, one(body_constants, i * BODY_CONSTANTS + 15)[0]))
                invalid = invalid_angle((invalid, x, one(body_constants, i * BODY_CONSTANTS + 15)[0]))
            else:
                pair = take_two(q, column)
                turn = added_angle((pair[0], pair[1], two(frame_constants, offset)))
                invalid = invalid_length((invalid, pair))
            state = revolute((state, turn + tilt, place, rate, growth))
        return state, invalid, turn, x

    return single


def _several(real: Real) -> Any:
    """Joints with several degrees of freedom: pose, rates of both orders, and what is invalid."""
    three, four, six, seven = (real.take_columns(count) for count in (3, 4, 6, 7))
    planar, spherical, free = (real.lift(formula, 12) for formula in (steps.planar, steps.spherical, steps.free))
    planar_rates, spherical_rates = real.lift(steps.planar_rates, 6), real.lift(steps.spherical_rates, 6)
    free_rates, invalid_length = real.lift(steps.free_rates, 6), real.lift(steps.invalid_length)

    @compiled
    def several(i: Any, invalid: Any, tables: Any, views: Any, frame: Any, place: Any) -> Any:
        topology = tables[2]
        q, v, a, _ = views
        kind, column = topology[i * TOPOLOGY + KIND], topology[i * TOPOLOGY + V_COLUMN]
        x = four(q, topology[i * TOPOLOGY + Q_COLUMN])
        if kind == PLANAR:
            invalid = invalid_length((invalid, x[2:4]))
            pose = planar((x, frame, place))
            rates, growths = planar_rates((three(v, column),)), planar_rates((three(a, column),))
        elif kind == FREE:
            y = seven(q, topology[i * TOPOLOGY + Q_COLUMN])
            invalid = invalid_length((invalid, y[3:7]))
            pose = free((y, frame, place))
            rates, growths = free_rates((six(v, column),)), free_rates((six(a, column),))
        else:
            invalid = invalid_length((invalid, x))
            pose = spherical((x, frame, place))
            rates, growths = spherical_rates((three(v, column),)), spherical_rates((three(a, column),))
        return pose, rates, growths, invalid

    return several
