"""Checked input of a dynamics call: shapes, finite numbers, unit quaternions, gravity."""

import weakref
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import array, numbers
from mp2a.exceptions import InputError
from mp2a.model import Model
from mp2a.spatial import Array

if TYPE_CHECKING:
    import pinocchio

_UNIT_TOLERANCE = 1e-6

_RATES = "v", "a", "tau"
"""What arguments are called that have a number for each degree of freedom."""


class JointState(NamedTuple):
    """Checked input of one call, always with a sample axis."""

    q: Array
    """``(T, nq)``"""
    v: Array
    """``(T, nv)``"""
    a: Array
    """``(T, nv)``: joint accelerations, or the joint forces of forward dynamics."""
    external: Array | None
    """Forces ``(n, T or 1, 6)`` on the bodies, or None."""
    single: bool
    """Whether the caller gave one sample without a sample axis."""
    third: str = "a"
    """What the caller calls ``a``: "a", or "tau" in forward dynamics."""

    @property
    def samples(self) -> int:
        """The number of samples T."""
        return len(self.q)


def check_state(model: Model, q: ArrayLike, v: ArrayLike, a: ArrayLike, external: ArrayLike | None) -> JointState:
    """Check the arguments of an inverse-dynamics call and give each a sample axis.

    Raises
    ------
    InputError
        Naming the argument, what was given and what was expected.
    """
    state = check_shapes(model, q, v, a, external)
    check_values(model, state)
    return state


def check_shapes(
    model: Model, q: ArrayLike, v: ArrayLike, a: ArrayLike, external: ArrayLike | None, third: str = "a"
) -> JointState:
    """Check the shapes of the arguments and give each a sample axis, whatever their numbers are.

    ``third`` is what errors call ``a``.

    Raises
    ------
    InputError
        Naming the argument, what was given and what was expected.
    """
    widths = zip(("q", "v", third), (q, v, a), (model.nq, model.nv, model.nv), strict=True)
    arrays = {name: _samples_of(name, values, width) for name, values, width in widths}
    if not arrays["q"].shape[:-1] == arrays["v"].shape[:-1] == arrays[third].shape[:-1]:
        shapes = {name: array.shape[:-1] for name, array in arrays.items()}
        counts = ", ".join(f"{name} has {shape[0] if shape else 'no'} samples" for name, shape in shapes.items())
        raise InputError(f"{', '.join(arrays)}: got different numbers of samples ({counts}), expected the same for all")
    single = arrays["q"].ndim == 1
    samples = 1 if single else len(arrays["q"])
    if samples == 0:
        raise InputError(f"{', '.join(arrays)}: got no sample (T = 0), expected at least one")
    positions, rates, thirds = (array.reshape(samples, array.shape[-1]) for array in arrays.values())
    forces = None if external is None else _check_external(len(model), samples, single, external)
    return JointState(positions, rates, thirds, forces, single, third)


def check_coordinate_shape(model: Model, q: ArrayLike, name: str = "q") -> Array:
    """Check the shape of coordinates alone, ``(nq,)`` or ``(T, nq)``.

    Raises
    ------
    InputError
        Naming what was given and what was expected.
    """
    values = _samples_of(name, q, model.nq)
    if len(values) == 0:
        raise InputError(f"{name}: got no sample (T = 0), expected at least one")
    return values


def _samples_of(name: str, values: ArrayLike, width: int) -> Array:
    samples = numbers(name, values)
    if samples.ndim not in (1, 2) or samples.shape[-1] != width:
        raise InputError(f"{name}: got shape {samples.shape}, expected ({width},) or (T, {width})")
    return samples


def check_rates(model: Model, v: ArrayLike) -> Array:
    """Check velocities alone, ``(nv,)`` or ``(T, nv)``, shape and numbers.

    Raises
    ------
    InputError
        Naming what was given and what was expected.
    """
    values = _samples_of("v", v, model.nv)
    _check_finite(model, {"v": np.atleast_2d(values)})
    return values


def check_coordinates(model: Model, q: Array, name: str = "q") -> None:
    """Check that coordinates ``(T, nq)`` are finite, and quaternions, cosines and sines of length 1.

    Raises
    ------
    InputError
        Naming the joint, what was given and what was expected.
    """
    _check_finite(model, {name: q})
    _check_units(model, q, name)


def check_values(model: Model, state: JointState) -> None:
    """Check that all numbers are finite and that quaternions, cosines and sines are of length 1.

    Raises
    ------
    InputError
        Naming the argument, what was given and what was expected.
    """
    _check_finite(model, {"q": state.q, "v": state.v, state.third: state.a})
    _check_units(model, state.q)
    if state.external is not None and not np.isfinite(state.external).all():
        body, sample, column = (int(k) for k in np.argwhere(~np.isfinite(state.external))[0])
        raise InputError(
            f"external_forces: got {state.external[body, sample, column]} for body {body}, sample {sample}, "
            f"column {column}, expected finite numbers"
        )


def check_model(model: "Model | pinocchio.Model") -> Model:
    """Return a model as it is, and one of pinocchio's converted.

    Raises
    ------
    InputError
        If it is neither, or has what mp2a does not know.
    """
    if isinstance(model, Model):
        return model
    if type(model).__module__.partition(".")[0] == "pinocchio" and type(model).__name__ == "Model":
        return _converted(model)
    raise InputError(f"model: got {type(model).__name__}, expected an mp2a.Model or a pinocchio.Model")


class _Conversion(NamedTuple):
    original: "weakref.ref[pinocchio.Model]"
    copy: "pinocchio.Model"
    """What the original was like; a comparison with it takes some microseconds."""
    model: Model


_CONVERSIONS: dict[int, _Conversion] = {}


def _converted(original: "pinocchio.Model") -> Model:
    """Convert a model of pinocchio's, once as long as it lives and does not change."""
    key = id(original)
    kept = _CONVERSIONS.get(key)
    if kept is None or kept.original() is not original or kept.copy != original:
        alive = weakref.ref(original, lambda _: _CONVERSIONS.pop(key, None))
        kept = _Conversion(alive, type(original)(original), Model.from_pinocchio(original))
        _CONVERSIONS[key] = kept
    return kept.model


def check_gravity(model: Model, gravity: ArrayLike | None) -> Array:
    """Check the gravity field, ``(3,)`` m/s² in the base frame; None is the model's own."""
    return model.gravity if gravity is None else array("gravity", gravity, (3,))


def _check_finite(model: Model, columns: dict[str, Array]) -> None:
    for name, values in columns.items():
        if not np.isfinite(values).all():
            sample, column = (int(k) for k in np.argwhere(~np.isfinite(values))[0])
            starts = model.v_starts if name in _RATES else model.q_starts
            body = int(np.searchsorted(starts, column, side="right")) - 1
            raise InputError(
                f"{name}: got {values[sample, column]} in sample {sample}, column {column} "
                f"(joint {model.names[body]!r}), expected finite numbers"
            )


def _check_units(model: Model, q: Array, name: str = "q") -> None:
    for group in model.groups:
        if group.joint.unit is None:
            continue
        length = np.linalg.norm(q[:, group.q_columns[:, group.joint.unit]], axis=-1)
        wrong = np.abs(length - 1) > _UNIT_TOLERANCE
        if wrong.any():
            sample, k = (int(x) for x in np.argwhere(wrong)[0])
            part = "quaternion" if group.joint.unit.stop - group.joint.unit.start == 4 else "cosine and sine"
            raise InputError(
                f"{name}: got a {part} of length {length[sample, k]:.9g} for {group.joint.name} joint "
                f"{model.names[group.bodies[k]]!r} in sample {sample}, expected length 1"
            )


def _check_external(n: int, samples: int, single: bool, external: ArrayLike) -> Array:
    forces = numbers("external_forces", external)
    wanted = f"({n}, 6)" if single else f"({n}, 6) or ({samples}, {n}, 6)"
    if forces.shape == (n, 6):
        forces = forces[None]
    elif single or forces.shape != (samples, n, 6):
        raise InputError(f"external_forces: got shape {forces.shape}, expected {wanted}")
    return forces.swapaxes(0, 1)
