"""The paper's method: three Kogge-Stone scans of affine maps over 6×6 operators (eq. 4-10, figures 4-6)."""

import numpy as np

from mp2a.chain import Chain
from mp2a.leaf import State, joint_motion, joint_torque
from mp2a.methods.result import InverseDynamics
from mp2a.schedule import Round, Schedule
from mp2a.segments import affine
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
    current, spare = (affine.window(len(bodies), state.samples) for _ in range(2))

    def scan(recurrence: str, matrix: Array, vector: Array) -> Array:
        nonlocal current, spare
        transport.flush()
        current.matrix[:], current.vector[:] = matrix, vector
        current, spare = _scan(schedule.recurrence(recurrence), current, spare, transport)
        return current.vector.copy()

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


def _scan(
    rounds: tuple[Round, ...], current: affine.Window, spare: affine.Window, transport: Transport
) -> tuple[affine.Window, affine.Window]:
    """Recursive doubling; returns the windows that reach the end of the chain, and the other ones."""
    for round_ in rounds:
        arrivals = transport.exchange(round_, current.outbox())
        if not arrivals:
            continue
        if transport.nodes > 1:  # some nodes got nothing and keep what they have
            np.copyto(spare.buffer, current.buffer)
        for kind, nodes, data in arrivals:
            assert isinstance(nodes, slice)  # on a chain receivers are neighbours
            affine.join(current, kind, nodes, data, out=spare)
        current, spare = spare, current
    return current, spare
