"""Running the compiled recursion: tables of chains are kept, samples are split over threads."""

from __future__ import annotations

from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a import cores, kernels
from mp2a.joint_kinematics import BaseMotion
from mp2a.kernels.model_cache import ModelCache
from mp2a.kernels.tables import NUMBER_FORMATS, SCALAR, KernelJob, NumberFormat, make_tables
from mp2a.kernels.thread_choice import CHOICES
from mp2a.kernels.thread_pool import THREAD_POOL
from mp2a.model import Model
from mp2a.results import Placement
from mp2a.spatial import Array
from mp2a.validation import JointState

_WORTH_A_THREAD = 5_000
"""Bodies times samples from which on another thread may gain more than waking it takes."""

_FEWEST_PIECES, _PIECES = 2, 8
"""Pieces of the work for each thread, so that one that is held up leaves some to the others."""

TABLES = ModelCache(make_tables)
"""Tables of models, by number format, whether motion and force of the bodies are asked for, and for which dynamics."""


class KernelResult(NamedTuple):
    """What the recursion gives."""

    torque: Array
    """``(T, nv)``"""
    bodies: Array | None
    """``(T, n, 18)``: velocity, acceleration and force of each body, if asked for."""
    root: Array
    """``(6, T)``: wrench that the chain puts on its base, about the base's origin and in its frame."""
    valid: bool
    """Whether every sample is as it should be; else some input is not finite, a quaternion not of length 1, an angle
    too large for the kernel, or a result not finite."""


class AbaResult(NamedTuple):
    """What forward dynamics gives."""

    acceleration: Array
    """Of the joints, ``(T, nv)``."""
    valid: bool
    """As in `KernelResult`; not either where nothing resists a joint."""


class BlockReduction(NamedTuple):
    """What the bodies of a chain amount to together."""

    path: Array
    """From what the chain hangs on to the last body, ``(T, 24)``, as `mp2a.algebra.motion` has it."""
    inertia: Array | None
    """About what the chain hangs on, ``(T, 28)``, as `mp2a.algebra.inertia` has it, if asked for."""
    valid: bool
    """As in `KernelResult`, where the numbers can be told from a path."""


def pack_base(base: BaseMotion) -> Array:
    """Motion of a base in the order of the kernels, ``(12,)`` or ``(T, 12)``: ω, ω̇, v̇, v."""
    velocity, acceleration = base
    packed = np.empty((*max(velocity.shape[:-1], acceleration.shape[:-1]), 12))
    packed[..., :3], packed[..., 3:9], packed[..., 9:] = velocity[..., :3], acceleration, velocity[..., 3:]
    return packed


def rnea(
    model: Model,
    state: JointState,
    base: Array,
    tip: Array | None = None,
    *,
    bodies: bool = False,
    threads: int | None = None,
    dtype: np.dtype | type = np.float64,
    out: Array | None = None,
    rows: Array | None = None,
) -> KernelResult | None:
    """Inverse dynamics of many samples; see `mp2a.kernels.rnea`.

    Parameters
    ----------
    model
        n bodies, a chain or a tree.
    state
        Input of the right shapes; the kernel notices by itself if its numbers are not what they should be.
    base
        Motion of the base as `pack_base` packs it, ``(12,)`` or ``(T, 12)``.
    tip
        Wrench from outside on the last body, in its frame about its origin, ``(T, 6)``.
    bodies
        Return motion and force of every body as well.
    threads
        How many share the samples; None: one, or as many as this process has cores and the work is worth, whichever
        was quicker of late.
    dtype
        Number format of the arithmetic and of the result, double or single.
    out
        Where to put the torque, ``(T, nv)`` of this format, if it is laid out as the input and does not overlap it.
    rows
        Where to put motion and force of the bodies, ``(T, n, 18)`` of this format, if it does not overlap the input.

    Returns
    -------
    KernelResult or None
        None if there are no compiled kernels.
    """
    form = _format(state.samples, dtype)
    name = f"rnea_{form.name}" + ("_bodies" if bodies else "")
    if kernels.compiled(name) is None:
        return None
    samples, inputs = state.samples, _input(state, form)
    torque = _joint_target(model, inputs, form, out)
    base = np.ascontiguousarray(base, form.dtype)
    tip = np.zeros(6, form.dtype) if tip is None else np.ascontiguousarray(tip, form.dtype)
    padded = -(-samples // form.lanes) * form.lanes
    output = rows
    if output is None or not output.flags.c_contiguous or _overlaps(output, inputs):
        output = np.empty((samples, len(model), 18) if bodies else 0, form.dtype)
    root = np.empty((6, padded), form.dtype)
    at = kernels.pointer
    ends = at(base), 12 * (base.ndim - 1), at(tip), 6 * (tip.ndim - 1)
    results = at(torque), _stride(torque, inputs.columnwise), at(output), padded, at(root), 0
    valid = _run(name, model, inputs, ends, results, form, threads, bodies=bodies)
    return KernelResult(torque, output if bodies else None, root[:, :samples], valid)


def aba(
    model: Model,
    state: JointState,
    base: Array,
    *,
    threads: int | None = None,
    dtype: np.dtype | type = np.float64,
    out: Array | None = None,
) -> AbaResult | None:
    """Forward dynamics of many samples, or of one; see `mp2a.kernels.aba`.

    Parameters
    ----------
    model, base, threads, dtype, out
        As `rnea` takes them; the joint accelerations go to ``out``.
    state
        Input with joint forces in the place of accelerations.

    Returns
    -------
    AbaResult or None
        None if there are no compiled kernels.
    """
    form = _format(state.samples, dtype)
    name = f"aba_{form.name}"
    if kernels.compiled(name) is None:
        return None
    inputs = _input(state, form)
    acceleration = _joint_target(model, inputs, form, out)
    base = np.ascontiguousarray(base, form.dtype)
    at = kernels.pointer
    ends = at(base), 12 * (base.ndim - 1), 0, 0
    results = at(acceleration), _stride(acceleration, inputs.columnwise), 0, 0, 0, 0
    valid = _run(name, model, inputs, ends, results, form, threads, forward_dynamics=True)
    return AbaResult(acceleration, valid)


def reduce_block(
    model: Model, state: JointState, *, inertia: bool, threads: int | None = None
) -> BlockReduction | None:
    """Put the bodies of a serial chain together; see `mp2a.kernels.reduce_block`.

    Parameters
    ----------
    model, state, threads
        As `rnea` takes them.
    inertia
        Whether the composite inertia is asked for, not the path alone.

    Returns
    -------
    BlockReduction or None
        None if there are no compiled kernels.
    """
    if kernels.compiled("reduce_block") is None:
        return None
    form = NUMBER_FORMATS[np.dtype(np.float64)]
    samples, inputs = state.samples, _input(state, form)
    padded = -(-samples // form.lanes) * form.lanes
    path, below = np.empty((24, padded)), np.empty((28, padded)) if inertia else None
    at = kernels.pointer
    # The kernel has no torque to write, but looks where it would be.
    results = at(inputs.held[0]), 0, at(path), padded, 0 if below is None else at(below), 0
    valid = _run("reduce_block", model, inputs, (0, 0, 0, 0), results, form, threads)
    whole, under = (None if x is None else np.ascontiguousarray(x[:, :samples].T) for x in (path, below))
    assert whole is not None
    return BlockReduction(whole, under, valid)


def placements(model: Model, q: Array, out: Placement, threads: int | None = None) -> bool | None:
    """Place the bodies of many samples; see `mp2a.kernels.placements`.

    Parameters
    ----------
    model, threads
        As `rnea` takes them.
    q
        Coordinates ``(T, nq)``; the kernel notices by itself if they are not what they should be.
    out
        Where to put the placements, ``(T, n, 3, 3)`` and ``(T, n, 3)``, contiguous doubles that do not overlap ``q``.

    Returns
    -------
    bool or None
        Whether every sample is valid; None if there are no compiled kernels.
    """
    form = _format(len(q), np.float64)
    name = f"placements_{form.name}"
    if kernels.compiled(name) is None:
        return None
    inputs = _input(JointState(q, q, q, None, False), form)
    at = kernels.pointer
    results = at(inputs.held[0]), 0, at(out.rotation), 0, at(out.translation), 0
    return _run(name, model, inputs, (0, 0, 0, 0), results, form, threads, bodies=True)


def _format(samples: int, dtype: np.dtype | type) -> NumberFormat:
    form = NUMBER_FORMATS[np.dtype(dtype)]
    return SCALAR if samples == 1 and form.dtype == SCALAR.dtype else form


class _Input(NamedTuple):
    """Input as kernels take it."""

    columnwise: bool
    numbers: tuple[int, ...]
    """Of a `KernelJob`, from ``external`` to ``a_stride``."""
    held: tuple[Array, ...]
    """Arrays that have to live as long as the job: q, v, a, and the external wrenches if there are any."""


def _input(state: JointState, form: NumberFormat) -> _Input:
    # A single sample in a single lane has its columns where they are.
    together = state.samples >= form.lanes and all(_fits(x, True) for x in (state.q, state.v, state.a))
    columnwise = together or form.lanes == 1
    held = tuple(_laid_out(x, form.dtype, columnwise) for x in (state.q, state.v, state.a))
    places: tuple[int, ...] = (0, 0, 0)
    strided = [number for x in held for number in (kernels.pointer(x), _stride(x, columnwise))]
    if state.external is not None:
        external = _rowwise(state.external, form.dtype)
        places, held = _places(external), (*held, external)
    return _Input(columnwise, (*places, *strided), held)


def _joint_target(model: Model, inputs: _Input, form: NumberFormat, out: Array | None) -> Array:
    """Where a kernel puts what it finds of the joints: ``out``, where that is laid out as the input and apart of it."""
    if out is not None and _fits(out, inputs.columnwise) and not _overlaps(out, inputs):
        return out
    return np.empty((len(inputs.held[0]), model.nv), form.dtype, order="F" if inputs.columnwise else "C")


def _overlaps(result: Array, inputs: _Input) -> bool:
    """Tell whether a kernel that writes a result might write over what it has yet to read."""
    return any(np.may_share_memory(result, x) for x in inputs.held)


def _run(
    name: str, model: Model, inputs: _Input, ends: tuple[int, ...], results: tuple[int, ...], form: NumberFormat,
    threads: int | None, *, bodies: bool = False, forward_dynamics: bool = False,
) -> bool:  # fmt: skip
    """Run a kernel in some threads; tells whether all samples are valid."""
    run = kernels.compiled(name)
    assert run is not None
    samples = len(inputs.held[0])
    chunks, work = -(-samples // form.lanes), len(model) * samples
    at = kernels.pointer
    tables = TABLES.get(model, form, bodies, forward_dynamics)
    constants = at(tables.body_constants), at(tables.frame_constants), at(tables.topology)
    sizes = len(model), samples, model.nq, model.nv, inputs.columnwise
    job: NDArray[np.int64] = np.array(
        KernelJob._make((*sizes, *constants, *ends, *inputs.numbers, *results)), dtype=np.int64
    )

    def share(count: int) -> bool:
        count = min(count, chunks)
        pieces = min(chunks, count * max(_FEWEST_PIECES, min(_PIECES, work // (count * _WORTH_A_THREAD))))
        return THREAD_POOL.run(run, job, chunks, pieces, np.empty((count, tables.scratch), form.dtype))

    if threads is not None:
        return share(threads)
    most = min(cores.threads_per_rank(), work // _WORTH_A_THREAD)
    if most < 2:
        return share(1)
    choice, start = CHOICES.get(model, name, work.bit_length()), perf_counter()
    shared = choice.is_shared()
    valid = share(most if shared else 1)
    choice.note(shared, perf_counter() - start)
    return valid


def _fits(array: Array, columnwise: bool) -> bool:
    """Tell whether the kernel can take an array as it lies, with the samples of a column together or not."""
    together, apart = array.strides if columnwise else array.strides[::-1]
    return (together == array.itemsize or (columnwise and len(array) == 1)) and apart % array.itemsize == 0


def _laid_out(array: Array, dtype: np.dtype, columnwise: bool) -> Array:
    array = array.astype(dtype, copy=False)
    return array if _fits(array, columnwise) else np.array(array, order="F" if columnwise else "C")


def _rowwise(external: Array, dtype: np.dtype) -> Array:
    """Wrenches whose six numbers lie together."""
    external = external.astype(dtype, copy=False)
    fits = external.strides[-1] == dtype.itemsize and not any(stride % dtype.itemsize for stride in external.strides)
    return external if fits else np.ascontiguousarray(external)


def _places(external: Array) -> tuple[int, int, int]:
    body, sample, _ = (stride // external.itemsize for stride in external.strides)
    return kernels.pointer(external), body, sample if external.shape[1] > 1 else 0


def _stride(array: Array, columnwise: bool) -> int:
    return array.strides[1 if columnwise else 0] // array.itemsize
