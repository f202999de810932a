"""What users call: inverse dynamics of a chain in one process."""

from typing import Literal, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from mp2a.chain import Chain
from mp2a.checks import count
from mp2a.exceptions import InputError
from mp2a.kernels.plan import FORMATS
from mp2a.leaf import check_gravity, check_shapes, check_values
from mp2a.methods import METHODS, InverseDynamics
from mp2a.recursion import recursion
from mp2a.spatial import GRAVITY, Array
from mp2a.transport.local import LocalTransport


@overload
def rnea(
    chain: Chain,
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
    chain: Chain,
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
    out: Array | None = ...,
) -> InverseDynamics: ...
def rnea(
    chain: Chain,
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
    out: Array | None = None,
) -> Array | InverseDynamics:
    """Inverse dynamics of a chain in this process: the joint torques that give these accelerations.

    Parameters
    ----------
    chain
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
        Array for the torques, of their shape and format, so that a loop needs no new memory.

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
    >>> chain = mp2a.Chain.uniform(3, axis=(0, 1, 0))
    >>> mp2a.rnea(chain, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]).round(3).tolist()
    [-44.145, -19.62, -4.905]
    """
    if method != "serial":
        check_method(method)
    if threads is not None:
        count("threads", threads)
    form = _format(dtype)
    state = check_shapes(chain, q, v, a, external_forces)
    field = check_gravity(gravity)
    target = None if out is None else _target(out, (state.samples, chain.nv), state.single, form)
    if method == "serial":
        base = np.zeros(12)
        base[6:9] -= field
        found = recursion(chain, state, base, bodies=bodies, threads=threads, dtype=form, out=target)
        return _report(found.torque, found.bodies, state.single)
    check_values(chain, state)
    chosen = METHODS[method]
    made = chosen.solve(chain, state, field, chosen.schedule(chain.parents), LocalTransport(len(chain)))
    torque = made.torque.astype(form, copy=False)
    if target is not None:
        target[...] = torque
        torque = target
    rows = None
    if bodies:
        parts = (made.velocity, made.acceleration, made.force)
        rows = np.concatenate([x.swapaxes(1, 2) for x in parts], axis=1).astype(form, copy=False)
    return _report(torque, rows, state.single)


def _report(torque: Array, bodies: Array | None, single: bool) -> Array | InverseDynamics:
    """Torque alone, or with the bodies' ``(n, 18, T)``."""
    if single:
        torque = torque[0]
    if bodies is None:
        return torque
    samples = bodies.transpose(2, 0, 1)
    velocity, acceleration, force = (samples[..., k : k + 6] for k in (0, 6, 12))
    if single:
        velocity, acceleration, force = velocity[0], acceleration[0], force[0]
    return InverseDynamics(velocity, acceleration, force, torque)


def _format(dtype: DTypeLike) -> np.dtype:
    try:
        form = np.dtype(dtype)
    except TypeError as error:
        raise InputError(f"dtype: got {dtype!r}, expected float64 or float32") from error
    if form not in FORMATS:
        raise InputError(f"dtype: got {form}, expected float64 or float32")
    return form


def _target(out: Array, shape: tuple[int, int], single: bool, form: np.dtype) -> Array:
    wanted = shape[1:] if single else shape
    if not isinstance(out, np.ndarray) or out.shape != wanted or out.dtype != form or not out.flags.writeable:
        given = f"{out.dtype} {out.shape}" if isinstance(out, np.ndarray) else type(out).__name__
        raise InputError(f"out: got {given}, expected a writeable array of {form} {wanted}")
    return out[None] if single else out


def check_method(method: str) -> None:
    """Raise `InputError` for a method that is not in `mp2a.methods.METHODS`."""
    if method not in METHODS:
        raise InputError(f"method: got {method!r}, expected 'serial' or one of {', '.join(map(repr, METHODS))}")
