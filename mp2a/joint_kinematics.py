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


class BaseMotion(NamedTuple):
    """Motion of what a model hangs on, in its own frame at its own origin; ``(6,)`` or ``(T, 6)`` each."""

    velocity: Array
    """``[ω; v]``, rad/s and m/s."""
    acceleration: Array
    """``[ω̇; v̇]``, classical and less gravity, rad/s² and m/s²: what an accelerometer reads."""

    @classmethod
    def at_rest(cls, gravity: Array) -> "BaseMotion":
        """Motion of a base that stands still in a field ``(3,)`` m/s², which feels like an acceleration against it."""
        velocity, acceleration = np.zeros((2, 6))
        np.negative(gravity, out=acceleration[3:])
        return cls(velocity, acceleration)


def joint_transforms(model: Model, q: Array) -> tuple[Array, Array]:
    """Place every body in its parent for coordinates ``(T, nq)``: ``(n, T, 3, 3)`` and ``(n, T, 3)`` m."""
    n, samples = len(model), len(q)
    rotation, translation = np.empty((n, samples, 3, 3)), np.empty((n, samples, 3))
    for group in model.groups:
        at = group.bodies
        turn, shift = group.joint.transform(group.axes, q[:, group.q_columns].swapaxes(0, 1))
        at_rest = model.rotations[at, None]
        rotation[at] = at_rest @ turn
        translation[at] = model.translations[at, None] + apply(at_rest, shift)
    return rotation, translation


def joint_motion(model: Model, state: JointState) -> JointMotion:
    """Place every body in its parent and project the joint's rates into its frame, a joint type at a time."""
    n, samples = len(model), state.samples
    velocity, acceleration = np.empty((n, samples, 6)), np.empty((n, samples, 6))
    for group in model.groups:
        subspace = group.subspace[:, None]
        velocity[group.bodies] = apply(subspace, state.v[:, group.v_columns].swapaxes(0, 1))
        acceleration[group.bodies] = apply(subspace, state.a[:, group.v_columns].swapaxes(0, 1))
    return JointMotion(*joint_transforms(model, state.q), velocity, acceleration)


def joint_torque(model: Model, force: Array) -> Array:
    """Project body forces ``(n, T, 6)`` on the joints: ``Hᵀ F``, ``(T, nv)`` (paper, after eq. 6)."""
    torque = np.empty((force.shape[1], model.nv))
    for group in model.groups:
        projected = np.einsum("kij,kti->tkj", group.subspace, force[group.bodies])
        torque[:, group.v_columns] = projected
    return torque


def coordinate_difference(model: Model, start: Array, end: Array) -> Array:
    """Velocities ``(T, nv)`` that lead from coordinates ``(T or 1, nq)`` to others in a unit of time."""
    out = np.empty((max(len(start), len(end)), model.nv))
    for group in model.groups:
        out[:, group.v_columns] = group.joint.difference(start[:, group.q_columns], end[:, group.q_columns])
    return out


def joint_forces(model: Model, q: Array, v: Array) -> Array | None:
    """Return the forces that dampers, springs and friction of the joints take, ``(T, nv)`` N m and N, if there are any.

    ``damping q̇ + friction sign(q̇) + stiffness (q - rest)``, the difference being `coordinate_difference`.
    """
    if not model.has_joint_forces:
        return None
    with np.errstate(invalid="ignore"):  # what is not finite is found and named elsewhere
        out: Array = model.damping * v + model.friction * np.sign(v)
        if model.stiffness.any():
            out += model.stiffness * coordinate_difference(model, model.rest[None], q)
    return out


def drive_forces(model: Model, state: JointState) -> Array | None:
    """`joint_forces`, and those that accelerate the armatures; None if there are none."""
    forces = joint_forces(model, state.q, state.v)
    if not model.armature.any():
        return forces
    accelerating: Array = model.armature * state.a
    return accelerating if forces is None else accelerating + forces
