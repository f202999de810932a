"""The articulated-body algorithm, body after body: Featherstone (1983; 2008, chapter 7) in body frames.

Compiled kernels run it where there are any, and `aba_numpy` where there are none or where they find a number that is
not as it should be.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mp2a.exceptions import InputError
from mp2a.joint_kinematics import BaseMotion, JointMotion, joint_forces, joint_motion
from mp2a.kernels import batch, direct
from mp2a.model import Model
from mp2a.spatial import (
    Array,
    apply,
    body_force,
    motion_operator,
    motion_to_child,
    spatial_inertia,
    transpose,
    velocity_product,
)
from mp2a.validation import JointState, check_values

_DIGITS = 8 * np.finfo(float).eps
"""What is left of an inertia after so much of it was taken off has no digits any more."""


def aba(
    model: Model,
    state: JointState,
    base: BaseMotion,
    *,
    threads: int | None = None,
    dtype: np.dtype | type = np.float64,
    out: Array | None = None,
) -> Array:
    """Forward dynamics of a chain or tree whose base moves in a known way.

    Parameters
    ----------
    model, base, threads, dtype
        As `mp2a.serial.rnea.rnea` takes them.
    state
        T samples, of which the shapes are checked, with the joint forces τ in the place of accelerations.
    out
        Where to put the joint accelerations. It may overlap the state.

    Returns
    -------
    numpy.ndarray
        Joint accelerations ``(T, nv)``, rad/s² and m/s².

    Raises
    ------
    InputError
        If a number is not finite, a quaternion, or cosine and sine, are not of length 1, or nothing resists a joint.
    """
    form, forces = np.dtype(dtype), joint_forces(model, state.q, state.v)
    if forces is not None:
        state = state._replace(a=state.a - forces)
    result = batch.aba(model, state, batch.pack_base(base), threads=threads, dtype=form, out=out)
    if result is not None and result.valid:
        acceleration = result.acceleration
    else:
        check_values(model, state)
        acceleration = aba_numpy(model, state, base).astype(form, copy=False)
    if out is None or out is acceleration:
        return acceleration
    out[...] = acceleration
    return out


def aba_direct(model: Model, q: ArrayLike, v: ArrayLike, tau: ArrayLike, out: Any = None) -> Array | None:
    """Forward dynamics of one sample given as contiguous arrays of doubles, in the model's gravity; None if it is not.

    See `mp2a.serial.rnea.rnea_direct`.
    """
    run = direct.ABA.get(model)
    if run is None:
        return None
    acceleration = np.empty(model.nv) if out is None else out
    return acceleration if run(acceleration, q, v, tau) else None


def aba_numpy(model: Model, state: JointState, base: BaseMotion) -> Array:
    """Do what `aba` does, in double, for numbers that were checked.

    A joint with several degrees of freedom counts as several of one in a row, with nothing between them: each takes its
    direction h out of the inertia of what hangs on it, which is all that an axis does.
    """
    joint = joint_motion(model, state)
    coriolis, bias = _velocity_terms(model, state, joint, base)
    inertia = np.repeat(
        spatial_inertia(model.masses, model.coms, model.origin_inertias)[:, None], state.samples, axis=1
    )
    transforms = motion_operator(joint.rotation, joint.translation)
    axes, starts = _axes(model), model.v_starts
    gains, rests = np.empty((model.nv, state.samples, 6)), np.empty((model.nv, state.samples))
    for i in range(len(model) - 1, -1, -1):
        felt, load = inertia[i], bias[i]
        for k in range(starts[i], starts[i + 1]):
            along = felt @ axes[k]
            resistance = along @ axes[k] + model.armature[k]
            _check_resistance(model, i, axes[k], felt, resistance)
            gains[k] = along / resistance[:, None]
            rests[k] = (state.a[:, k] - load @ axes[k]) / resistance
            felt = felt - along[:, :, None] * gains[k][:, None, :]
            load = load + along * rests[k][:, None]
        if (parent := model.parents[i]) >= 0:
            to_parent = transpose(transforms[i])
            inertia[parent] += to_parent @ felt @ transforms[i]
            bias[parent] += apply(to_parent, load + apply(felt, coriolis[i]))
    return _accelerations(model, joint, base, coriolis, (axes, gains, rests))


def _velocity_terms(model: Model, state: JointState, joint: JointMotion, base: BaseMotion) -> tuple[Array, Array]:
    """Accelerations and forces ``(n, T, 6)`` that velocities and forces from outside bring about."""
    n, samples = len(model), state.samples
    velocity, coriolis = np.empty((n, samples, 6)), np.empty((n, samples, 6))
    for i, parent in enumerate(model.parents):
        r, p, relative = joint.rotation[i], joint.translation[i], joint.velocity[i]
        carried = motion_to_child(r, p, velocity[parent] if parent >= 0 else base.velocity)
        velocity[i] = carried + relative
        coriolis[i] = velocity_product(p, r, carried, relative, velocity[i])
    mass, com = model.masses[:, None], model.coms[:, None]
    bias = body_force(mass, com, model.origin_inertias[:, None], velocity, np.zeros_like(velocity))
    return coriolis, bias if state.external is None else bias - state.external


def _accelerations(
    model: Model, joint: JointMotion, base: BaseMotion, coriolis: Array, axes: tuple[Array, Array, Array]
) -> Array:
    """Accelerations of the joints ``(T, nv)``, from the base outwards."""
    directions, gains, rests = axes
    bodies, joints = np.empty_like(coriolis), np.empty((coriolis.shape[1], model.nv))
    for i, parent in enumerate(model.parents):
        outer = bodies[parent] if parent >= 0 else base.acceleration
        motion = motion_to_child(joint.rotation[i], joint.translation[i], outer) + coriolis[i]
        for k in range(model.v_starts[i + 1] - 1, model.v_starts[i] - 1, -1):
            joints[:, k] = rests[k] - np.sum(gains[k] * motion, axis=-1)
            motion = motion + joints[:, k, None] * directions[k]
        bodies[i] = motion
    return joints


def _axes(model: Model) -> Array:
    """Direction of each degree of freedom in its body's frame, ``(nv, 6)``: the columns of all H."""
    axes = np.empty((model.nv, 6))
    for group in model.groups:
        axes[group.v_columns] = group.subspace.swapaxes(1, 2)
    return axes


def _check_resistance(model: Model, body: int, axis: Array, inertia: Array, resistance: Array) -> None:
    """Raise `InputError` where nothing resists a joint along an axis, and any force would do anything."""
    angular, linear = (np.trace(inertia[:, part, part], axis1=1, axis2=2) for part in (slice(3), slice(3, 6)))
    whole = (axis[:3] @ axis[:3]) * angular + (axis[3:] @ axis[3:]) * linear
    if (loose := resistance <= _DIGITS * whole).any():
        sample = int(np.argmax(loose))
        raise InputError(
            f"model: got nothing that resists {model.joints[body]} joint {model.names[body]!r} in sample {sample} (its "
            f"inertia is {resistance[sample]:.3g}), expected mass or armature that it has to move"
        )
