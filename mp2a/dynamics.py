"""What users call: inverse dynamics of a chain in one process."""

from typing import Literal, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from mp2a.algebra import motion
from mp2a.checks import count
from mp2a.exceptions import InputError
from mp2a.joint_kinematics import joint_torque
from mp2a.kernels.tables import NUMBER_FORMATS
from mp2a.methods import METHODS
from mp2a.methods.local import paths_from_base, solve
from mp2a.model import Model
from mp2a.recursion import recursion
from mp2a.results import InverseDynamics
from mp2a.spatial import GRAVITY, Array
from mp2a.validation import check_gravity, check_shapes, check_state, check_values


@overload
def rnea(
    model: Model,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    external_forces: ArrayLike | None = ...,
    gravity: ArrayLike = ...,
    *,
    method: str = ...,
    bodies: Literal[False] = ...,
    threads: int | None = ...,
    dtype: DTypeLike = ...,
    out: Array | None = ...,
) -> Array: ...
@overload
def rnea(
    model: Model,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    external_forces: ArrayLike | None = ...,
    gravity: ArrayLike = ...,
    *,
    method: str = ...,
    bodies: Literal[True],
    threads: int | None = ...,
    dtype: DTypeLike = ...,
    out: InverseDynamics | None = ...,
) -> InverseDynamics: ...
def rnea(
    model: Model,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    external_forces: ArrayLike | None = None,
    gravity: ArrayLike = GRAVITY,
    *,
    method: str = "serial",
    bodies: bool = False,
    threads: int | None = None,
    dtype: DTypeLike = np.float64,
    out: Array | InverseDynamics | None = None,
) -> Array | InverseDynamics:
    """Inverse dynamics of a chain in this process: the joint torques that give these accelerations.

    Parameters
    ----------
    model
        n bodies.
    q
        Coordinates as pinocchio's, ``(nq,)`` or ``(T, nq)`` for T samples; rad and m. Arrays whose samples lie
        together, such as ``x.T`` of an ``(nq, T)`` one, are taken as they are, as those are whose columns do.
    v, a
        Joint velocities and accelerations, ``(nv,)`` or ``(T, nv)``; rad/s, m/s and rad/s², m/s².
    external_forces
        ``[torque; force]`` that act on the bodies, each in the body's frame about its *origin*, ``(n, 6)`` or
        ``(T, n, 6)``, N m and N. `mp2a.spatial.force_at_origin` moves the paper's F_RA there from the centre of mass.
    gravity
        ``(3,)`` m/s² in the base frame.
    method
        "serial", body after body, the fastest in one process; or one of `mp2a.methods.METHODS`, with all n robots in
        this process.
    bodies
        Return motion and force of every body as well.
    threads
        How many threads share the samples of method "serial"; None: as many as are worth it, and no more than this
        process has cores for itself when other ranks run on the machine.
    dtype
        Number format of the result and, with method "serial", of the arithmetic: float64 or float32.
    out
        Array for the torques, of their shape and format; with ``bodies`` what an earlier call with as many samples
        returned. A loop then needs no new memory, which for many bodies takes longer to get than to fill.

    Returns
    -------
    numpy.ndarray or InverseDynamics
        Torques ``(nv,)`` or ``(T, nv)``, N m and N; with ``bodies`` an `InverseDynamics` that holds them. Laid out in
        memory as q, v and a are, if all are laid out alike.

    Raises
    ------
    InputError
        If an argument has the wrong shape, is not finite, a quaternion is not of unit length, or the method is unknown.

    Examples
    --------
    >>> import mp2a
    >>> chain = mp2a.Model.uniform(3, axis=(0, 1, 0))
    >>> mp2a.rnea(chain, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]).round(3).tolist()
    [-44.145, -19.62, -4.905]
    """
    if method != "serial":
        check_method(method)
    if threads is not None:
        count("threads", threads)
    form = _format(dtype)
    state = check_shapes(model, q, v, a, external_forces)
    field = check_gravity(gravity)
    target, rows = _targets(out, (state.samples, len(model)), model.nv, state.single, form, bodies=bodies)
    if method == "serial":
        base = np.zeros(12)
        base[6:9] -= field
        found = recursion(model, state, base, bodies=bodies, threads=threads, dtype=form, out=target, rows=rows)
        return _report(found.torque, found.bodies, state.single)
    check_values(model, state)
    made, _ = solve(METHODS[method], model, state, field)
    torque = joint_torque(model, made.force).astype(form, copy=False)
    if target is not None:
        target[...] = torque
        torque = target
    if state.single:
        torque = torque[0]
    if not bodies:
        return torque
    whole = motion.view(paths_from_base(model, state) if made.path is None else made.path)
    arrays = made.velocity, made.acceleration, made.force, whole.rotation, whole.translation
    v, a, force, rotation, position = (_samples_first(x, state.single).astype(form, copy=False) for x in arrays)
    return InverseDynamics(v, a, force, torque, rotation, position)


def placements(model: Model, q: ArrayLike) -> tuple[Array, Array]:
    """Where the bodies of a chain are, by the rounds of motion alone.

    Parameters
    ----------
    model
        n bodies.
    q
        Coordinates, ``(nq,)`` or ``(T, nq)``; rad and m.

    Returns
    -------
    tuple of numpy.ndarray
        Rotation from the body's to the base frame ``(n, 3, 3)`` and position of its origin ``(n, 3)`` m, with T in
        front if ``q`` has it.

    Raises
    ------
    InputError
        As for `rnea`.
    """
    still = np.zeros((*np.shape(q)[:-1], model.nv))
    state = check_state(model, q, still, still, None)
    whole = motion.view(paths_from_base(model, state))
    rotation, position = (_samples_first(x, state.single) for x in (whole.rotation, whole.translation))
    return rotation, position


def _samples_first(values: Array, single: bool) -> Array:
    """Results ``(n, T, …)`` as ``(T, n, …)``, or as ``(n, …)`` for a single sample."""
    return values[:, 0] if single else values.swapaxes(0, 1)


def _report(torque: Array, bodies: Array | None, single: bool) -> Array | InverseDynamics:
    """Torque alone, or with the bodies' ``(T, n, 18)``."""
    if single:
        torque = torque[0]
    if bodies is None:
        return torque
    velocity, acceleration, force = (bodies[..., k : k + 6] for k in (0, 6, 12))
    if single:
        velocity, acceleration, force = velocity[0], acceleration[0], force[0]
    return InverseDynamics(velocity, acceleration, force, torque)


def _format(dtype: DTypeLike) -> np.dtype:
    try:
        form = np.dtype(dtype)
    except TypeError as error:
        raise InputError(f"dtype: got {dtype!r}, expected float64 or float32") from error
    if form not in NUMBER_FORMATS:
        raise InputError(f"dtype: got {form}, expected float64 or float32")
    return form


def _targets(
    out: Array | InverseDynamics | None, sizes: tuple[int, int], nv: int, single: bool, form: np.dtype, *, bodies: bool
) -> tuple[Array | None, Array | None]:
    """Where the torques go, ``(T, nv)``, and motion and force of the bodies, ``(T, n, 18)``."""
    if out is None:
        return None, None
    if not bodies:
        return _target(out, (sizes[0], nv), single, form), None
    rows = _rows_of(out, sizes, form) if isinstance(out, InverseDynamics) and out.torque.ndim == 2 - single else None
    if rows is None:
        raise InputError(
            f"out: got {type(out).__name__}, expected what an earlier call returned with bodies=True and method "
            f"'serial' for {sizes[0]} samples in {form}"
        )
    assert isinstance(out, InverseDynamics)
    return _target(out.torque, (sizes[0], nv), single, form), rows


def _rows_of(result: InverseDynamics, sizes: tuple[int, int], form: np.dtype) -> Array | None:
    """``(T, n, 18)`` of which a result's arrays are parts; None if they are not."""
    parts = [x if x.ndim == 3 else x[None] for x in (result.velocity, result.acceleration, result.force)]
    first, step = parts[0], form.itemsize
    places = [part.ctypes.data - first.ctypes.data for part in parts]
    alike = all(part.shape == (*sizes, 6) and part.dtype == form and part.strides == first.strides for part in parts)
    if not alike or places != [0, 6 * step, 12 * step] or first.strides[1:] != (18 * step, step):
        return None
    return np.lib.stride_tricks.as_strided(first, (*sizes, 18), first.strides)


def _target(out: object, shape: tuple[int, int], single: bool, form: np.dtype) -> Array:
    wanted = shape[1:] if single else shape
    if not isinstance(out, np.ndarray) or out.shape != wanted or out.dtype != form or not out.flags.writeable:
        given = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else type(out).__name__
        raise InputError(f"out: got {given}, expected a writeable array of {form} {wanted}")
    return out[None] if single else out


def check_method(method: str) -> None:
    """Raise `InputError` for a method that is not in `mp2a.methods.METHODS`."""
    if method not in METHODS:
        raise InputError(f"method: got {method!r}, expected 'serial' or one of {', '.join(map(repr, METHODS))}")
