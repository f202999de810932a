"""The recursive Newton-Euler algorithm, body after body: Luh, Walker and Paul (1980) in body frames.

Compiled kernels run it where there are any, and `rnea_numpy` where there are none or where they find a number that is
not as it should be.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mp2a.joint_kinematics import BaseMotion, drive_forces, joint_motion, joint_torque
from mp2a.kernels import batch, direct, long
from mp2a.model import Model
from mp2a.spatial import Array, body_force, force_to_parent, motion_to_child, velocity_product
from mp2a.validation import JointState, check_values


class Recursion(NamedTuple):
    """What the recursion works out."""

    torque: Array
    """``(T, nv)``, N m and N."""
    bodies: Array | None
    """Velocity, acceleration and force of each body, ``(T, n, 18)``, if asked for; as `mp2a.InverseDynamics` describes
    them."""
    base_force: Array
    """Wrench that the model puts on its base, ``(T, 6)``, in the base's frame and about its origin, N m and N."""


def rnea(
    model: Model,
    state: JointState,
    base: BaseMotion,
    distal_force: Array | None = None,
    *,
    bodies: bool = False,
    threads: int | None = None,
    dtype: np.dtype | type = np.float64,
    out: Array | None = None,
    rows: Array | None = None,
) -> Recursion:
    """Inverse dynamics of a chain or tree whose base moves in a known way.

    Parameters
    ----------
    model, state
        n bodies and their T samples, of which the shapes are checked (`mp2a.validation.check_shapes`).
    base
        Motion of the base.
    distal_force
        ``[torque; force]`` from outside on the last body, in its frame about its origin, ``(T, 6)``, N m and N: of a
        block, minus what the bodies behind it take.
    bodies
        Whether motion and force of every body are asked for.
    threads
        How many share the work; None: as many as this process has cores for itself and the work is worth.
    dtype
        Format of the results and of the arithmetic, float64 or float32.
    out, rows
        Where to put the torque, and motion and force of the bodies. They may overlap the state.

    Raises
    ------
    InputError
        If a number is not finite, or a quaternion, or cosine and sine, are not of length 1.
    """
    form = np.dtype(dtype)
    motion = batch.pack_base(base)
    drives = drive_forces(model, state)
    result: batch.KernelResult | None
    if form == np.float64 and long.fits(model, state.samples):
        result = long.rnea(model, state, motion, distal_force, bodies=bodies, threads=threads)
    else:
        result = batch.rnea(
            model, state, motion, distal_force, bodies=bodies, threads=threads, dtype=form, out=out, rows=rows
        )
    if result is None or not result.valid:
        check_values(model, state)
        torque, table, base_force = rnea_numpy(model, state, base, distal_force)
        assert table is not None
        table = table.astype(form, copy=False) if bodies else None
        torque, base_force = torque.astype(form, copy=False), base_force.astype(form, copy=False)
    else:
        torque, table, base_force = result.torque, result.bodies, result.root.T
    if drives is not None:
        torque += drives
    return Recursion(_put(torque, out), None if table is None else _put(table, rows), base_force)


def rnea_direct(model: Model, q: ArrayLike, v: ArrayLike, a: ArrayLike, out: Any = None) -> Array | None:
    """Inverse dynamics of one sample given as contiguous arrays of doubles, in the model's gravity; None if it is not.

    What a call of `rnea` takes before the kernel runs is ten times what the kernel takes for an arm of seven joints.
    """
    run = direct.RNEA.get(model)
    if run is None:
        return None
    torque = np.empty(model.nv) if out is None else out
    return torque if run(torque, q, v, a) else None


def _put(values: Array, where: Array | None) -> Array:
    if where is None or where is values:
        return values
    where[...] = values
    return where


def rnea_numpy(model: Model, state: JointState, base: BaseMotion, distal_force: Array | None = None) -> Recursion:
    """Do what `rnea` does, in double, for numbers that were checked."""
    joint = joint_motion(model, state)
    n, samples = len(model), state.samples
    velocity, acceleration = np.empty((n, samples, 6)), np.empty((n, samples, 6))
    for i, parent in enumerate(model.parents):
        r, p, relative = joint.rotation[i], joint.translation[i], joint.velocity[i]
        from_velocity, from_acceleration = (velocity[parent], acceleration[parent]) if parent >= 0 else base
        carried = motion_to_child(r, p, from_velocity)
        velocity[i] = carried + relative
        acceleration[i] = (
            motion_to_child(r, p, from_acceleration)
            + velocity_product(p, r, carried, relative, velocity[i])
            + joint.acceleration[i]
        )
    mass, com = model.masses[:, None], model.coms[:, None]
    force = body_force(mass, com, model.origin_inertias[:, None], velocity, acceleration)
    if state.external is not None:
        force -= state.external
    if distal_force is not None:
        force[-1] -= distal_force
    base_force = np.zeros((samples, 6))
    for i in range(n - 1, -1, -1):
        passed = force_to_parent(joint.rotation[i], joint.translation[i], force[i])
        if model.parents[i] >= 0:
            force[model.parents[i]] += passed
        else:
            base_force += passed
    table = np.concatenate((velocity, acceleration, force), axis=2).swapaxes(0, 1)
    return Recursion(joint_torque(model, force), table, base_force)
