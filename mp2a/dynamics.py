"""What users call: inverse dynamics of a chain in one process."""

from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from mp2a import schedule
from mp2a.chain import Chain
from mp2a.exceptions import InputError
from mp2a.leaf import check_gravity, check_state
from mp2a.methods import METHODS, InverseDynamics, serial
from mp2a.methods.compact import paths_outwards
from mp2a.segments import motion
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
) -> Array | InverseDynamics:
    """Inverse dynamics of a chain in this process: the joint torques that give these accelerations.

    Parameters
    ----------
    chain
        n bodies.
    q
        Coordinates as pinocchio's, ``(nq,)`` or ``(T, nq)`` for T samples; rad and m.
    v, a
        Joint velocities and accelerations, ``(nv,)`` or ``(T, nv)``; rad/s, m/s and rad/s², m/s².
    external_forces
        ``[torque; force]`` that act on the bodies, each in the body's frame about its *origin*, ``(n, 6)`` or
        ``(T, n, 6)``, N m and N. `mp2a.spatial.force_at_origin` moves the paper's F_RA there from the centre of mass.
    gravity
        ``(3,)`` m/s² in the base frame.
    method
        "serial", body after body; or one of `mp2a.methods.METHODS`, with all n robots in this process.
    bodies
        Return motion and force of every body as well.

    Returns
    -------
    numpy.ndarray or InverseDynamics
        Torques ``(nv,)`` or ``(T, nv)``, N m and N; with ``bodies`` an `InverseDynamics` that holds them.

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
    state = check_state(chain, q, v, a, external_forces)
    field = check_gravity(gravity)
    if method == "serial":
        result = serial(chain, state, field)
    else:
        chosen = METHODS[method]
        result = chosen.solve(chain, state, field, chosen.schedule(chain.parents), LocalTransport(len(chain)))
    torque = result.torque[0] if state.single else result.torque
    if not bodies:
        return torque
    outside = ("velocity", "acceleration", "force", "rotation", "position")
    parts = {name: _samples_first(getattr(result, name), single=state.single) for name in outside}
    return InverseDynamics(torque=torque, **parts)


def placements(chain: Chain, q: ArrayLike) -> tuple[Array, Array]:
    """Where the bodies of a chain are, by the rounds of motion alone.

    Parameters
    ----------
    chain
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
    still = np.zeros((*np.shape(q)[:-1], chain.nv))
    state = check_state(chain, q, still, still, None)
    path = motion.view(paths_outwards(chain, state, schedule.motion(chain.parents), LocalTransport(len(chain)))[-1])
    rotation, position = (_samples_first(x, single=state.single) for x in (path.rotation, path.translation))
    return rotation, position


def _samples_first(values: Any, *, single: bool) -> Any:
    """Results ``(n, T, …)`` as ``(T, n, …)``, or as ``(n, …)`` for a single sample."""
    if values is None:
        return None
    return values[:, 0] if single else np.moveaxis(values, 0, 1)


def check_method(method: str) -> None:
    """Raise `InputError` for a method that is not in `mp2a.methods.METHODS`."""
    if method not in METHODS:
        raise InputError(f"method: got {method!r}, expected 'serial' or one of {', '.join(map(repr, METHODS))}")
