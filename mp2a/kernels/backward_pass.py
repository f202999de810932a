"""One body on the way back: its torque, and what it passes to its parent. Only building the kernels imports this."""

from typing import Any

from mp2a.kernels import steps
from mp2a.kernels.lanes import Real
from mp2a.kernels.primitives import compiled
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


def backward_pass(real: Real, *, per_lane: bool) -> Any:
    """Make the step from a body to its parent.

    Returns
    -------
    Callable
        ``f(i, wrench, tables, memory, torque)`` to the wrench on the parent, with the tables of
        `mp2a.kernels.tables.ModelTables`, scratch memory and where the torque goes.
    """
    lanes = real.lanes
    load, put, screw_torque = real.load(), real.put_columns(), real.lift(steps.screw_torque)
    two, three = real.record(2, per_lane=per_lane), real.record(3, per_lane=per_lane)
    vectors, rotation = real.vectors(3), real.vectors(9)
    slide, join = real.lift(steps.slide, 3), real.lift(steps.join, 6)
    single, general = real.lift(steps.wrench_to_parent, 6), real.lift(steps.general_wrench_to_parent, 6)

    @compiled
    def step(i: Any, wrench: Any, tables: Any, memory: Any, torque: Any) -> Any:
        body_constants, frame_constants, topology = tables
        row, record = i * TOPOLOGY, i * BODY_CONSTANTS
        kind, slot, column = topology[row + KIND], topology[row + SLOT], topology[row + V_COLUMN]
        if kind <= SCREW:
            tilt, place = two(body_constants, record), three(body_constants, record + 2)
            turn = load(memory, slot), load(memory, slot + lanes)
            if kind >= PRISMATIC:
                result = wrench[5:6]
                if kind == SCREW:
                    result = (screw_torque((wrench, two(body_constants, record + 16))),)
                carried = single((wrench, turn + tilt, slide((load(memory, slot + 8 * lanes), place, tilt))))
            else:
                result = wrench[2:3]
                carried = single((wrench, turn + tilt, place))
            if topology[row + FORK]:
                carried = join((carried, two(frame_constants, i * FRAME_CONSTANTS + 18)))
            put(torque, column, result)
        else:
            if kind == PLANAR:
                put(torque, column, wrench[3:5] + wrench[2:3])
            elif kind == FREE:
                put(torque, column, wrench[3:6] + wrench[0:3])
            else:
                put(torque, column, wrench[0:3])
            carried = general((wrench, rotation(memory, slot), vectors(memory, slot + 9 * lanes)))
        return carried

    return step
