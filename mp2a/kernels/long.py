"""One sample of a long chain: the chain cut into blocks, a block in each lane of a vector.

A block is a segment like any other: the path across it follows from its own joints, and the wrench that it puts on the
block before it, for given motion of its base, is its own and what the next block puts on it, carried along that path.
So three passes through all blocks at once do, with a scan over the few blocks after the first and the second: paths;
motion and each block's own wrench; torques.
"""

import weakref
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a import cores, kernels
from mp2a.chain import Chain
from mp2a.kernels.batch import Result
from mp2a.kernels.library import Run
from mp2a.kernels.plan import FORMATS, Job, Plan, lay_out_screws, make_plan
from mp2a.kernels.threads import share
from mp2a.leaf import State
from mp2a.spatial import Array, cross

WORTH_IT = 8000
"""Bodies from which on the blocks gain more than the scans over them take."""

_LONGEST = 8192
"""Bodies of a block, so that what a group of blocks leaves for the way back stays in the cache."""

_DOUBLE = FORMATS[np.dtype(np.float64)]
_LANES = _DOUBLE.lanes
_SINGLE_DEGREE = ("revolute", "continuous", "prismatic")


class Cut(NamedTuple):
    """A chain cut into groups of blocks."""

    hot: Array
    """``(groups, bodies of a block, HOT, lanes)``"""
    frames: Array
    """``(groups, bodies of a block, FRAME, lanes)``"""
    topology: NDArray[np.int64]
    """Of each block."""
    scratch: int
    """Numbers of scratch memory of a group."""
    spare: list[Array]
    """Scratch memory of earlier calls: new memory takes the system longer to give than the kernels take to fill."""

    @property
    def groups(self) -> int:
        """Number of groups."""
        return len(self.hot)

    @property
    def length(self) -> int:
        """Bodies of a block; the last blocks are filled up with bodies that are nothing."""
        return self.hot.shape[1]


def fits(chain: Chain, samples: int) -> bool:
    """Tell whether a chain is cut: one sample, long, without branches, and one degree of freedom a joint."""
    return samples == 1 and len(chain) >= WORTH_IT and chain.is_serial and set(chain.joints) <= set(_SINGLE_DEGREE)


def recursion(chain: Chain, state: State, base: Array, *, bodies: bool, threads: int | None) -> Result | None:
    """Inverse dynamics of one sample of a chain that `fits`; as `mp2a.kernels.batch.recursion`."""
    reach, run = kernels.compiled("reach"), kernels.compiled("rnea_lanes" + ("_bodies" if bodies else ""))
    if reach is None or run is None:
        return None
    n = len(chain)
    threads = cores.share() if threads is None else threads
    cut = _cut(chain, max(threads, -(-n // (_LANES * _LONGEST))), bodies)
    groups, length = cut.groups, cut.length
    places = groups * _LANES * length
    angles, sound = _angles(chain, state.q[0])
    q, v, a = (_filled(x, places) for x in (angles, state.v[0], state.a[0]))
    external = None if state.external is None else _filled(np.ascontiguousarray(state.external[:, 0]), places)
    torque, root = np.empty(places), np.empty((groups, 6, _LANES))
    paths = np.empty((groups, 24, _LANES))
    output = np.empty((groups, length, 18, _LANES) if bodies else (groups, 0))
    scratch = cut.spare.pop() if cut.spare else np.empty((groups, cut.scratch))
    tips, verdicts = np.zeros((groups, _LANES, 6)), np.zeros((groups, 1), np.int64)
    bases = np.empty((groups, _LANES, 12))
    cells = q.reshape(groups, -1), v.reshape(groups, -1), a.reshape(groups, -1), torque.reshape(groups, -1)

    def through(kernel: Run, output: Array, again: int = 0) -> None:
        """Run a kernel on all groups."""

        def work(pieces: Iterator[int]) -> None:
            at = kernels.pointer
            for k in pieces:
                # The arrays have to live as long as the kernel runs, so they have names.
                hot, frames, topology, base, tip = cut.hot[k], cut.frames[k], cut.topology, bases[k], tips[k]
                lists, out, wrench = [cell[k] for cell in cells], output[k], root[k]
                forces = None if external is None else external[k * _LANES * length :]
                strided = [number for cell in lists for number in (at(cell), length)]
                outside = (0, 0, 0) if forces is None else (at(forces), 6, 6 * length)
                tables = at(hot), at(frames), at(topology), at(base), 12, at(tip), 6
                numbers = (length, _LANES, length, length, 0, *tables, *outside, *strided, at(out), _LANES, at(wrench))
                job: NDArray[np.int64] = np.array(Job._make((*numbers, again)), dtype=np.int64)
                memory, verdict = scratch[k], verdicts[k]
                kernel(at(job), 0, 1, at(memory), at(verdict))

        share(work, groups, min(threads, groups))

    through(reach, paths)
    steps = _paths(paths)
    bases[...] = _bases(base, steps).reshape(groups, _LANES, 12)
    through(run, output)
    passed = _passed(steps, root.swapaxes(1, 2).reshape(-1, 6))
    tips[...] = passed[1:].reshape(groups, _LANES, 6)
    through(run, output, again=1)
    cut.spare.append(scratch)
    rows = None
    if bodies:
        rows = output.transpose(0, 3, 1, 2).reshape(places, 18)[:n, :, None]
    return Result(torque[None, :n], rows, passed[0][:, None], sound and not verdicts.any())


def _angles(chain: Chain, q: Array) -> tuple[Array, bool]:
    """One coordinate a body, and whether cosines and sines are of length 1."""
    if chain.nq == len(chain):
        return q, True
    angles, sound = np.empty(len(chain)), True
    for group in chain.groups:
        numbers = q[group.q_columns]
        if group.joint.nq == 1:
            angles[group.bodies] = numbers[:, 0]
        else:
            angles[group.bodies] = np.arctan2(numbers[:, 1], numbers[:, 0])
            sound = bool((np.abs(np.square(numbers).sum(1) - 1) <= 1e-6).all())
    return angles, sound


def _filled(values: Array, places: int) -> Array:
    if len(values) == places and values.flags.c_contiguous:
        return values
    filled = np.zeros((places, *values.shape[1:]))
    filled[: len(values)] = values
    return filled


def _paths(found: Array) -> Array:
    """Paths across the blocks as `mp2a.segments.motion` has them, ``(blocks, 24)``."""
    w, dw, a, v, turn, place = np.split(found.swapaxes(1, 2).reshape(-1, 24), (3, 6, 9, 12, 21), axis=1)
    return np.concatenate((turn, place, w, v, dw, a - cross(w, v)), axis=1)


def _bases(base: Array, paths: Array) -> Array:
    """Motion of what each block hangs on, as kernels take it, ``(blocks, 12)``."""
    w, dw, a, v = base.reshape(4, 3)
    reached = np.concatenate((np.eye(3).ravel(), np.zeros(3), w, v, dw, a - cross(w, v)))
    all_reached = np.empty((len(paths), 24))
    for place, path in zip(all_reached, paths, strict=True):
        place[:] = reached
        reached = kernels.compose(reached, path)
    w, v, dw, a = np.split(all_reached[:, 12:], 4, axis=1)
    return np.concatenate((w, dw, a + cross(w, v), v), axis=1)


def _passed(paths: Array, own: Array) -> Array:
    """Return what each block puts on the one before it, ``(blocks + 1, 6)``; the last of these is nothing."""
    passed = np.zeros((len(paths) + 1, 6))
    for k in range(len(paths) - 1, -1, -1):
        passed[k] = own[k] + kernels.carry(paths[k], passed[k + 1])
    return passed


_cuts: dict[tuple[int, int, bool], tuple[weakref.ref[Chain], Cut]] = {}


def _cut(chain: Chain, groups: int, bodies: bool) -> Cut:
    """Cut a chain; what came out is kept as long as the chain lives."""
    key = id(chain), groups, bodies
    known = _cuts.get(key)
    if known is None or known[0]() is not chain:
        whole = make_plan(chain, _DOUBLE, bodies=bodies)
        known = weakref.ref(chain, lambda _: _cuts.pop(key, None)), _make_cut(whole, groups, bodies)
        _cuts[key] = known
    return known[1]


def _make_cut(whole: Plan, groups: int, bodies: bool) -> Cut:
    n = len(whole.hot)
    length = -(-n // (groups * _LANES))
    tables: list[Array] = []
    for table, ones in ((whole.hot, (0,)), (whole.frames, (0, 4, 8, 18, 20))):
        columns = table.shape[1]
        filled = np.zeros((groups * _LANES * length, columns))
        filled[n:, ones] = 1.0  # cosines, and a frame's diagonal: a body that is nothing leaves all as it is
        filled[:n] = table
        tables.append(np.ascontiguousarray(filled.reshape(groups, _LANES, length, columns).transpose(0, 2, 3, 1)))
    topology, scratch = lay_out_screws(length, _DOUBLE, bodies=bodies)
    return Cut(tables[0], tables[1], topology, scratch, [])
