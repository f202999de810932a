"""Algebra of segments, compiled: the same results as numpy's versions, tens of times faster.

Arrays may have any leading axes, which must agree or broadcast; C-contiguous arrays of doubles with the same leading
axes go straight to the compiled code, others are copied first. ``out`` may be one of the inputs, but must not overlap
one in any other way.

The first call loads the compiled code and builds it where it is not there. Where that cannot be, numpy's versions do
the work, and `status` says why.
"""

import sys
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from mp2a.kernels.library import ELEMENTWISE, PARTS, USUAL, BuilderStuckError, Kernel, UnavailableError, obtain
from mp2a.mpi_environment import rank_info, under_mpi
from mp2a.spatial import Array, force_to_parent


class Status(NamedTuple):
    """Which kernels are in use."""

    compiled: bool
    """Whether the compiled ones are; else numpy's."""
    why: str
    """Where the compiled ones lie, or why there are none."""


_DOUBLE = np.dtype(np.float64)

POINTER = object.__basicsize__
"""Where an array object keeps the address of its numbers: right behind what every object has (numpy's C interface).
Reading it there takes a tenth of the time that asking the array takes."""

_run: dict[str, Kernel] = {}
_kept: list[NDArray[Any]] = []
"""Tables that compiled code has the addresses of."""
_missing: set[str] = set()
"""Kernels that could not be had."""

_status: Status | None = None


def status() -> Status:
    """Tell which kernels are in use, and why.

    The first call loads the compiled ones, and builds them where they are not there; several processes wait for the
    one that builds. Where there are none, the first rank, or a process by itself, says so on stderr.
    """
    return _load(patient=not under_mpi()) if _status is None else _status


def build() -> Status:
    """Load the compiled kernels as `status` does, and try again what has failed; for launchers."""
    return _status if _status is not None and _status.compiled else _load(patient=True)


def compiled(name: str) -> Kernel | None:
    """Return a compiled kernel, or None if there is none; loads its part if need be."""
    if status().compiled and name not in _run and name not in _missing:
        part = next(part for part, names in PARTS.items() if name in names)
        try:
            _run.update(obtain(part, patient=not under_mpi())[1])
        except UnavailableError as error:
            _missing.update(PARTS[part])
            _complain(error)
    return _run.get(name)


def address(kernel: Kernel) -> int:
    """Return the address of a kernel's code, for kernels that call it."""
    import ctypes

    return ctypes.cast(kernel, ctypes.c_void_p).value or 0  # type: ignore[arg-type]


def pointer(array: NDArray[Any]) -> int:
    """Address of the pointer to an array's numbers, for kernels; the array has to live on."""
    return id(array) + POINTER


@cache
def yield_address() -> int:
    """Return the address of the system's ``sched_yield``, for kernels that wait."""
    import ctypes

    return ctypes.cast(ctypes.CDLL(None).sched_yield, ctypes.c_void_p).value or 0


LARGEST_ANGLE = 1e6
"""Angle up to which compiled sines and cosines are exact to rounding, rad."""

AXIS = 6
"""Which number of a program says whether its arguments have an axis of samples."""

TYPE = POINTER + 8, ~0xFF000000
"""Where a dtype object keeps kind, byte order and number of its type, and which bits these are.

Equal dtypes need not be one object: that of an array that came by pickle is another one."""


def number_type(dtype: np.dtype[Any]) -> int:
    """Return what compiled code knows a dtype by."""
    import ctypes

    return ctypes.c_int64.from_address(id(dtype) + TYPE[0]).value & TYPE[1]


PLAIN = 0x0101
"""numpy's flags of an array whose numbers lie one after the other, where numbers of their size should."""

STEPS = ("start", "await", "read", "check_length", "copy", "add", *ELEMENTWISE)
"""What `rounds` can do, in the order of the numbers that mean it."""


@cache
def rounds() -> Callable[[int, int, int], int] | None:
    """Return what runs recorded rounds without the interpreter, or None without compiled kernels.

    It takes the address of a program, the first step to do and the one to stop before, as `mp2a.kernels.replay`
    describes them.
    """
    run = compiled("replay")
    return None if run is None else cast("Callable[[int, int, int], int]", partial(run, outside()))


@cache
def outside() -> int:
    """Return the address of what lies outside of recorded rounds, as `mp2a.kernels.replay` describes it."""
    addresses = [yield_address(), *(address(_run[step]) if step in _run else 0 for step in STEPS)]
    _kept.append(np.array(addresses, dtype=np.int64))
    return int(_kept[-1].ctypes.data)


def _load(*, patient: bool) -> Status:
    global _status  # noqa: PLW0603
    try:
        path, kernels = obtain(USUAL, patient=patient)
        if not _knows_arrays():
            raise UnavailableError("this numpy keeps in another place what it knows of an array")
    except UnavailableError as error:
        _status = Status(False, str(error))
        _complain(error)
    else:
        _run.update(kernels)
        _status = Status(True, str(path))
    return _status


def _complain(error: UnavailableError) -> None:
    rank = rank_info()
    if rank is None or rank.rank == 0 or isinstance(error, BuilderStuckError):
        print(f"mp2a: no compiled kernels, numpy is 10 to 100 times slower: {error}", file=sys.stderr, flush=True)


def _knows_arrays() -> bool:
    """Tell whether an array object holds its address, axes, lengths, type and flags where kernels look for them."""
    import ctypes

    probe = np.empty((2, 3))
    words = (ctypes.c_int64 * 7).from_address(id(probe) + POINTER)
    lengths = (ctypes.c_int64 * 2).from_address(words[2])
    axes, flags = words[1] & 0xFFFFFFFF, words[6] & 0xFFFFFFFF
    found = words[0], axes, [*lengths], words[5], flags & PLAIN, probe[:, :2].flags.num & PLAIN == PLAIN
    kinds = [number_type(np.dtype(kind)) for kind in ("f8", "f4", "i8", ">f8")]
    return found == (probe.ctypes.data, 2, [2, 3], id(_DOUBLE), PLAIN, False) and kinds[0] not in kinds[1:]


def compose(upper: Array, lower: Array, out: Array | None = None) -> Array:
    """Put a relative motion above another one; see `mp2a.algebra.motion.compose`.

    Parameters
    ----------
    upper, lower
        Relative motions ``(..., 24)``.
    out
        Where to put the result.

    Returns
    -------
    numpy.ndarray
        ``(..., 24)``
    """
    return _apply(_COMPOSE, out, upper, lower)


def transform(segment: Array, path: Array, out: Array | None = None) -> Array:
    """Take composite inertias across paths, to the bodies at the upper ends; see `mp2a.algebra.inertia.transform`.

    Parameters
    ----------
    segment
        Composite inertias ``(..., 28)`` about the lower body's origin.
    path
        Relative motions ``(..., 24)``.
    out
        Where to put the result.

    Returns
    -------
    numpy.ndarray
        ``(..., 28)`` about the upper body's origin.
    """
    return _apply(_TRANSFORM, out, segment, path)


def force(segment: Array, velocity: Array, acceleration: Array, out: Array | None = None) -> Array:
    """Return the force that composite inertias take for motions of their bodies; see `mp2a.algebra.inertia.force`.

    Parameters
    ----------
    segment
        Composite inertias ``(..., 28)``.
    velocity, acceleration
        Of the body, ``(..., 6)``: rad/s and m/s, and the *spatial* acceleration, rad/s² and m/s².
    out
        Where to put the result.

    Returns
    -------
    numpy.ndarray
        ``[torque; force]``, ``(..., 6)``, N m and N.
    """
    return _apply(_FORCE, out, segment, velocity, acceleration)


def transform_force(path: Array, force: Array, out: Array | None = None) -> Array:
    """Take forces from the lower to the upper ends of paths; see `mp2a.spatial.force_to_parent`.

    Parameters
    ----------
    path
        Relative motions ``(..., 24)``, of which only the rotation and the translation count.
    force
        ``[torque; force]`` in the lower frame and about its origin, ``(..., 6)``, N m and N.
    out
        Where to put the result.

    Returns
    -------
    numpy.ndarray
        The same in the upper frame and about its origin, ``(..., 6)``.
    """
    return _apply(_TRANSFORM_FORCE, out, path, force)


class _Signature(NamedTuple):
    """Numbers a sample in the result and the inputs of a kernel."""

    name: str
    result: int
    first: int
    second: int
    third: int = 0


def _signature(name: str) -> _Signature:
    form = ELEMENTWISE[name]
    return _Signature(name, form.result, *form.inputs)


_COMPOSE, _TRANSFORM, _FORCE, _TRANSFORM_FORCE = map(_signature, ("compose", "transform", "force", "transform_force"))


def _apply(kernel: _Signature, out: Array | None, a: Array, b: Array, c: Array | None = None) -> Array:
    """Call the compiled code with arrays as they are, or else have `_apply_general` see to them.

    Written out for each input, for a loop over them would take as long as the rest of the call.
    """
    name, result, first, second, third = kernel
    run, lead = _run.get(name), a.shape[:-1]
    plain = (
        run is not None
        and a.shape == (*lead, first)
        and b.shape == (*lead, second)
        and a.dtype is _DOUBLE
        and b.dtype is _DOUBLE
        and a.flags.c_contiguous
        and b.flags.c_contiguous
        and (c is None or (c.shape == (*lead, third) and c.dtype is _DOUBLE and c.flags.c_contiguous))
        and (out is None or (out.shape == (*lead, result) and out.dtype is _DOUBLE and out.flags.carray))
    )
    if run is None or not plain:
        return _apply_general(kernel, out, (a, b) if c is None else (a, b, c))
    if out is None:
        out = np.empty((*lead, result))
    if c is None:
        run(out.size // result, id(out) + POINTER, id(a) + POINTER, id(b) + POINTER)
    else:
        run(out.size // result, id(out) + POINTER, id(a) + POINTER, id(b) + POINTER, id(c) + POINTER)
    return out


def _apply_general(kernel: _Signature, out: Array | None, inputs: Sequence[Array]) -> Array:
    """Do what the compiled code does not take as it is."""
    name, width, *columns = kernel
    for array, count in zip(inputs, columns, strict=False):  # a kernel of two inputs has no third
        if array.ndim == 0 or array.shape[-1] != count:
            raise ValueError(f"{name}: the last axis of an input must have {count} numbers, not shape {array.shape}")
    lead = np.broadcast_shapes(*(array.shape[:-1] for array in inputs))
    if out is not None and out.shape != (*lead, width):
        raise ValueError(f"{name}: out must have shape {(*lead, width)}, not {out.shape}")
    if status().compiled:
        pairs = zip(inputs, columns, strict=False)
        arrays = [np.ascontiguousarray(np.broadcast_to(x, (*lead, count)), np.float64) for x, count in pairs]
        result = np.empty((*lead, width))
        _run[name](result.size // width, id(result) + POINTER, *(id(array) + POINTER for array in arrays))
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
        "transform": inertia.transform,
        "force": inertia.force,
        "transform_force": _transform_force,
    }
    return versions[name]


def _transform_force(path: Array, force: Array) -> Array:
    rotation = path[..., :9].reshape(*path.shape[:-1], 3, 3)
    return force_to_parent(rotation, path[..., 9:12], force)
