"""What ranks agree on before they work together: the model, who holds what of it, the network and the method."""

import hashlib
import statistics
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import array, count
from mp2a.exceptions import InputError
from mp2a.methods import METHODS
from mp2a.methods.auto import AUTO, Choice, choose
from mp2a.methods.block import even_counts
from mp2a.model import Model
from mp2a.mpi import MPI
from mp2a.network import EmulatedNetwork
from mp2a.schedule import Formation
from mp2a.spatial import Array
from mp2a.transport.agreement import raise_together
from mp2a.transport.link import EmulatedLink, Link, make_link, measure_latency
from mp2a.transport.wait import wait
from mp2a.validation import check_gravity, check_model

if TYPE_CHECKING:
    import pinocchio

_SMALL, _LARGE, _ROUNDS = 24, 24_000, 7
_ALONE = 10.0
"""Seconds after which a rank that has no communicator stops waiting for the others in the world's."""


class Setup(NamedTuple):
    """What all ranks have agreed on."""

    model: Model
    gravity: Array
    counts: tuple[int, ...]
    """Bodies of each rank."""
    link: Link


def duplicate(comm: MPI.Intracomm) -> MPI.Intracomm:
    """Duplicate a communicator; collective.

    A rank that gives none is taken to mean the world's, where the others mostly wait: all raise the error.

    Raises
    ------
    InputError
        On every rank, if one of the world's gave no communicator; on that one alone if the others do not wait there.
    """
    error: Exception | None = None
    if not isinstance(comm, MPI.Intracomm) or comm == MPI.COMM_NULL:
        error = InputError(f"comm: got {type(comm).__name__}, expected an mpi4py intra-communicator")
        comm = MPI.COMM_WORLD
    own, request = comm.Idup()
    until = time.monotonic() + _ALONE
    if error is None:
        wait(request)
    else:
        while not request.Test():
            if time.monotonic() > until:
                raise error
            time.sleep(1e-3)
    try:
        raise_together(own, error)
    except InputError:
        own.Free()
        raise
    return own


def set_up(
    comm: MPI.Intracomm,
    model: "Model | pinocchio.Model | str | Path",
    method: str,
    gravity: ArrayLike | None,
    counts: Sequence[int] | None,
    samples: int,
    network: EmulatedNetwork | None,
) -> Setup:
    """Check the arguments of a `mp2a.DistributedModel` on every rank, and that they are the same on all; collective.

    Raises
    ------
    InputError
        On every rank, for a wrong argument on any, or arguments that differ.
    """
    error: Exception | None = None
    digest, setup = bytes(32), None
    try:
        whole = _read(model)
        _check_method(method)
        field = check_gravity(whole, gravity)
        shares = _shares(counts, whole, comm.Get_size())
        count("samples", samples)
        setup = Setup(whole, field, shares, make_link(comm, network))
        same = f"{whole.digest()} {method} {field.tolist()} {shares} {samples} {network}"
        digest = hashlib.sha256(same.encode()).digest()
    except Exception as wrong:
        error = wrong
    raise_together(comm, error)
    root = np.frombuffer(digest, dtype=np.uint8).copy()
    wait(comm.Ibcast(root, 0))
    if root.tobytes() != digest:
        what = "model, method, gravity, counts, samples, network"
        error = InputError(f"{what}: differ from those of rank 0, expected the same on every rank")
    raise_together(comm, error)
    assert setup is not None
    return setup


def choose_method(link: Link, nodes: Formation, samples: int) -> Choice:
    """Choose a method on rank 0 for what messages cost between ranks 0 and 1, and tell all; collective."""
    if isinstance(link, EmulatedLink):
        latency, bandwidth = link.network
    else:
        small, large = (measure_latency(link, doubles, _ROUNDS) or [0.0] for doubles in (_SMALL, _LARGE))
        latency, slow = statistics.median(small), statistics.median(large)
        bandwidth = 64 * (_LARGE - _SMALL) / max(slow - latency, 1e-9)
    cost = np.array([latency, bandwidth])
    wait(link.comm.Ibcast([cost, MPI.DOUBLE], 0))
    return choose(nodes, samples, float(cost[0]), float(cost[1]))


def _read(model: "Model | pinocchio.Model | str | Path") -> Model:
    if not isinstance(model, str | Path):
        return check_model(model)
    return Model.load(model) if Path(model).suffix == ".npz" else Model.from_urdf(model)


def _check_method(method: str) -> None:
    if not isinstance(method, str) or method not in (AUTO, *METHODS):
        raise InputError(f"method: got {method!r}, expected one of {', '.join(map(repr, (AUTO, *METHODS)))}")


def _shares(counts: Sequence[int] | None, model: Model, ranks: int) -> tuple[int, ...]:
    """Check how many bodies each rank is to hold."""
    n = len(model)
    if n < ranks:
        raise InputError(f"model: got {n} bodies for a communicator of {ranks} ranks, expected at least one a rank")
    if n > ranks and not model.is_serial:
        raise InputError(f"model: got a tree of {n} bodies for a communicator of {ranks} ranks, expected one a rank")
    if counts is None:
        return even_counts(n, ranks)
    given = array("counts", counts, (None,), whole=True).tolist()
    if len(given) != ranks or min(given) < 1 or sum(given) != n:
        raise InputError(
            f"counts: got {given}, expected {ranks} whole numbers of at least 1, one a rank, with the sum {n} of bodies"
        )
    return tuple(given)
