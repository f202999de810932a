"""One body on the way out: from the motion of its parent to its own. Only building the kernels imports this module."""

from collections.abc import Callable
from typing import Any

from mp2a.kernels import steps
from mp2a.kernels.joint_pose import joint_pose, joint_turn
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
    SCREW,
    SLOT,
    TOPOLOGY,
    V_COLUMN,
)


def forward_pass(real: Real, motion: int, *, per_lane: bool, accelerated: bool = True) -> Any:
    """Make the step to a body.

    Parameters
    ----------
    real
        Number format.
    motion
        Numbers of a state, 9 or 12.
    per_lane
        Whether each lane has a body of its own, as `mp2a.kernels.long` has them.
    accelerated
        Whether joints have accelerations, else a is not read.

    Returns
    -------
    Callable
        ``f(i, state, invalid, tables, memory, views)`` to the body's state and what is invalid, with the tables of
        `mp2a.kernels.tables.ModelTables`, scratch memory, and where q, v and a are. It leaves in the body's slot what
        the backward pass needs: sine and cosine about z, or rotation and place.
    """
    lanes = real.lanes
    put, store, growths = real.put(), real.store(), real.take_columns if accelerated else real.no_columns
    two, take, take_growth = real.record(2, per_lane=per_lane), real.take_columns(1), growths(1)
    joint_turn_of, joint_pose_of = joint_turn(real, per_lane=per_lane), joint_pose(real)
    rates_of, growths_of = _rates(real, real.take_columns), _rates(real, growths)
    fork, single, general = real.lift(steps.fork, motion), _single(real, motion), real.lift(steps.general, motion)

    @compiled
    def step(i: Any, state: Any, invalid: Any, tables: Any, memory: Any, views: Any) -> Any:
        body_constants, frame_constants, topology = tables
        q, v, a, _ = views
        row = i * TOPOLOGY
        kind, slot, column = topology[row + KIND], topology[row + SLOT], topology[row + V_COLUMN]
        if kind <= SCREW:
            if topology[row + FORK]:
                state = fork((state, two(frame_constants, i * FRAME_CONSTANTS + 18)))
            turn, place, x, invalid = joint_turn_of(i, invalid, tables, q)
            shares = two(body_constants, i * BODY_CONSTANTS + 16)
            state = single(kind, state, turn, place, take(v, column)[0], take_growth(a, column)[0], shares)
            put(memory, slot, turn[0:2])
            if kind >= PRISMATIC:
                store(memory, slot + 8 * lanes, x)
        else:
            pose, invalid = joint_pose_of(i, invalid, tables, q)
            put(memory, slot, pose)
            state = general((state, pose[0:9], pose[9:12], rates_of(kind, v, column), growths_of(kind, a, column)))
        return state, invalid

    return step


def _single(real: Real, motion: int) -> Any:
    """Motion across joints with one degree of freedom."""
    revolute, prismatic = real.lift(steps.revolute, motion), real.lift(steps.prismatic, motion)
    screw = real.lift(steps.screw, motion)

    @compiled
    def single(kind: Any, state: Any, turn: Any, place: Any, rate: Any, growth: Any, shares: Any) -> Any:
        if kind == PRISMATIC:
            state = prismatic((state, turn, place, rate, growth))
        elif kind == SCREW:
            state = screw((state, turn, place, rate, growth, shares))
        else:
            state = revolute((state, turn, place, rate, growth))
        return state

    return single


def _rates(real: Real, take: Callable[[int], Any]) -> Any:
    """Columns of joints with several degrees of freedom as [angular; linear]."""
    three, six = take(3), take(6)
    planar, spherical, free = (
        real.lift(formula, 6) for formula in (steps.planar_rates, steps.spherical_rates, steps.free_rates)
    )

    @compiled
    def rates(kind: Any, view: Any, column: Any) -> Any:
        if kind == PLANAR:
            values = planar((three(view, column),))
        elif kind == FREE:
            values = free((six(view, column),))
        else:
            values = spherical((three(view, column),))
        return values

    return rates
