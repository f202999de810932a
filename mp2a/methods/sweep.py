"""The whole inverse dynamics in one set of rounds, on a chain or a tree (theory, section 4)."""

import numpy as np

from mp2a import kernels
from mp2a.chain import Chain
from mp2a.leaf import State, joint_motion, joint_torque
from mp2a.methods.result import InverseDynamics
from mp2a.schedule import FORCE, MOTION, Schedule
from mp2a.segments import load, motion
from mp2a.segments.motion import view
from mp2a.spatial import Array, apply, spatial_to_classical, transpose
from mp2a.transport.base import Nodes, Transport

DOUBLES = {MOTION: motion.DOUBLES, FORCE: load.DOUBLES}


def sweep(bodies: Chain, state: State, gravity: Array, schedule: Schedule, transport: Transport) -> InverseDynamics:
    """Inverse dynamics of the bodies this process holds.

    A body keeps two segments: its motion across the path from its 2^e-th ancestor, and the load of all bodies fewer
    than 2^e below it. In a round it hands the first to those whose 2^e-th ancestor it is and the second, moved across
    the first, to its own; neither waits for the other.
    """
    joint = joint_motion(bodies, state)
    path = motion.leaf(joint)
    below = load.leaf(bodies.masses, bodies.coms, bodies.origin_inertias, state.external, state.samples)
    for round_ in schedule.rounds:
        upwards = np.empty_like(below)
        for nodes in transport.senders(round_, FORCE):
            upwards[nodes] = kernels.move(below[nodes], path[nodes])
        arrivals = transport.exchange(round_, {MOTION: path, FORCE: upwards})
        path = path.copy()  # the old one may still be on its way
        for kind, nodes, data in arrivals:
            if kind == MOTION:
                path[nodes] = kernels.compose(data.reshape(-1, state.samples, motion.DOUBLES), path[nodes])
            else:
                add(below, nodes, data.reshape(-1, state.samples, load.DOUBLES))
    velocity, acceleration = read_off(path, gravity)
    force = kernels.force(below, velocity, acceleration)
    classical, torque, whole = spatial_to_classical(acceleration, velocity), joint_torque(bodies, force), view(path)
    return InverseDynamics(velocity, classical, force, torque, whole.rotation, whole.translation)


def read_off(path: Array, gravity: Array) -> tuple[Array, Array]:
    """Velocity and spatial acceleration ``(n, T, 6)`` of bodies whose paths reach the base, which falls with -g."""
    whole = view(path)
    acceleration = whole.acceleration.copy()
    acceleration[..., 3:] -= apply(transpose(whole.rotation), np.broadcast_to(gravity, (*path.shape[:-1], 3)))
    return whole.velocity, acceleration


def add(total: Array, nodes: Nodes, parts: Array) -> None:
    """Add what arrived to the receivers; a body of a tree may get several parts in a round."""
    if isinstance(nodes, slice):
        total[nodes] += parts
    else:
        np.add.at(total, nodes, parts)
