"""What users call in one process: inverse dynamics and placements of a chain or tree."""

from functools import partial
from typing import TYPE_CHECKING, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from mp2a import serial
from mp2a.checks import count
from mp2a.exceptions import InputError
from mp2a.joint_kinematics import BaseMotion, drive_forces, joint_torque
from mp2a.kernels.tables import NUMBER_FORMATS
from mp2a.methods import METHODS
from mp2a.methods.local import solve_locally
from mp2a.model import Model
from mp2a.results import InverseDynamics, Placement
from mp2a.spatial import Array
from mp2a.validation import (
    JointState,
    check_coordinate_shape,
    check_gravity,
    check_model,
    check_shapes,
    check_values,
)

if TYPE_CHECKING:
    import pinocchio


@overload
def rnea(
    model: "Model | pinocchio.Model",
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    external_forces: ArrayLike | None = ...,
    gravity: ArrayLike | None = ...,
    *,
    method: str = ...,
    bodies: Literal[False] = ...,
    threads: int | None = ...,
    dtype: DTypeLike = ...,
    out: Array | None = ...,
) -> Array: ...
@overload
def rnea(
    model: "Model | pinocchio.Model",
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    external_forces: ArrayLike | None = ...,
    gravity: ArrayLike | None = ...,
    *,
    method: str = ...,
    bodies: Literal[True],
    threads: int | None = ...,
    dtype: DTypeLike = ...,
    out: InverseDynamics | None = ...,
) -> InverseDynamics: ...
def rnea(
    model: "Model | pinocchio.Model",
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    external_forces: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    *,
    method: str = "serial",
    bodies: bool = False,
    threads: int | None = None,
    dtype: DTypeLike = np.float64,
    out: Array | InverseDynamics | None = None,
) -> Array | InverseDynamics:
    """Compute the joint torques that give these accelerations: inverse dynamics in this process.

    Parameters
    ----------
    model
        n bodies. A `pinocchio.Model` is converted; the conversion is kept while that model lives and stays the same.
    q
        The coordinates, as pinocchio's, ``(nq,)`` or ``(T, nq)`` for T samples; rad and m. Arrays whose samples lie
        together, such as ``x.T`` of an ``(nq, T)`` one, are taken as they are, as those are whose columns do.
    v, a
        Joint velocities and accelerations, ``(nv,)`` or ``(T, nv)``; rad/s, m/s and rad/s², m/s².
    external_forces
        ``[torque; force]`` that act on the bodies, each in the body's frame about its *origin*, ``(n, 6)`` or
        ``(T, n, 6)``, N m and N. `mp2a.spatial.force_at_origin` moves the paper's F_RA there from the centre of mass.
    gravity
        ``(3,)`` m/s² in the base frame; None: the model's own.
    method
        "serial", body after body, the fastest in one process; or one of `mp2a.methods.METHODS`, with all n robots in
        this process.
    bodies
        Return motion and force of every body as well.
    threads
        The number of threads that share the samples of method "serial"; None: as many as are worth it, and no more
        than this process has cores for itself when other ranks run on the machine.
    dtype
        The number format of the result and, with method "serial", of the arithmetic: float64 or float32.
    out
        An array for the torques, of their shape and format; with ``bodies`` what an earlier call with as many samples
        returned, all of which is filled again. It is returned. A loop then needs no new memory, which for many bodies
        takes longer to get than to fill. It may overlap the input.

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
    >>> model = mp2a.Model.uniform(3, axis=(0, 1, 0))
    >>> mp2a.rnea(model, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]).round(3).tolist()
    [-44.145, -19.62, -4.905]
    """
    if (
        method == "serial"
        and external_forces is None
        and gravity is None
        and threads is None
        and dtype is np.float64
        and not bodies
        and type(model) is Model
    ):
        torque = serial.rnea_direct(model, q, v, a, out)
        if torque is not None:
            return torque
    if method != "serial":
        check_method(method)
    if threads is not None:
        count("threads", threads)
    form = number_format(dtype)
    model = check_model(model)
    state = check_shapes(model, q, v, a, external_forces)
    field = check_gravity(model, gravity)
    torque_out, table_out = _targets(out, state, len(model), form, bodies=bodies)
    # Now, for the results may go where q is, and a caller may change q before the placements are asked for.
    places = partial(_place, model, state.q.copy(), state.single, form) if bodies else None
    if method == "serial":
        torque, table, _ = serial.rnea(
            model, state, BaseMotion.at_rest(field), bodies=bodies, threads=threads, dtype=form, out=torque_out,
            rows=table_out,
        )  # fmt: skip
    else:
        check_values(model, state)
        torque, table = _by_messages(method, model, state, field, form, (torque_out, table_out), bodies=bodies)
    if table is None or places is None:
        if out is not None:
            return out
        return torque[0] if state.single else torque
    if isinstance(out, InverseDynamics):
        out.defer_placement(places)
        return out
    if state.single:
        torque, table = torque[0], table[0]
    return InverseDynamics(table[..., :6], table[..., 6:12], table[..., 12:], torque, places)


def _by_messages(
    method: str, model: Model, state: JointState, gravity: Array, form: np.dtype,
    targets: tuple[Array | None, Array | None], *, bodies: bool,
) -> tuple[Array, Array | None]:  # fmt: skip
    """Torques ``(T, nv)``, and motion and force ``(T, n, 18)``, of robots that exchange messages in this process."""
    scan, _ = solve_locally(METHODS[method], model, state, gravity)
    torques, drives = joint_torque(model, scan.force), drive_forces(model, state)
    if drives is not None:
        torques += drives
    torque, table = targets
    if torque is None:
        torque = torques.astype(form, copy=False)
    else:
        torque[...] = torques
    if not bodies:
        return torque, None
    if table is None:
        table = np.empty((state.samples, len(model), 18), form)
    for k, part in enumerate((scan.velocity, scan.acceleration, scan.force)):
        table[..., 6 * k : 6 * k + 6] = part.swapaxes(0, 1)
    return torque, table


def placements(
    model: "Model | pinocchio.Model", q: ArrayLike, *, threads: int | None = None, out: Placement | None = None
) -> Placement:
    """Tell where the bodies of a chain or tree are.

    Parameters
    ----------
    model
        n bodies, as `rnea` takes them.
    q
        Coordinates, ``(nq,)`` or ``(T, nq)``; rad and m. Either layout in memory is taken as it is, as by `rnea`.
    threads
        The number of threads that share the samples, as in `rnea`.
    out
        What an earlier call with as many samples returned, to be filled again and returned.

    Returns
    -------
    Placement
        Rotations from the bodies' to the base frame ``(n, 3, 3)`` and positions of their origins ``(n, 3)`` m, with T
        in front if ``q`` has it.

    Raises
    ------
    InputError
        As for `rnea`.
    """
    if threads is None and type(model) is Model:
        placement = serial.placements_direct(model, q, out)
        if placement is not None:
            return placement
    if threads is not None:
        count("threads", threads)
    model = check_model(model)
    coordinates = check_coordinate_shape(model, q)
    lead = coordinates.shape[:-1]
    target = None if out is None else _placement_target(out, (*lead, len(model)))
    if target is not None and any(np.may_share_memory(part, coordinates) for part in target):
        coordinates = coordinates.copy()
    samples = coordinates.reshape(-1, model.nq)
    if target is not None:
        target = Placement(*(part.reshape(len(samples), *part.shape[len(lead) :]) for part in target))
    whole = serial.placements(model, samples, threads=threads, out=target)
    return out if out is not None else Placement(*(part.reshape(*lead, *part.shape[1:]) for part in whole))


def _placement_target(out: object, lead: tuple[int, ...]) -> Placement:
    shapes = (*lead, 3, 3), (*lead, 3)
    if isinstance(out, Placement) and all(
        isinstance(part, np.ndarray) and part.shape == shape and part.dtype == np.float64 and part.flags.carray
        for part, shape in zip(out, shapes, strict=True)
    ):
        return out
    raise InputError(f"out: got {type(out).__name__}, expected what an earlier call returned for {shapes[1]} positions")


def _place(model: Model, q: Array, single: bool, form: np.dtype) -> Placement:
    whole = serial.placements(model, q)
    return Placement(*(x.astype(form, copy=False)[0 if single else slice(None)] for x in whole))


def number_format(dtype: DTypeLike) -> np.dtype:
    """Return the number format that a caller asks for, or raise `InputError`."""
    try:
        form = np.dtype(dtype)
    except TypeError as error:
        raise InputError(f"dtype: got {dtype!r}, expected float64 or float32") from error
    if form not in NUMBER_FORMATS:
        raise InputError(f"dtype: got {form}, expected float64 or float32")
    return form


def _targets(
    out: Array | InverseDynamics | None, state: JointState, n: int, form: np.dtype, *, bodies: bool
) -> tuple[Array | None, Array | None]:
    """Where the torques go, ``(T, nv)``, and motion and force of the bodies, ``(T, n, 18)``."""
    if out is None:
        return None, None
    if not bodies:
        return joint_target(out, state, form), None
    sizes = state.samples, n
    table = _table_of(out, sizes, form) if isinstance(out, InverseDynamics) else None
    if table is None or out.torque.ndim != 2 - state.single:  # type: ignore[union-attr]
        raise InputError(
            f"out: got {type(out).__name__}, expected what an earlier call returned with bodies=True for "
            f"{sizes[0]} samples in {form}"
        )
    assert isinstance(out, InverseDynamics)
    torque = joint_target(out.torque, state, form)
    if np.may_share_memory(torque, table):
        raise InputError("out: got a torque that shares memory with motion or force, expected arrays of their own")
    return torque, table


def _table_of(result: InverseDynamics, sizes: tuple[int, int], form: np.dtype) -> Array | None:
    """``(T, n, 18)`` of which a result's arrays are parts; None if they are not."""
    parts = [x if x.ndim == 3 else x[None] for x in (result.velocity, result.acceleration, result.force)]
    first, step = parts[0], form.itemsize
    offsets = [part.ctypes.data - first.ctypes.data for part in parts]
    alike = all(part.shape == (*sizes, 6) and part.dtype == form and part.strides == first.strides for part in parts)
    if not alike or offsets != [0, 6 * step, 12 * step] or first.strides[1:] != (18 * step, step):
        return None
    return np.lib.stride_tricks.as_strided(first, (*sizes, 18), first.strides)


def joint_target(out: object, state: JointState, form: np.dtype) -> Array:
    """Return ``(T, nv)`` where a caller wants a number for each degree of freedom, or raise `InputError`."""
    wanted = state.v.shape[1:] if state.single else state.v.shape
    if not isinstance(out, np.ndarray) or out.shape != wanted or out.dtype != form or not out.flags.writeable:
        got = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else type(out).__name__
        raise InputError(f"out: got {got}, expected a writeable array of {form} {wanted}")
    return out[None] if state.single else out


def check_method(method: str) -> None:
    """Raise `InputError` for a method that is not in `mp2a.methods.METHODS`."""
    if method not in METHODS:
        raise InputError(f"method: got {method!r}, expected 'serial' or one of {', '.join(map(repr, METHODS))}")
