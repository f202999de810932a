"""Gather and scatter: one robot computes for all, with pinocchio."""

import numpy as np
from numpy.typing import NDArray

from mp2a.model import Model
from mp2a.reference import Reference
from mp2a.spatial import Array
from mp2a.transport.link import Link
from mp2a.transport.wait import wait

_STATE, _TORQUE = 1, 2


class GatherScatter:
    """Inverse dynamics by one robot for all: gather, pinocchio on rank 0, scatter.

    Parameters
    ----------
    link
        One rank a robot, in the order of the chain.
    model
        The whole chain.
    reference
        pinocchio's model of the chain on rank 0; None on all others.
    tree
        Gather and scatter along a binomial tree, as MPI's collectives do: ⌈log2 n⌉ messages one after another each way,
        and none of the robots talks to more than that many. Otherwise every robot talks to rank 0 itself: one
        message each way, but n - 1 of them at rank 0.
    """

    def __init__(self, link: Link, model: Model, reference: Reference | None, *, tree: bool = False) -> None:
        self._link = link
        self._rank, self._size = link.comm.Get_rank(), link.comm.Get_size()
        self._reference = reference
        self._tree = tree
        nq, nv = np.diff(model.q_starts), np.diff(model.v_starts)
        self._rows_in = np.concatenate(([0], np.cumsum(nq + 2 * nv)))
        self._rows_out = np.asarray(model.v_starts)
        begins = self._rows_in[:-1]
        spans = ((begins, nq), (begins + nq, nv), (begins + nq + nv, nv))
        self._rows = [
            np.concatenate([np.arange(at, at + count) for at, count in zip(*span, strict=True)]) for span in spans
        ]

    def rnea(self, q: Array, v: Array, a: Array) -> Array:
        """Torque ``(T, nv)`` of this robot's joint from its own q ``(T, nq)``, v and a ``(T, nv)``; collective."""
        samples = len(q)
        mine = np.concatenate((q.T, v.T, a.T)).reshape(-1)
        gather, scatter = (_tree_gather, _tree_scatter) if self._tree else (_gather, _scatter)
        whole = gather(self._link, mine, self._rows_in * samples)
        torque = np.empty(0)
        if self._reference is not None:
            rows = whole.reshape(-1, samples)
            torque = self._reference.torque(*(rows[part].T for part in self._rows)).T.reshape(-1)
        return scatter(self._link, torque, self._rows_out * samples).reshape(-1, samples).T


def _gather(link: Link, mine: Array, starts: NDArray[np.intp]) -> Array:
    """Collect every rank's part on rank 0, each in one message; ``starts`` says where it belongs."""
    rank, size = link.comm.Get_rank(), link.comm.Get_size()
    if rank:
        wait(link.send(mine, 0, _STATE))
        return mine
    whole = np.empty(starts[-1])
    coming = [link.receive(whole[starts[r] : starts[r + 1]], r, _STATE) for r in range(1, size)]
    whole[: starts[1]] = mine
    for receiving in coming:
        link.finish(receiving)
    return whole


def _scatter(link: Link, whole: Array, starts: NDArray[np.intp]) -> Array:
    """Send every rank its part from rank 0."""
    rank, size = link.comm.Get_rank(), link.comm.Get_size()
    if rank:
        mine = np.empty(starts[rank + 1] - starts[rank])
        link.finish(link.receive(mine, 0, _TORQUE))
        return mine
    for request in [link.send(whole[starts[r] : starts[r + 1]], r, _TORQUE) for r in range(1, size)]:
        wait(request)
    return whole[: starts[1]]


def _tree_gather(link: Link, mine: Array, starts: NDArray[np.intp]) -> Array:
    """Collect every rank's part on rank 0 along a binomial tree."""
    rank, size = link.comm.Get_rank(), link.comm.Get_size()
    branch = np.empty(starts[_end(rank, size)] - starts[rank])
    branch[: mine.size] = mine
    step = 1
    while step < size and not rank & step:
        child = rank + step
        if child < size:
            part = slice(starts[child] - starts[rank], starts[_end(child, size)] - starts[rank])
            link.finish(link.receive(branch[part], child, _STATE))
        step *= 2
    if rank:
        wait(link.send(branch, rank - step, _STATE))
    return branch


def _tree_scatter(link: Link, whole: Array, starts: NDArray[np.intp]) -> Array:
    """Send every rank its part from rank 0 along a binomial tree."""
    rank, size = link.comm.Get_rank(), link.comm.Get_size()
    step = rank & -rank if rank else 1 << (size - 1).bit_length()
    branch = whole
    if rank:
        branch = np.empty(starts[_end(rank, size)] - starts[rank])
        link.finish(link.receive(branch, rank - step, _TORQUE))
    sent = []
    while step > 1:
        step //= 2
        child = rank + step
        if child < size:
            part = slice(starts[child] - starts[rank], starts[_end(child, size)] - starts[rank])
            sent.append(link.send(branch[part], child, _TORQUE))
    for request in sent:
        wait(request)
    return branch[: starts[rank + 1] - starts[rank]]


def _end(rank: int, size: int) -> int:
    """One past the last rank of the branch that begins with a rank."""
    return min(rank + (rank & -rank), size) if rank else size
