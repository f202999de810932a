"""The O(n) recursion of one process, body after body: Luh, Walker and Paul (1980) in body frames."""

import numpy as np

from mp2a.chain import Chain
from mp2a.leaf import State, joint_motion, joint_torque
from mp2a.methods.result import InverseDynamics
from mp2a.spatial import Array, apply, body_force, force_to_parent, motion_to_child, velocity_product


def serial(chain: Chain, state: State, gravity: Array) -> InverseDynamics:
    """Inverse dynamics of a chain or tree, outwards over the bodies for motion, inwards for force."""
    motion = joint_motion(chain, state)
    n, samples = len(chain), state.samples
    velocity, acceleration = np.empty((n, samples, 6)), np.empty((n, samples, 6))
    at_rest = np.zeros((samples, 6))
    falling = np.tile(np.concatenate((np.zeros(3), -gravity)), (samples, 1))
    rotation, position = motion.rotation.copy(), motion.translation.copy()
    for i, parent in enumerate(chain.parents):
        r, p, relative = motion.rotation[i], motion.translation[i], motion.velocity[i]
        if parent >= 0:
            rotation[i] = rotation[parent] @ r
            position[i] = position[parent] + apply(rotation[parent], p)
        carried = motion_to_child(r, p, velocity[parent] if parent >= 0 else at_rest)
        velocity[i] = carried + relative
        acceleration[i] = (
            motion_to_child(r, p, acceleration[parent] if parent >= 0 else falling)
            + velocity_product(p, r, carried, relative, velocity[i])
            + motion.acceleration[i]
        )
    mass, com = chain.masses[:, None], chain.coms[:, None]
    force = body_force(mass, com, chain.origin_inertias[:, None], velocity, acceleration)
    if state.external is not None:
        force -= state.external
    for i in range(n - 1, -1, -1):
        if chain.parents[i] >= 0:
            force[chain.parents[i]] += force_to_parent(motion.rotation[i], motion.translation[i], force[i])
    return InverseDynamics(velocity, acceleration, force, joint_torque(chain, force), rotation, position)
