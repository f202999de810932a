"""What users call in one process: forward dynamics of a chain or tree."""

from typing import TYPE_CHECKING, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from mp2a import serial
from mp2a.checks import count
from mp2a.dynamics import joint_target, number_format, rnea
from mp2a.exceptions import InputError
from mp2a.joint_kinematics import BaseMotion
from mp2a.model import Model
from mp2a.results import ForwardDynamics
from mp2a.spatial import Array
from mp2a.validation import check_gravity, check_model, check_shapes

if TYPE_CHECKING:
    import pinocchio


@overload
def aba(
    model: "Model | pinocchio.Model",
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    external_forces: ArrayLike | None = ...,
    gravity: ArrayLike | None = ...,
    *,
    bodies: Literal[False] = ...,
    threads: int | None = ...,
    dtype: DTypeLike = ...,
    out: Array | None = ...,
) -> Array: ...
@overload
def aba(
    model: "Model | pinocchio.Model",
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    external_forces: ArrayLike | None = ...,
    gravity: ArrayLike | None = ...,
    *,
    bodies: Literal[True],
    threads: int | None = ...,
    dtype: DTypeLike = ...,
    out: ForwardDynamics | None = ...,
) -> ForwardDynamics: ...
def aba(
    model: "Model | pinocchio.Model",
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    external_forces: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    *,
    bodies: bool = False,
    threads: int | None = None,
    dtype: DTypeLike = np.float64,
    out: Array | ForwardDynamics | None = None,
) -> Array | ForwardDynamics:
    """Compute the joint accelerations that these torques give: forward dynamics, the inverse of `rnea`.

    Parameters
    ----------
    model, q, v, external_forces, gravity, threads, dtype
        As `rnea` takes them.
    tau
        Joint torques, ``(nv,)`` or ``(T, nv)``; N m and N.
    bodies
        Return motion and force of every body as well.
    out
        An array for the accelerations, of their shape and format; with ``bodies`` what an earlier call with as many
        samples returned, all of which is filled again. It is returned. It may overlap the input.

    Returns
    -------
    numpy.ndarray or ForwardDynamics
        Accelerations ``(nv,)`` or ``(T, nv)``, rad/s² and m/s²; with ``bodies`` a `ForwardDynamics` that holds them.
        Laid out in memory as q, v and tau are, if all are laid out alike.

    Raises
    ------
    InputError
        If an argument has the wrong shape, is not finite, a quaternion is not of unit length, or neither mass nor
        armature resists a joint.

    Examples
    --------
    >>> import mp2a
    >>> pendulum = mp2a.Model.uniform(1, axis=(0, 1, 0))
    >>> mp2a.aba(pendulum, [0.0], [0.0], [0.0]).round(3).tolist()
    [14.57]
    """
    if (
        external_forces is None
        and gravity is None
        and threads is None
        and dtype is np.float64
        and not bodies
        and type(model) is Model
    ):
        direct = serial.aba_direct(model, q, v, tau, out)
        if direct is not None:
            return direct
    if threads is not None:
        count("threads", threads)
    form = number_format(dtype)
    model = check_model(model)
    state = check_shapes(model, q, v, tau, external_forces, "tau")
    field = check_gravity(model, gravity)
    if bodies and not (out is None or isinstance(out, ForwardDynamics)):
        raise InputError(f"out: got {type(out).__name__}, expected what an earlier call returned with bodies=True")
    kept = out.joint_acceleration if isinstance(out, ForwardDynamics) and bodies else out
    target = None if kept is None else joint_target(kept, state, form)
    found = serial.aba(
        model, state, BaseMotion.at_rest(field), threads=threads, dtype=form, out=None if bodies else target
    )
    acceleration = found[0] if state.single else found
    if not bodies:
        return acceleration if out is None else out
    into = out if isinstance(out, ForwardDynamics) else None
    motion = rnea(
        model, q, v, acceleration, external_forces, field, bodies=True, threads=threads, dtype=form, out=into
    )  # fmt: skip
    if into is None:
        return ForwardDynamics(motion, acceleration)
    into.joint_acceleration[...] = acceleration
    return into
