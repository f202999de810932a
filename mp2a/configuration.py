"""What users do with coordinates: go along a velocity, tell how to get from one to another, and draw some."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import array, count
from mp2a.exceptions import InputError
from mp2a.joint_kinematics import coordinate_difference
from mp2a.model import Model
from mp2a.spatial import Array
from mp2a.validation import check_coordinate_shape, check_coordinates, check_model, check_rates

if TYPE_CHECKING:
    import pinocchio


def integrate(model: "Model | pinocchio.Model", q: ArrayLike, v: ArrayLike) -> Array:
    """Go on from coordinates with a constant joint velocity for a unit of time, as pinocchio's ``integrate``.

    Parameters
    ----------
    model
        n bodies, as `rnea` takes them.
    q
        Coordinates ``(nq,)`` or ``(T, nq)``, rad and m.
    v
        Velocities times the time, ``(nv,)`` or ``(T, nv)``, rad and m.

    Returns
    -------
    numpy.ndarray
        Coordinates ``(nq,)``, or ``(T, nq)`` if one of the two has samples; quaternions, cosines and sines of length 1.

    Raises
    ------
    InputError
        If an argument has the wrong shape, is not finite, or a quaternion is not of unit length.

    Examples
    --------
    >>> import mp2a
    >>> model = mp2a.Model.uniform(1, joint="continuous")
    >>> mp2a.integrate(model, [1.0, 0.0], [0.5]).round(3).tolist()
    [0.878, 0.479]
    """
    model = check_model(model)
    start, step = np.atleast_2d(_coordinates(model, q, "q"), check_rates(model, v))
    samples = _samples(q=start, v=step)
    out = np.empty((samples, model.nq))
    for group in model.groups:
        out[:, group.q_columns] = group.joint.integrate(start[:, group.q_columns], step[:, group.v_columns])
    return out[0] if np.ndim(q) == np.ndim(v) == 1 else out


def difference(model: "Model | pinocchio.Model", start: ArrayLike, end: ArrayLike) -> Array:
    """Tell which velocity leads from coordinates to others in a unit of time, as pinocchio's ``difference``.

    Parameters
    ----------
    model
        n bodies, as `rnea` takes them.
    start, end
        Coordinates ``(nq,)`` or ``(T, nq)``, rad and m.

    Returns
    -------
    numpy.ndarray
        ``(nv,)``, or ``(T, nv)`` if one of the two has samples, rad and m: ``integrate(model, start, difference(model,
        start, end))`` is ``end``, by the shorter way where there are two.

    Raises
    ------
    InputError
        As for `integrate`.
    """
    model = check_model(model)
    first, last = np.atleast_2d(_coordinates(model, start, "start"), _coordinates(model, end, "end"))
    _samples(start=first, end=last)
    out = coordinate_difference(model, first, last)
    return out[0] if np.ndim(start) == np.ndim(end) == 1 else out


def neutral(model: "Model | pinocchio.Model") -> Array:
    """Return the coordinates of zero displacement, ``(nq,)``."""
    return check_model(model).neutral.copy()


def random_configuration(
    model: "Model | pinocchio.Model",
    samples: int | None = None,
    seed: int = 0,
    *,
    lower: ArrayLike = -1.0,
    upper: ArrayLike = 1.0,
) -> Array:
    """Draw coordinates: positions and angles evenly between bounds, directions and rotations evenly among all.

    Parameters
    ----------
    model
        n bodies, as `rnea` takes them.
    samples
        The number of samples T; None for one without a sample axis.
    seed
        The same seed gives the same coordinates.
    lower, upper
        Bounds, one number or ``(nq,)``, rad and m; those of quaternions, cosines and sines do not count.

    Returns
    -------
    numpy.ndarray
        ``(nq,)`` or ``(T, nq)``.

    Raises
    ------
    InputError
        If a bound is not finite, or a lower one above the upper one.
    """
    model = check_model(model)
    if samples is not None:
        count("samples", samples)
    least, most = _bound(model, "lower", lower), _bound(model, "upper", upper)
    if (least > most).any():
        k = int(np.argmax(least > most))
        raise InputError(f"lower: got {least[k]} for coordinate {k}, expected at most the upper {most[k]}")
    rng = np.random.default_rng(seed)
    q = rng.uniform(least, most, size=(samples or 1, model.nq))
    for group in model.groups:
        if group.joint.unit is not None:
            columns = group.q_columns[:, group.joint.unit]
            drawn = rng.normal(size=(len(q), *columns.shape))
            q[:, columns] = drawn / np.linalg.norm(drawn, axis=-1, keepdims=True)
    return q if samples is not None else q[0]


def _bound(model: Model, name: str, value: ArrayLike) -> Array:
    return np.broadcast_to(array(name, value, () if np.ndim(value) == 0 else (model.nq,)), model.nq)


def _coordinates(model: Model, q: ArrayLike, name: str) -> Array:
    values = check_coordinate_shape(model, q, name)
    check_coordinates(model, np.atleast_2d(values), name)
    return values


def _samples(**arrays: Array) -> int:
    """Return the number of samples of two arrays, of which one may have one for all."""
    counts = {name: len(values) for name, values in arrays.items()}
    if len({number for number in counts.values() if number > 1}) > 1:
        sizes = ", ".join(f"{name} has {number}" for name, number in counts.items())
        raise InputError(f"{', '.join(counts)}: got different numbers of samples ({sizes}), expected the same or one")
    return max(counts.values())
