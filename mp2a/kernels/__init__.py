"""Putting segments together, compiled: the same results as numpy's versions, tens of times faster.

Arrays may have any leading axes, which must agree or broadcast; C-contiguous arrays of doubles with the same leading
axes go straight to the compiled code, others are copied first. ``out`` may be one of the inputs, but must not overlap
one in any other way.

The first call loads the compiled code and builds it where it is not there (`load`). Where that cannot be, numpy's
versions do the work; `status` says why.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from mp2a.kernels.library import Run, UnavailableError, obtain
from mp2a.mpi_environment import under_mpi
from mp2a.spatial import Array, force_to_parent


class Status(NamedTuple):
    """Which kernels are in use."""

    compiled: bool
    """Whether the compiled ones are; else numpy's."""
    why: str
    """Where the compiled ones lie, or why there are none."""


_DOUBLE = np.dtype(np.float64)

_POINTER = object.__basicsize__
"""Where an array object keeps the address of its numbers: right behind what every object has (numpy's C interface).
Reading it there takes a tenth of the time that asking the array takes."""

_run: dict[str, Run] = {}
_status: Status | None = None


def load() -> Status:
    """Load the compiled kernels, once; build them where they are not there.

    One process builds and the others wait. A rank under an MPI launcher waits some seconds only and does without
    then; hundreds of ranks should find the kernels there, by a `build` in the launcher.
    """
    return _load(patient=not under_mpi()) if _status is None else _status


def build() -> Status:
    """Build the compiled kernels where they are not there, however long that takes, and load them; for launchers."""
    return _status if _status is not None and _status.compiled else _load(patient=True)


def status() -> Status:
    """Tell which kernels are in use, and why; loads them if need be."""
    return load()


def compiled(name: str) -> Run | None:
    """Return a compiled kernel, or None if there is none; loads them if need be."""
    load()
    return _run.get(name)


def pointer(array: NDArray[Any]) -> int:
    """Address of the pointer to an array's numbers, for kernels; the array has to live on."""
    return id(array) + _POINTER


STEPS = ("start", "await", "compose", "move", "carry", "add", "product", "push")
"""What `rounds` can do, in the order of the numbers that mean it."""


def rounds() -> Callable[[int, int, int], int] | None:
    """Return what runs recorded rounds without the interpreter (``rounds.c``), or None without compiled kernels."""
    load()
    return cast("Callable[[int, int, int], int] | None", _run.get("rounds"))


class Threads(NamedTuple):
    """What threads share jobs with (``crew.c``)."""

    help: Run
    lead: Run
    address: Callable[[Run], int]
    """Of a kernel's code."""


@cache
def crew() -> Threads:
    """Return what threads share jobs with; only where kernels are compiled."""
    import ctypes

    return Threads(_run["help"], _run["lead"], lambda kernel: ctypes.cast(kernel, ctypes.c_void_p).value or 0)  # type: ignore[arg-type]


def _load(*, patient: bool) -> Status:
    global _status  # noqa: PLW0603
    try:
        path, kernels = obtain(patient=patient)
        probe = np.empty(1)
        if _read_pointer(probe) != probe.ctypes.data:
            raise UnavailableError("this numpy keeps the addresses of arrays in another place")
    except UnavailableError as error:
        _status = Status(False, str(error))
    else:
        _run.update(kernels)
        _status = Status(True, str(path))
    return _status


def _read_pointer(array: Array) -> int | None:
    import ctypes

    return ctypes.c_void_p.from_address(id(array) + _POINTER).value


def compose(upper: Array, lower: Array, out: Array | None = None) -> Array:
    """Put a path above another one; see `mp2a.algebra.motion.compose`.

    Parameters
    ----------
    upper, lower
        Segments ``(..., 24)``.
    out
        Where to put the result.

    Returns
    -------
    numpy.ndarray
        ``(..., 24)``
    """
    shape = upper.shape
    run = _run.get("compose")
    if run is None or shape[-1:] != (24,) or not (_is_plain(upper, shape) and _is_plain(lower, shape)):
        return _general("compose", out, upper, lower)
    if out is None:
        out = np.empty(shape)
    elif not _is_target(out, shape):
        return _general("compose", out, upper, lower)
    run(upper.size // 24, id(out) + _POINTER, id(upper) + _POINTER, id(lower) + _POINTER)
    return out


def move(segment: Array, path: Array, out: Array | None = None) -> Array:
    """Carry segments across paths, to the bodies at the paths' upper ends; see `mp2a.algebra.inertia.transform`.

    Parameters
    ----------
    segment
        ``(..., 28)`` about the lower body's origin.
    path
        ``(..., 24)``
    out
        Where to put the result.

    Returns
    -------
    numpy.ndarray
        ``(..., 28)`` about the upper body's origin.
    """
    lead = path.shape[:-1]
    shape = (*lead, 28)
    run = _run.get("move")
    if run is None or not (_is_plain(segment, shape) and _is_plain(path, (*lead, 24))):
        return _general("move", out, segment, path)
    if out is None:
        out = np.empty(shape)
    elif not _is_target(out, shape):
        return _general("move", out, segment, path)
    run(path.size // 24, id(out) + _POINTER, id(segment) + _POINTER, id(path) + _POINTER)
    return out


def force(segment: Array, velocity: Array, acceleration: Array, out: Array | None = None) -> Array:
    """Force that segments take for motions of their bodies; see `mp2a.algebra.inertia.force`.

    Parameters
    ----------
    segment
        ``(..., 28)``
    velocity, acceleration
        Of the body, ``(..., 6)``: rad/s and m/s, and the *spatial* acceleration, rad/s² and m/s².
    out
        Where to put the result.

    Returns
    -------
    numpy.ndarray
        ``[torque; force]``, ``(..., 6)``, N m and N.
    """
    shape = velocity.shape
    run = _run.get("force")
    plain = run is not None and shape[-1:] == (6,) and _is_plain(velocity, shape) and _is_plain(acceleration, shape)
    if run is None or not (plain and _is_plain(segment, (*shape[:-1], 28))):
        return _general("force", out, segment, velocity, acceleration)
    if out is None:
        out = np.empty(shape)
    elif not _is_target(out, shape):
        return _general("force", out, segment, velocity, acceleration)
    arrays = id(segment) + _POINTER, id(velocity) + _POINTER, id(acceleration) + _POINTER
    run(velocity.size // 6, id(out) + _POINTER, *arrays)
    return out


def carry(path: Array, force: Array, out: Array | None = None) -> Array:
    """Take forces from the lower to the upper ends of paths; see `mp2a.spatial.force_to_parent`.

    Parameters
    ----------
    path
        ``(..., 24)``; only its rotation and its translation count.
    force
        ``[torque; force]`` in the lower frame and about its origin, ``(..., 6)``, N m and N.
    out
        Where to put the result.

    Returns
    -------
    numpy.ndarray
        The same in the upper frame and about its origin, ``(..., 6)``.
    """
    shape = force.shape
    run = _run.get("carry")
    if run is None or shape[-1:] != (6,) or not (_is_plain(force, shape) and _is_plain(path, (*shape[:-1], 24))):
        return _general("carry", out, path, force)
    if out is None:
        out = np.empty(shape)
    elif not _is_target(out, shape):
        return _general("carry", out, path, force)
    run(force.size // 6, id(out) + _POINTER, id(path) + _POINTER, id(force) + _POINTER)
    return out


def _is_plain(array: Array, shape: tuple[int, ...]) -> bool:
    return array.shape == shape and array.dtype is _DOUBLE and array.flags.c_contiguous


def _is_target(array: Array, shape: tuple[int, ...]) -> bool:
    return array.shape == shape and array.dtype is _DOUBLE and array.flags.carray


_COLUMNS = {"compose": (24, 24, 24), "move": (28, 28, 24), "force": (6, 28, 6, 6), "carry": (6, 24, 6)}
"""Numbers a sample in the result and in the inputs."""


def _general(name: str, out: Array | None, *inputs: Array) -> Array:
    """Do what the compiled code does not take as it is."""
    width, *columns = _COLUMNS[name]
    for array, count in zip(inputs, columns, strict=True):
        if array.ndim == 0 or array.shape[-1] != count:
            raise ValueError(f"{name}: the last axis of an input must have {count} numbers, not shape {array.shape}")
    lead = np.broadcast_shapes(*(array.shape[:-1] for array in inputs))
    if out is not None and out.shape != (*lead, width):
        raise ValueError(f"{name}: out must have shape {(*lead, width)}, not {out.shape}")
    if load().compiled:
        pairs = zip(inputs, columns, strict=True)
        arrays = [np.ascontiguousarray(np.broadcast_to(x, (*lead, count)), np.float64) for x, count in pairs]
        result = np.empty((*lead, width))
        samples = result.size // width
        _run[name](samples, id(result) + _POINTER, *(id(array) + _POINTER for array in arrays))
    else:
        result = numpy_version(name)(*inputs)
    if out is None:
        return result
    out[...] = result
    return out


def numpy_version(name: str) -> Callable[..., Array]:
    """Return the function that a kernel is the compiled form of."""
    # Not at the top, so that the modules of segments may import this one.
    from mp2a.algebra import inertia, motion

    versions: dict[str, Callable[..., Array]] = {
        "compose": motion.compose,
        "move": inertia.transform,
        "force": inertia.force,
        "carry": _carry,
    }
    return versions[name]


def _carry(path: Array, force: Array) -> Array:
    rotation = path[..., :9].reshape(*path.shape[:-1], 3, 3)
    return force_to_parent(rotation, path[..., 9:12], force)
