"""One sample of a long chain: the chain cut into blocks, a block in each lane of a vector.

A block is a segment like any other: the path across it follows from its own joints, and the wrench that it puts on the
block before it, for given motion of its base, is its own and what the next block puts on it, carried along that path.
So three passes through all blocks at once do, with a scan over the few blocks after the first and the second: paths;
motion and each block's own wrench; torques.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a import cores, kernels
from mp2a.kernels.batch import BlockReduction, KernelResult
from mp2a.kernels.library import Kernel
from mp2a.kernels.model_cache import ModelCache
from mp2a.kernels.tables import NUMBER_FORMATS, KernelJob, lay_out_screws, make_tables
from mp2a.kernels.thread_pool import THREAD_POOL
from mp2a.model import Model
from mp2a.spatial import Array, cross
from mp2a.validation import JointState

WORTH_IT = 8000
"""Bodies from which on the blocks gain more than the scans over them take."""

_WORTH_A_THREAD = 40_000
"""Bodies for each thread: with fewer, waking the others three times takes longer than they save."""

_LONGEST = 8192
"""Bodies of a block, so that what a group of blocks leaves for the way back stays in the cache."""

_DOUBLE = NUMBER_FORMATS[np.dtype(np.float64)]
_LANES = _DOUBLE.lanes
_SINGLE_DEGREE = ("revolute", "continuous", "prismatic")


class Cut(NamedTuple):
    """A chain cut into groups of blocks."""

    body_constants: Array
    """``(groups, bodies of a block, BODY_CONSTANTS, lanes)``"""
    frame_constants: Array
    """``(groups, bodies of a block, FRAME_CONSTANTS, lanes)``"""
    topology: NDArray[np.int64]
    """Of each block."""
    scratch: int
    """Numbers of scratch memory of a group."""
    last: Array
    """``(3, 3)``: frame of the last body's tables to the user's."""
    spare: list[Array]
    """Scratch memory of earlier calls: new memory takes the system longer to give than the kernels take to fill."""

    @property
    def groups(self) -> int:
        """Number of groups."""
        return len(self.body_constants)

    @property
    def length(self) -> int:
        """Bodies of a block; the last blocks are filled up with bodies that are nothing."""
        return self.body_constants.shape[1]


def fits(model: Model, samples: int) -> bool:
    """Tell whether a chain is cut: one sample, long, without branches, and one degree of freedom a joint."""
    if samples != 1 or len(model) < WORTH_IT or not model.is_serial:
        return False
    return all(group.joint.name in _SINGLE_DEGREE for group in model.groups)


def rnea(
    model: Model, state: JointState, base: Array, tip: Array | None = None, *, bodies: bool, threads: int | None
) -> KernelResult | None:
    """Inverse dynamics of one sample of a chain that `fits`; as `mp2a.kernels.batch.rnea`."""
    reduce, run = kernels.compiled("reduce_block_lanes"), kernels.compiled("rnea_lanes" + ("_bodies" if bodies else ""))
    if reduce is None or run is None:
        return None
    work = _prepare(model, state, threads, bodies=bodies)
    groups, length = work.cut.groups, work.cut.length
    paths, root = np.empty((groups, 24, _LANES)), np.empty((groups, 6, _LANES))
    output = np.empty((groups, _LANES * length, 18) if bodies else (groups, 0))
    valid = _through(work, reduce, paths, None) and work.valid
    block_paths = np.ascontiguousarray(paths.swapaxes(1, 2).reshape(-1, 24))
    work.bases[...] = _bases(np.reshape(base, 12), block_paths).reshape(groups, _LANES, 12)
    valid &= _through(work, run, output, root)
    last = np.zeros(6) if tip is None else -(tip.reshape(2, 3) @ work.cut.last).ravel()
    passed = _passed(block_paths, root.swapaxes(1, 2).reshape(-1, 6), last)
    work.tips[...] = passed[1:].reshape(groups, _LANES, 6)
    valid &= _through(work, run, output, root, backward_only=1)
    work.cut.spare.append(work.scratch)
    n, rows = len(model), None
    if bodies:
        rows = output.reshape(1, -1, 18)[:, :n]
    torque = work.columns[3].reshape(-1)
    return KernelResult(torque[None, :n], rows, passed[0][:, None], valid)


def reduce_block(
    model: Model, state: JointState, *, inertia: bool, threads: int | None = None
) -> BlockReduction | None:
    """Put the bodies of a chain that `fits` together; as `mp2a.kernels.batch.reduce_block`."""
    reduce = kernels.compiled("reduce_block_lanes")
    if reduce is None:
        return None
    work = _prepare(model, state, threads, bodies=False)
    paths = np.empty((work.cut.groups, 24, _LANES))
    inertias = np.empty((work.cut.groups, 28, _LANES)) if inertia else None
    valid = _through(work, reduce, paths, inertias) and work.valid
    work.cut.spare.append(work.scratch)
    block_paths = np.ascontiguousarray(paths.swapaxes(1, 2).reshape(-1, 24))
    whole = block_paths[0]
    for path in block_paths[1:]:
        whole = kernels.compose(whole, path)
    turn = np.zeros(24)
    turn[:9] = work.cut.last.T.ravel()
    whole = kernels.compose(whole, turn)
    below = None
    if inertias is not None:
        parts = np.ascontiguousarray(inertias.swapaxes(1, 2).reshape(-1, 28))
        below = parts[-1]
        for path, part in zip(block_paths[-2::-1], parts[-2::-1], strict=True):
            below = part + kernels.transform(below, path)
    return BlockReduction(whole[None], None if below is None else below[None], valid)


class _Work(NamedTuple):
    """What the passes over the blocks share."""

    cut: Cut
    threads: int
    columns: tuple[Array, ...]
    """q, v, a and the torque, ``(groups, bodies of a group)``."""
    external: Array | None
    bases: Array
    tips: Array
    scratch: Array
    valid: bool


def _prepare(model: Model, state: JointState, threads: int | None, *, bodies: bool) -> _Work:
    if threads is None:
        threads = max(1, min(cores.threads_per_rank(), len(model) // _WORTH_A_THREAD))
    groups = max(threads, -(-len(model) // (_LANES * _LONGEST)))
    cut = _CUTS.get(model, groups, bodies)
    places = groups * _LANES * cut.length
    angles, valid = _angles(model, state.q[0])
    columns = *(_filled(x, places) for x in (angles, state.v[0], state.a[0])), np.empty(places)
    external = None if state.external is None else _filled(np.ascontiguousarray(state.external[:, 0]), places)
    scratch = cut.spare.pop() if cut.spare else np.empty((groups, cut.scratch))
    bases, tips = np.zeros((groups, _LANES, 12)), np.zeros((groups, _LANES, 6))
    cells = tuple(x.reshape(groups, -1) for x in columns)
    return _Work(cut, threads, cells, external, bases, tips, scratch, valid)


def _through(work: _Work, kernel: Kernel, output: Array, root: Array | None, backward_only: int = 0) -> bool:
    """Run a kernel on all groups; tells whether everything is valid."""
    cut, length, at = work.cut, work.cut.length, kernels.pointer
    jobs: list[NDArray[np.int64]] = []
    alive = []
    for k in range(cut.groups):
        # The arrays have to live as long as the kernel runs.
        tables = [
            cut.body_constants[k],
            cut.frame_constants[k],
            work.bases[k],
            work.tips[k],
            *(column[k] for column in work.columns),
        ]
        ends = [output[k], *([] if root is None else [root[k]])]
        forces = [] if work.external is None else [work.external[k * _LANES * length :]]
        alive += [tables, ends, forces]
        body_constants, frame_constants, base, tip, *columns = map(at, tables)
        numbers = (
            length, _LANES, length, length, 0, body_constants, frame_constants, at(cut.topology), base, 12, tip, 6,
            *((at(forces[0]), 6, 6 * length) if forces else (0, 0, 0)),
            *(number for column in columns for number in (column, length)),
            at(ends[0]), _LANES, 0 if root is None else at(ends[1]), backward_only,
        )  # fmt: skip
        jobs.append(np.array(KernelJob._make(numbers), dtype=np.int64))
    return THREAD_POOL.run_each(kernel, jobs, work.scratch, min(work.threads, cut.groups))


def _angles(model: Model, q: Array) -> tuple[Array, bool]:
    """One coordinate a body, and whether cosines and sines are of length 1."""
    if model.nq == len(model):
        return q, True
    angles, valid = np.empty(len(model)), True
    for group in model.groups:
        numbers = q[group.q_columns]
        if group.joint.nq == 1:
            angles[group.bodies] = numbers[:, 0]
        else:
            angles[group.bodies] = np.arctan2(numbers[:, 1], numbers[:, 0])
            valid = bool((np.abs(np.square(numbers).sum(1) - 1) <= 1e-6).all())
    return angles, valid


def _filled(values: Array, places: int) -> Array:
    if len(values) == places and values.flags.c_contiguous:
        return values
    filled = np.zeros((places, *values.shape[1:]))
    filled[: len(values)] = values
    return filled


def _bases(base: Array, paths: Array) -> Array:
    """Motion of what each block hangs on, as kernels take it, ``(blocks, 12)``."""
    w, dw, a, v = base.reshape(4, 3)
    motion = np.concatenate((np.eye(3).ravel(), np.zeros(3), w, v, dw, a - cross(w, v)))
    motions = np.empty((len(paths), 24))
    for place, path in zip(motions, paths, strict=True):
        place[:] = motion
        motion = kernels.compose(motion, path)
    w, v, dw, a = np.split(motions[:, 12:], 4, axis=1)
    return np.concatenate((w, dw, a + cross(w, v), v), axis=1)


def _passed(paths: Array, own: Array, last: Array) -> Array:
    """Return what each block puts on the one before it, ``(blocks + 1, 6)``, and what the last one bears."""
    passed = np.empty((len(paths) + 1, 6))
    passed[-1] = last
    for k in range(len(paths) - 1, -1, -1):
        passed[k] = own[k] + kernels.transform_force(paths[k], passed[k + 1])
    return passed


def _make_cut(model: Model, groups: int, bodies: bool) -> Cut:
    n, whole = len(model), make_tables(model, _DOUBLE, bodies)
    length = -(-n // (groups * _LANES))
    tables: list[Array] = []
    for table, ones in ((whole.body_constants, (0,)), (whole.frame_constants, (0, 4, 8, 18, 20))):
        columns = table.shape[1]
        filled = np.zeros((groups * _LANES * length, columns))
        filled[n:, ones] = 1.0  # cosines, and a frame's diagonal: a body that is nothing leaves all as it is
        filled[:n] = table
        tables.append(np.ascontiguousarray(filled.reshape(groups, _LANES, length, columns).transpose(0, 2, 3, 1)))
    topology, scratch = lay_out_screws(length, _DOUBLE, bodies=bodies)
    return Cut(tables[0], tables[1], topology, scratch, whole.frame_constants[-1, :9].reshape(3, 3), [])


_CUTS = ModelCache(_make_cut)
