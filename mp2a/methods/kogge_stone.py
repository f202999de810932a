"""The paper's method: three Kogge-Stone scans of affine maps over 6×6 operators (eq. 4-10, figures 4-6)."""

import numpy as np

from mp2a.chain import Chain
from mp2a.leaf import State, joint_motion, joint_torque
from mp2a.methods.result import InverseDynamics
from mp2a.schedule import Schedule
from mp2a.segments.affine import MATRIX_AND_VECTOR, VECTOR
from mp2a.spatial import (
    Array,
    apply,
    body_force,
    force_to_child,
    motion_operator,
    transpose,
    velocity_product,
)
from mp2a.transport.base import Transport
from mp2a.transport.steps import Operation, Register, Use

_LAYOUT = {"window": Register({"matrix": 36, "vector": 6}, copies=2)}
_PUSH = Operation("push", "vector", ("matrix", "<vector", "vector"))
_USES = {
    MATRIX_AND_VECTOR: Use("window", after=(Operation("product", "matrix", ("matrix", "<matrix")), _PUSH)),
    VECTOR: Use("vector", after=(_PUSH,)),
}
"""The piece that comes lies before the own one (for forces: behind it). After a vector alone the window reaches the end
of the chain, and its matrix means nothing any more."""


def kogge_stone(
    bodies: Chain, state: State, gravity: Array, schedule: Schedule, transport: Transport
) -> InverseDynamics:
    r"""Inverse dynamics of the bodies this process holds.

    Each robot forms its own :math:`C_i, b_i` (eq. 7, 9, 10) and knows its own joint only. The paper's backward
    operator :math:`R_{i+1,i} P_{i,i+1}` holds the joint of the *next* robot, so the recurrence runs over the force
    that robot i passes inwards, :math:`G_i = C_i^T F_i` with :math:`C_i = P^T R^T`:

    .. math:: G_i = C_i^T G_{i+1} + C_i^T (M \dot V + [\dot M - \dot S M] V - F_{ext}), \quad F_i = C_i^{-T} G_i.

    The messages are as many and as large as the paper's.
    """
    motion = joint_motion(bodies, state)
    r, p = motion.rotation, motion.translation
    outwards = motion_operator(r, p)
    registers = transport.registers(_LAYOUT, state.samples)

    def scan(recurrence: str, matrix: Array, vector: Array) -> Array:
        transport.flush()
        registers["matrix"][:], registers["vector"][:] = matrix.reshape(*vector.shape[:-1], 36), vector
        transport.run(schedule.recurrence(recurrence), _USES, registers)
        return registers["vector"].copy()

    velocity = scan("velocity", outwards, motion.velocity)

    coriolis = velocity_product(p, r, velocity - motion.velocity, motion.velocity, velocity)
    rate = motion.acceleration + coriolis
    if transport.first == 0:
        rate[0] += apply(outwards[0], np.concatenate((np.zeros(3), -gravity)))
    acceleration = scan("acceleration", outwards, rate)

    mass, com = bodies.masses[:, None], bodies.coms[:, None]
    force = body_force(mass, com, bodies.origin_inertias[:, None], velocity, acceleration)
    if state.external is not None:
        force -= state.external
    inwards = transpose(outwards)
    passed = scan("force", inwards, apply(inwards, force))
    force = force_to_child(r, p, passed)
    return InverseDynamics(velocity, acceleration, force, joint_torque(bodies, force))
