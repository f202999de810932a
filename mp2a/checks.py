"""Checks of arguments: each names the argument, what was given and what was expected."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.exceptions import InputError


def numbers(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return real numbers as an array of doubles, not copied if they are one."""
    try:
        given = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: got {type(value).__name__}, expected an array of numbers ({error})") from error
    if given.dtype.kind not in "biuf":
        raise InputError(f"{name}: got {type(value).__name__} of {given.dtype}, expected an array of real numbers")
    return given.astype(np.float64, copy=False)


def array(name: str, value: ArrayLike, shape: tuple[int | None, ...], *, whole: bool = False) -> NDArray[Any]:
    """Return finite numbers as an own array of a shape (None: any length), as integers if they are to be whole."""
    given = numbers(name, value) + 0.0  # a copy, in which -0.0, which equals 0.0, has its bits as well
    if given.ndim != len(shape) or any(want not in (None, got) for want, got in zip(shape, given.shape, strict=True)):
        wanted = str(tuple(shape)).replace("None", "n")
        raise InputError(f"{name}: got shape {given.shape}, expected {wanted}")
    if not np.isfinite(given).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(given))[0])
        raise InputError(f"{name}: got {given[where]} at {where}, expected finite numbers")
    if not whole:
        return given
    if not (given == np.round(given)).all():
        raise InputError(f"{name}: got {given.tolist()}, expected whole numbers")
    return given.astype(np.intp)


def count(name: str, value: int, least: int = 1) -> int:
    """Return a whole number that is large enough."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise InputError(f"{name}: got {value!r}, expected a whole number of at least {least}")
    return int(value)


def between(name: str, value: float, least: float, most: float, unit: str) -> float:
    """Return a number between two bounds, which belong to it."""
    number = numbers(name, value)
    if number.ndim or not least <= number <= most:
        raise InputError(f"{name}: got {value!r}, expected a number from {least:g} to {most:g} {unit}")
    return float(number)


def positive(name: str, value: float, *, or_zero: bool = False) -> float:
    """Return a finite number above 0, or not below it."""
    number = numbers(name, value)
    if number.ndim or not 0 <= number < np.inf or (number == 0 and not or_zero):
        wanted = "a finite number of at least 0" if or_zero else "a finite number above 0"
        raise InputError(f"{name}: got {value!r}, expected {wanted}")
    return float(number)
