"""What the joints alone do: where each places its body, how fast, and the torque it bears (paper, eq. 4-6)."""

from typing import NamedTuple

import numpy as np

from mp2a.model import Model
from mp2a.spatial import Array, apply
from mp2a.validation import JointState


class JointMotion(NamedTuple):
    """What the joints alone do, for each body in its own frame."""

    rotation: Array
    """Body frame to parent frame, ``(n, T, 3, 3)``."""
    translation: Array
    """Body origin in the parent frame, ``(n, T, 3)``, m."""
    velocity: Array
    """``H q̇``, ``(n, T, 6)``."""
    acceleration: Array
    """``H q̈``, ``(n, T, 6)``."""


def joint_motion(model: Model, state: JointState) -> JointMotion:
    """Place every body in its parent and project the joint's rates into its frame, a joint type at a time."""
    n, samples = len(model), state.samples
    rotation, translation = np.empty((n, samples, 3, 3)), np.empty((n, samples, 3))
    velocity, acceleration = np.empty((n, samples, 6)), np.empty((n, samples, 6))
    for group in model.groups:
        at = group.bodies
        turn, shift = group.joint.place(group.axes, state.q[:, group.q_columns].swapaxes(0, 1))
        placement = model.rotations[at, None]
        rotation[at] = placement @ turn
        translation[at] = model.translations[at, None] + apply(placement, shift)
        subspace = group.subspace[:, None]
        velocity[at] = apply(subspace, state.v[:, group.v_columns].swapaxes(0, 1))
        acceleration[at] = apply(subspace, state.a[:, group.v_columns].swapaxes(0, 1))
    return JointMotion(rotation, translation, velocity, acceleration)


def joint_torque(model: Model, force: Array) -> Array:
    """Project body forces ``(n, T, 6)`` on the joints: ``τ = Hᵀ F``, ``(T, nv)`` (paper, after eq. 6)."""
    torque = np.empty((force.shape[1], model.nv))
    for group in model.groups:
        projected = np.einsum("kij,kti->tkj", group.subspace, force[group.bodies])
        torque[:, group.v_columns] = projected
    return torque
