"""The fewest bytes: one scan of motion outwards, then one of forces inwards, on a chain or a tree."""

import numpy as np

from mp2a import kernels
from mp2a.chain import Chain
from mp2a.leaf import State, joint_motion, joint_torque
from mp2a.methods.result import InverseDynamics
from mp2a.methods.sweep import add, read_off
from mp2a.schedule import FORCE, MOTION, Schedule
from mp2a.segments import motion
from mp2a.spatial import Array, body_force, spatial_to_classical
from mp2a.transport.base import Transport

DOUBLES = {MOTION: motion.DOUBLES, FORCE: 6}


def compact(bodies: Chain, state: State, gravity: Array, schedule: Schedule, transport: Transport) -> InverseDynamics:
    """Inverse dynamics of the bodies this process holds.

    A body remembers the path to its 2^e-th ancestor of every round. With it, it carries its force itself to where it
    sends it, so that a force is 6 numbers on the wire.
    """
    *paths, whole = paths_outwards(bodies, state, schedule, transport)
    velocity, acceleration = read_off(whole, gravity)
    classical = spatial_to_classical(acceleration, velocity)
    mass, com = bodies.masses[:, None], bodies.coms[:, None]
    force = body_force(mass, com, bodies.origin_inertias[:, None], velocity, classical)
    if state.external is not None:
        force -= state.external
    for round_, path in zip(schedule.recurrence("force"), paths, strict=True):
        carried = np.empty_like(force)
        for nodes in transport.senders(round_, FORCE):
            carried[nodes] = kernels.carry(path[nodes], force[nodes])
        for _, nodes, data in transport.exchange(round_, {FORCE: carried}):
            add(force, nodes, data.reshape(-1, state.samples, 6))
    place = motion.view(whole)
    return InverseDynamics(velocity, classical, force, joint_torque(bodies, force), place.rotation, place.translation)


def paths_outwards(bodies: Chain, state: State, schedule: Schedule, transport: Transport) -> list[Array]:
    """Scan of motion: each body's paths ``(n, T, 24)`` from its 2^e-th ancestor, e = 0, 1, …; the last, from the base.

    The schedule is `mp2a.schedule.compact` or its rounds of motion alone.
    """
    joint = joint_motion(bodies, state)
    paths = [motion.leaf(joint)]
    for round_ in schedule.recurrence("motion"):
        arrivals = transport.exchange(round_, {MOTION: paths[-1]})
        longer = paths[-1].copy()
        for _, nodes, data in arrivals:
            longer[nodes] = kernels.compose(data.reshape(-1, state.samples, motion.DOUBLES), longer[nodes])
        paths.append(longer)
    return paths
