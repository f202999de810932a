"""Checks of arguments: each names the argument, what was given and what was expected."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.exceptions import InputError

_MOST = 2**62
"""Counts fit whole numbers of 64 bits."""


def numbers(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return real numbers as an array of doubles, not copied if they are one."""
    try:
        values = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: got {type(value).__name__}, expected an array of numbers ({error})") from error
    if values.dtype.kind not in "biuf":
        raise InputError(f"{name}: got {type(value).__name__} of {values.dtype}, expected an array of real numbers")
    return values.astype(np.float64, copy=False)


def array(
    name: str, value: ArrayLike, shape: tuple[int | None, ...], *, whole: bool = False, finite: bool = True
) -> NDArray[Any]:
    """Return finite (or any) numbers as an own array of a shape (None: any length), as integers if they are whole."""
    values = numbers(name, value) + 0.0  # a copy, in which -0.0, which equals 0.0, has its bits as well
    if values.ndim != len(shape) or any(want not in (None, got) for want, got in zip(shape, values.shape, strict=True)):
        wanted = str(tuple(shape)).replace("None", "n")
        raise InputError(f"{name}: got shape {values.shape}, expected {wanted}")
    if finite and not np.isfinite(values).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(values))[0])
        raise InputError(f"{name}: got {values[where]} at {where}, expected finite numbers")
    if not whole:
        return values
    if not (values == np.round(values)).all():
        raise InputError(f"{name}: got {values.tolist()}, expected whole numbers")
    return values.astype(np.intp)


def check_parents(parents: NDArray[np.intp]) -> None:
    """Raise `InputError` unless every body's parent comes before it or is the base, -1."""
    early = np.flatnonzero((parents >= np.arange(len(parents))) | (parents < -1))
    if early.size:
        i = early[0]
        raise InputError(f"parents: got {parents[i]} for body {i}, expected -1 or an earlier body")


def read_only(values: NDArray[Any]) -> NDArray[Any]:
    """Return an array after it has been made one that cannot be written."""
    values.flags.writeable = False
    return values


def count(name: str, value: int, least: int = 1) -> int:
    """Return a whole number after a check that it is large enough."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise InputError(f"{name}: got {value!r}, expected a whole number of at least {least}")
    if value > _MOST:
        raise InputError(f"{name}: got {value}, expected a whole number of at most {_MOST}")
    return int(value)


def between(name: str, value: float, least: float, most: float, unit: str) -> float:
    """Return a number between two bounds, which belong to it."""
    number = numbers(name, value)
    if number.ndim or not least <= number <= most:
        raise InputError(f"{name}: got {value!r}, expected a number from {least:g} to {most:g} {unit}")
    return float(number)


def positive(name: str, value: float, *, or_zero: bool = False) -> float:
    """Return a number after a check that it is finite and above 0, or not below it."""
    number = numbers(name, value)
    if number.ndim or not 0 <= number < np.inf or (number == 0 and not or_zero):
        wanted = "a finite number of at least 0" if or_zero else "a finite number above 0"
        raise InputError(f"{name}: got {value!r}, expected {wanted}")
    return float(number)


def unit_axes(axes: NDArray[np.float64], needed: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return axes ``(n, 3)`` of length 1 where they are needed, and zeros elsewhere."""
    largest = np.abs(axes).max(axis=1)
    if (needed & (largest == 0)).any():
        raise InputError(f"axes: got a zero axis for body {np.argmax(needed & (largest == 0))}, expected a direction")
    # First to a length that has a square, neither too large nor too small for a double.
    scaled = axes / np.where(largest == 0, 1.0, largest)[:, None]
    lengths = np.linalg.norm(scaled, axis=1)
    # An axis that is of unit length to rounding stays as it is, so that a model survives save, load and conversion.
    exact = np.abs(lengths * np.minimum(largest, 2.0) - 1) < 1e-15
    unit = np.where(exact[:, None], axes, scaled / np.where(lengths == 0, 1.0, lengths)[:, None])
    return np.where(needed[:, None], unit, 0.0)


def check_rotations(rotations: NDArray[np.float64]) -> None:
    """Check that matrices ``(n, 3, 3)`` are rotations to 1e-9."""
    too_large = np.abs(rotations).max((1, 2)) > 2
    bounded = np.where(too_large[:, None, None], 0.0, rotations)
    gram = bounded @ bounded.swapaxes(1, 2) - np.eye(3)
    error = np.maximum(np.abs(gram).max((1, 2)), np.abs(np.linalg.det(bounded) - 1))
    if (error > 1e-9).any():
        i = int(np.argmax(error > 1e-9))
        raise InputError(f"rotations: got a matrix {error[i]:.1e} away from one for body {i}, expected a rotation")


def symmetric_inertias(inertias: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotational inertias ``(n, 3, 3)``, symmetric to the last bit, with no negative moment.

    Unequal moments of which one is more than the other two together, which no distribution of mass has, are let
    through: models in use have them, and the equations of motion can be solved all the same.
    """
    size = np.abs(inertias).max((1, 2))
    skewed = np.abs(inertias - inertias.swapaxes(1, 2)).max((1, 2)) > 1e-9 * (1e-300 + size)
    if skewed.any():
        raise InputError(f"inertias: got an unsymmetric one for body {np.argmax(skewed)}, expected a symmetric one")
    symmetric: NDArray[np.float64] = inertias / 2 + inertias.swapaxes(1, 2) / 2
    smallest = np.linalg.eigvalsh(symmetric)[:, 0]
    negative = smallest < -1e-9 * size
    if negative.any():
        i = int(np.argmax(negative))
        raise InputError(f"inertias: got a moment of {smallest[i]:.6g} kg m² for body {i}, expected none below 0")
    return symmetric
