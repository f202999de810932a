"""The contenders of a run, ready to be called, and why some of them are left out."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from mp2a.bench.contenders import (
    ALONE,
    BLOCKS,
    GATHER_SCATTER,
    GATHER_SCATTER_TREE,
    MPI_SCAN,
    MPI_SCAN_DOUBLING,
    ONE_PROCESS,
    PINOCCHIO,
    PIPELINE,
    PIPELINE_BLOCKS,
)
from mp2a.bench.gather_scatter import GatherScatter
from mp2a.bench.mpi_scan import MPIScan, can_double, obtain_library
from mp2a.bench.pipeline import Pipeline
from mp2a.bench.settings import BenchSettings
from mp2a.distributed import DistributedModel
from mp2a.dynamics import rnea
from mp2a.exceptions import DependencyError
from mp2a.model import Model
from mp2a.mpi import MPI
from mp2a.reference import Reference
from mp2a.spatial import Array
from mp2a.transport.link import Link

Call = Callable[[Array, Array, Array], Array]
"""Torques of this rank's joints, ``(T, nv)``, from their q, v and a; collective."""

_ONE_EACH = (MPI_SCAN, PIPELINE, GATHER_SCATTER)
"""Those that have one body a rank."""


@dataclass(frozen=True)
class Lineup:
    """Who is measured on a communicator; made by `line_up`."""

    formations: Mapping[str, DistributedModel]
    """Our methods."""
    scans: Mapping[str, MPIScan]
    """MPI's own."""
    contenders: Mapping[str, Call]
    """All who are measured, those among them."""
    pipeline: Pipeline | None
    """The pipeline, which counts its processor time, if it is measured."""
    reference: Reference | None
    """pinocchio's model of the whole chain, on rank 0, if it is needed and fits in memory."""
    missing: list[str]
    """Who was left out and why, a sentence each."""

    @property
    def distributed(self) -> dict[str, Call]:
        """Those of whom every rank gets the torque of its own joints."""
        return {name: call for name, call in self.contenders.items() if name not in ALONE}

    def close(self) -> None:
        """Free what they hold of MPI; collective."""
        for formation in self.formations.values():
            formation.close()
        for scan in self.scans.values():
            scan.close()


def line_up(link: Link, model: Model, settings: BenchSettings, whole: tuple[Array, ...] | None) -> Lineup:
    """Make the contenders of a run ready; collective.

    Parameters
    ----------
    link
        One rank a body, or a block of them, over the network that is emulated, if one is.
    model
        The whole chain.
    settings
        The same on every rank.
    whole
        State of the whole chain on rank 0, for those that run in one process; None elsewhere.
    """
    comm = link.comm
    wanted, missing = set(settings.baselines), []
    if comm.Get_size() < len(model):
        missing += [f"{name} is left out: it has one body a rank." for name in _ONE_EACH if name in wanted]
        wanted -= set(_ONE_EACH)
    formations = {name: DistributedModel(comm, model, name, network=settings.network) for name in settings.methods}
    scans = _scans(comm, model, settings, missing) if MPI_SCAN in wanted else {}
    contenders: dict[str, Call] = {name: member.rnea for name, member in (formations | scans).items()}
    pipeline = Pipeline(link, model) if PIPELINE in wanted else None
    if pipeline is not None:
        contenders |= {PIPELINE: pipeline.rnea, PIPELINE_BLOCKS: Pipeline(link, model, BLOCKS).rnea}
    reference, fits = _reference(comm, model, missing) if wanted & {GATHER_SCATTER, PINOCCHIO} else (None, False)
    if GATHER_SCATTER in wanted and fits:
        contenders[GATHER_SCATTER] = GatherScatter(link, model, reference).rnea
        contenders[GATHER_SCATTER_TREE] = GatherScatter(link, model, reference, tree=True).rnea
    if ONE_PROCESS in wanted:
        contenders[ONE_PROCESS] = _on_rank_0(whole, partial(_in_one_process, model))
    if PINOCCHIO in wanted and fits:
        contenders[PINOCCHIO] = _on_rank_0(whole, reference.torque if reference else None)
    return Lineup(formations, scans, contenders, pipeline, reference, missing)


def _scans(comm: MPI.Intracomm, model: Model, settings: BenchSettings, missing: list[str]) -> dict[str, MPIScan]:
    """Make MPI's own scans, if they can be compiled and do not go past the network that is emulated."""
    if settings.network is not None:
        missing.append(f"{MPI_SCAN} is left out: its messages cannot be sent over an emulated network.")
        return {}
    try:
        library = obtain_library(comm)
    except DependencyError as error:
        missing.append(f"{MPI_SCAN} is left out: {error}.")
        return {}
    scans = {MPI_SCAN: MPIScan(comm, model, library)}
    if can_double(library):
        scans[MPI_SCAN_DOUBLING] = MPIScan(comm, model, library, doubling=True)
    else:
        missing.append(f"{MPI_SCAN_DOUBLING} is left out: this MPI does not let its users choose how it scans.")
    return scans


def _reference(comm: MPI.Intracomm, model: Model, missing: list[str]) -> tuple[Reference | None, bool]:
    """Build pinocchio's model on rank 0, if it fits there, and tell all ranks whether it does."""
    reference, error = None, None
    if comm.Get_rank() == 0:
        try:
            reference = Reference(model)
        except DependencyError as found:
            error = f"pinocchio is left out, and all that computes with it: {found}."
    error = comm.bcast(error)
    missing += [error] if error else []
    return reference, error is None


def _in_one_process(model: Model, q: Array, v: Array, a: Array) -> Array:
    """Call `mp2a.rnea` as its users do: with one sample, or with many."""
    return rnea(model, q[0], v[0], a[0])[None] if len(q) == 1 else rnea(model, q, v, a)


def _on_rank_0(whole: tuple[Array, ...] | None, compute: Call | None) -> Call:
    """Have rank 0 compute for the whole chain, with as many samples as it is asked for; the others do nothing."""
    if whole is None or compute is None:
        return lambda q, v, a: q
    return lambda q, v, a: compute(*(part[: len(q)] for part in whole))
