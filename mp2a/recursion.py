"""The O(n) recursion of one process, body after body: Luh, Walker and Paul (1980) in body frames.

Compiled kernels do it where there are any, and numpy where there are none or something given to them is invalid.
"""

from typing import NamedTuple

import numpy as np

from mp2a import kernels
from mp2a.algebra import inertia, motion
from mp2a.joint_kinematics import joint_motion, joint_torque
from mp2a.kernels import batch, long
from mp2a.model import Model
from mp2a.spatial import Array, body_force, force_to_parent, motion_to_child, velocity_product
from mp2a.validation import JointState, check_values


class Found(NamedTuple):
    """What the recursion finds."""

    torque: Array
    """``(T, nv)``, N m and N."""
    bodies: Array | None
    """Velocity, acceleration and force of each body, ``(T, n, 18)``, if asked for; as
    `mp2a.results.InverseDynamics` describes them."""
    root: Array
    """Wrench that the chain puts on its base, ``(6, T)``, in the base's frame and about its origin, N m and N."""


def recursion(
    model: Model,
    state: JointState,
    base: Array,
    tip: Array | None = None,
    *,
    bodies: bool = False,
    threads: int | None = None,
    dtype: np.dtype | type = np.float64,
    out: Array | None = None,
    rows: Array | None = None,
) -> Found:
    """Inverse dynamics of a chain or tree whose base moves as it is told.

    Parameters
    ----------
    model, state
        n bodies and their T samples, of which the shapes are checked (`mp2a.validation.check_shapes`).
    base
        Motion of the base, ``(12,)`` or ``(T, 12)``: its angular velocity and acceleration, the acceleration of its
        origin less gravity, and the velocity of its origin; rad/s, rad/s², m/s², m/s.
    tip
        ``[torque; force]`` from outside on the last body, in its frame about its origin, ``(T, 6)``, N m and N.
    bodies
        Whether motion and force of every body are asked for.
    threads
        How many share the work; None: as many as this process has cores for itself and the work is worth.
    dtype
        Format of the results and of the arithmetic, float64 or float32.
    out, rows
        Where to put the torque, and motion and force of the bodies.

    Raises
    ------
    InputError
        If a number is not finite, or a quaternion, or cosine and sine, are not of length 1.
    """
    form = np.dtype(dtype)
    found: batch.KernelResult | None
    if form == np.float64 and long.fits(model, state.samples):
        found = long.rnea(model, state, base, tip, bodies=bodies, threads=threads)
    else:
        found = batch.rnea(model, state, base, tip, bodies=bodies, threads=threads, dtype=form, out=out, rows=rows)
    if found is None or not found.valid:
        check_values(model, state)
        torque, moving, root = by_numpy(model, state, base, tip)
        assert moving is not None
        moving = moving.astype(form, copy=False) if bodies else None
        torque, root = torque.astype(form, copy=False), root.astype(form, copy=False)
    else:
        torque, moving, root, _ = found
    return Found(_put(torque, out), None if moving is None else _put(moving, rows), root)


def _put(found: Array, where: Array | None) -> Array:
    if where is None or where is found:
        return found
    where[...] = found
    return where


def by_numpy(model: Model, state: JointState, base: Array, tip: Array | None = None) -> Found:
    """Do what `recursion` does, in double, for numbers that were checked."""
    joint = joint_motion(model, state)
    n, samples = len(model), state.samples
    velocity, acceleration = np.empty((n, samples, 6)), np.empty((n, samples, 6))
    ground = np.broadcast_to(base, (samples, 12))
    ground_velocity, ground_acceleration = ground[:, [0, 1, 2, 9, 10, 11]], ground[:, 3:9]
    for i, parent in enumerate(model.parents):
        r, p, relative = joint.rotation[i], joint.translation[i], joint.velocity[i]
        carried = motion_to_child(r, p, velocity[parent] if parent >= 0 else ground_velocity)
        velocity[i] = carried + relative
        acceleration[i] = (
            motion_to_child(r, p, acceleration[parent] if parent >= 0 else ground_acceleration)
            + velocity_product(p, r, carried, relative, velocity[i])
            + joint.acceleration[i]
        )
    mass, com = model.masses[:, None], model.coms[:, None]
    force = body_force(mass, com, model.origin_inertias[:, None], velocity, acceleration)
    if state.external is not None:
        force -= state.external
    if tip is not None:
        force[-1] -= tip
    root = np.zeros((samples, 6))
    for i in range(n - 1, -1, -1):
        passed = force_to_parent(joint.rotation[i], joint.translation[i], force[i])
        if model.parents[i] >= 0:
            force[model.parents[i]] += passed
        else:
            root += passed
    rows = np.concatenate((velocity, acceleration, force), axis=2).swapaxes(0, 1)
    return Found(joint_torque(model, force), rows, root.T)


def segment(model: Model, state: JointState, *, loaded: bool, threads: int | None = None) -> tuple[Array, Array | None]:
    """Put the bodies of a serial chain together.

    Parameters
    ----------
    model, state, threads
        As `recursion` takes them, with numbers that were checked.
    loaded
        Whether the load is asked for, not the path alone.

    Returns
    -------
    path
        From what the chain hangs on to its last body, ``(T, 24)``, as `mp2a.algebra.motion` has it.
    load
        About what the chain hangs on, ``(T, 28)``, as `mp2a.algebra.inertia` has it; None if it is not asked for.
    """
    reduce = long.reduce_block if long.fits(model, state.samples) else batch.reduce_block
    found = reduce(model, state, inertia=loaded, threads=threads)
    if found is not None and found.valid:
        return found.path, found.inertia
    return segment_by_numpy(model, state)


def segment_by_numpy(model: Model, state: JointState) -> tuple[Array, Array]:
    """Do what `segment` does, with the load."""
    paths = motion.from_joint(joint_motion(model, state))
    loads = inertia.from_body(model.masses, model.coms, model.origin_inertias, state.external, state.samples)
    whole, below = paths[0], kernels.transform(loads[-1], paths[-1])
    for path in paths[1:]:
        whole = kernels.compose(whole, path)
    for path, own in zip(paths[-2::-1], loads[-2::-1], strict=True):
        below = kernels.transform(below + own, path)
    return whole, below
