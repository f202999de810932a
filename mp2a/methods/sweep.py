"""The whole inverse dynamics in one set of rounds, on a chain or a tree (theory, section 4)."""

import numpy as np

from mp2a import kernels
from mp2a.chain import Chain
from mp2a.leaf import State, joint_motion, joint_torque
from mp2a.methods.result import InverseDynamics
from mp2a.schedule import FORCE, MOTION, Schedule
from mp2a.segments import load, motion
from mp2a.spatial import Array, apply, spatial_to_classical, transpose
from mp2a.transport.base import Transport
from mp2a.transport.steps import Operation, Register, Use

DOUBLES = {MOTION: motion.DOUBLES, FORCE: load.DOUBLES}

LONGER = Use("path", after=(Operation("compose", "path", ("<path", "path")),))
"""A path that comes is put above the own one."""

_LAYOUT = {
    "path": Register({"path": motion.DOUBLES}, copies=2),
    "below": Register({"below": load.DOUBLES}),
    "upwards": Register({"upwards": load.DOUBLES}, copies=2),
}
_USES = {
    MOTION: LONGER,
    FORCE: Use(
        "upwards",
        before=(Operation("move", "upwards", ("below", "path")),),
        after=(Operation("add", "below", ("<upwards",)),),
    ),
}


def sweep(bodies: Chain, state: State, gravity: Array, schedule: Schedule, transport: Transport) -> InverseDynamics:
    """Inverse dynamics of the bodies this process holds.

    A body keeps two segments: its motion across the path from its 2^e-th ancestor, and the load of all bodies fewer
    than 2^e below it. In a round it hands the first to those whose 2^e-th ancestor it is and the second, moved across
    the first, to its own; neither waits for the other.
    """
    registers = transport.registers(_LAYOUT, state.samples)
    registers["path"][:] = motion.leaf(joint_motion(bodies, state))
    registers["below"][:] = load.leaf(bodies.masses, bodies.coms, bodies.origin_inertias, state.external, state.samples)
    transport.run(schedule.rounds, _USES, registers)
    velocity, acceleration = read_off(registers["path"], gravity)
    force = kernels.force(registers["below"], velocity, acceleration)
    return InverseDynamics(velocity, spatial_to_classical(acceleration, velocity), force, joint_torque(bodies, force))


def read_off(path: Array, gravity: Array) -> tuple[Array, Array]:
    """Velocity and spatial acceleration ``(n, T, 6)`` of bodies whose paths reach the base, which falls with -g."""
    whole = motion.view(path)
    acceleration = whole.acceleration.copy()
    acceleration[..., 3:] -= apply(transpose(whole.rotation), np.broadcast_to(gravity, (*path.shape[:-1], 3)))
    return whole.velocity.copy(), acceleration
