"""The contenders of a run, ready to be called, and why some of them are left out."""

from collections.abc import Callable
from dataclasses import dataclass, field

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


@dataclass
class Lineup:
    """Who is measured on a communicator; made by `line_up`."""

    formations: dict[str, DistributedModel]
    """Our methods."""
    contenders: dict[str, Call]
    """All who are measured, our methods among them."""
    pipeline: Pipeline | None = None
    """The pipeline, which counts its processor time, if it is measured."""
    reference: Reference | None = None
    """pinocchio's model of the whole chain, on rank 0, if it is needed and fits in memory."""
    missing: list[str] = field(default_factory=list)
    """Who was left out and why, a sentence each."""
    scans: list[MPIScan] = field(default_factory=list)

    @property
    def distributed(self) -> dict[str, Call]:
        """Those of whom every rank gets the torque of its own joints."""
        return {name: call for name, call in self.contenders.items() if name not in ALONE}

    def close(self) -> None:
        """Free what they hold of MPI; collective."""
        for formation in self.formations.values():
            formation.close()
        for scan in self.scans:
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
    formations = {name: DistributedModel(comm, model, name, network=settings.network) for name in settings.methods}
    lineup = Lineup(formations, {name: formation.rnea for name, formation in formations.items()})
    wanted = set(settings.baselines)
    if comm.Get_size() < len(model):
        lineup.missing += [f"{name} is left out: it has one body a rank." for name in _ONE_EACH if name in wanted]
        wanted -= set(_ONE_EACH)
    if MPI_SCAN in wanted:
        _add_scans(lineup, comm, model, settings)
    if PIPELINE in wanted:
        lineup.pipeline = Pipeline(link, model)
        lineup.contenders[PIPELINE] = lineup.pipeline.rnea
        lineup.contenders[PIPELINE_BLOCKS] = Pipeline(link, model, BLOCKS).rnea
    fits = bool(wanted & {GATHER_SCATTER, PINOCCHIO}) and _add_reference(lineup, comm, model)
    if GATHER_SCATTER in wanted and fits:
        lineup.contenders[GATHER_SCATTER] = GatherScatter(link, model, lineup.reference).rnea
        lineup.contenders[GATHER_SCATTER_TREE] = GatherScatter(link, model, lineup.reference, tree=True).rnea
    if ONE_PROCESS in wanted:
        lineup.contenders[ONE_PROCESS] = _on_rank_0(whole, lambda q, v, a: rnea(model, q, v, a))
    if PINOCCHIO in wanted and fits:
        lineup.contenders[PINOCCHIO] = _on_rank_0(whole, lineup.reference.torque if lineup.reference else None)
    return lineup


def _add_scans(lineup: Lineup, comm: MPI.Intracomm, model: Model, settings: BenchSettings) -> None:
    """Add MPI's own scan, if it can be compiled and does not go past the network that is emulated."""
    if settings.network is not None:
        lineup.missing.append(f"{MPI_SCAN} is left out: its messages cannot be sent over an emulated network.")
        return
    try:
        library = obtain_library(comm)
    except DependencyError as error:
        lineup.missing.append(f"{MPI_SCAN} is left out: {error}.")
        return
    lineup.scans.append(MPIScan(comm, model, library))
    lineup.contenders[MPI_SCAN] = lineup.scans[-1].rnea
    if can_double(library):
        lineup.scans.append(MPIScan(comm, model, library, doubling=True))
        lineup.contenders[MPI_SCAN_DOUBLING] = lineup.scans[-1].rnea
    else:
        lineup.missing.append(f"{MPI_SCAN_DOUBLING} is left out: this MPI does not let its users choose how it scans.")


def _add_reference(lineup: Lineup, comm: MPI.Intracomm, model: Model) -> bool:
    """Build pinocchio's model on rank 0, if it fits there; whether it does, on all."""
    error = None
    if comm.Get_rank() == 0:
        try:
            lineup.reference = Reference(model)
        except DependencyError as found:
            error = f"pinocchio is left out, and {GATHER_SCATTER}, which computes with it: {found}."
    error = comm.bcast(error)
    lineup.missing += [error] if error else []
    return error is None


def _on_rank_0(whole: tuple[Array, ...] | None, compute: Call | None) -> Call:
    """Have rank 0 compute for the whole chain, with as many samples as it is asked for; the others do nothing."""
    if whole is None or compute is None:
        return lambda q, v, a: q
    return lambda q, v, a: compute(*(part[: len(q)] for part in whole))
