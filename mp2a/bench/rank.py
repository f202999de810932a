"""What every rank of the benchmark runs: who is measured, and what else is known of a run."""

import os
import statistics
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mp2a import cost_model
from mp2a.bench.contenders import (
    BLOCKS,
    GATHER_SCATTER,
    GATHER_SCATTER_TREE,
    PINOCCHIO,
    PIPELINE,
    PIPELINE_BLOCKS,
)
from mp2a.bench.gather_scatter import GatherScatter
from mp2a.bench.machine import describe_machine, kernels_in_use
from mp2a.bench.pipeline import Pipeline
from mp2a.bench.settings import STARTED, BenchSettings
from mp2a.bench.timing import SINGLES, Timing, barrier, time_in_turn, trim_memory
from mp2a.cores import is_oversubscribed, usable_cores
from mp2a.distributed import DistributedModel
from mp2a.dynamics import rnea
from mp2a.exceptions import DependencyError
from mp2a.methods import METHODS
from mp2a.model import Model
from mp2a.mpi import MPI
from mp2a.reference import Reference
from mp2a.spatial import Array
from mp2a.transport.link import Link, make_link, measure_latency
from mp2a.transport.wait import wait

_QUIET = 1.0


def measure_run(settings: BenchSettings, report: Callable[[str], None]) -> dict[str, Any] | None:
    """Measure all contenders on the world communicator; collective.

    Parameters
    ----------
    settings
        The same on every rank.
    report
        Called on rank 0 with what is being done.

    Returns
    -------
    dict or None
        The run for the results file on rank 0, None elsewhere.
    """
    comm = MPI.COMM_WORLD
    rank, n = comm.Get_rank(), comm.Get_size()
    say = report if rank == 0 else lambda _: None
    machine = describe_machine() if rank == 0 else {}
    barrier(comm)
    up = time.time()
    say("chain")
    model = Model.random(n, settings.seed)
    batch = model.random_state(settings.samples, settings.seed, body=rank)
    network = settings.network
    formations = {name: DistributedModel(comm, model, name, network=network) for name in settings.methods}
    reference, missing = _reference(model) if rank == 0 else (None, None)
    pinocchio_fits = comm.bcast(reference is not None)

    link = make_link(comm, network)
    pipeline = Pipeline(link, model)
    contenders: dict[str, Callable[..., Array]] = {name: f.rnea for name, f in formations.items()}
    contenders |= {PIPELINE: pipeline.rnea, PIPELINE_BLOCKS: Pipeline(link, model, BLOCKS).rnea}
    if pinocchio_fits:
        contenders[GATHER_SCATTER] = GatherScatter(link, model, reference).rnea
        contenders[GATHER_SCATTER_TREE] = GatherScatter(link, model, reference, tree=True).rnea
        contenders[PINOCCHIO] = _alone(model, reference, settings)
    methods = {}
    for name, formation in formations.items():
        say(f"checking {name}")
        torque = contenders[name](*batch)
        methods[name] = {
            **_counted(formation),
            "sent": _sent(comm, formation, settings.samples),
            "error": _error(comm, model, settings, reference, torque),
        }
    trim_memory()
    memory, used = _memory(comm), _kernels(comm)
    measured, hops = {}, {}
    sizes = {"batch": batch, "single": tuple(part[:SINGLES] for part in batch)}
    if settings.samples == 1:
        del sizes["batch"]
    for size, state in sizes.items():
        before = np.array([pipeline.alone, pipeline.hopping, pipeline.samples])
        measured[size] = time_in_turn(comm, contenders, state, settings, say, single=size == "single")
        hops[size] = _pipeline_alone(comm, np.array([pipeline.alone, pipeline.hopping, pipeline.samples]) - before)
    say("network")
    constants = _network(link, settings, measured)
    for formation in formations.values():
        formation.close()
    if rank:
        return None
    began = os.environ.get(STARTED)
    return {
        "n": n,
        **settings.identity(),
        "date": time.strftime("%Y-%m-%d %H:%M:%S%z"),
        "machine": machine | {"kernels": used},
        "cores": usable_cores(),
        "oversubscribed": is_oversubscribed(),
        "started_s": up - float(began) if began else None,
        "memory": memory,
        "missing": missing,
        "methods": methods,
        "measured": {name: {size: values[name].summary() for size, values in measured.items()} for name in contenders},
        "extrapolated": _extrapolated(settings, measured) | {PIPELINE: hops},
        "modelled": _modelled(n, settings, constants),
        "constants": constants._asdict(),
    }


def _reference(model: Model) -> tuple[Reference | None, str | None]:
    try:
        return Reference(model), None
    except DependencyError as error:
        return None, str(error)


def _alone(model: Model, reference: Reference | None, settings: BenchSettings) -> Callable[..., Array]:
    """Time pinocchio's serial loop on rank 0, which knows all; the other ranks do nothing."""
    if reference is None:
        return lambda q, v, a: q
    whole = model.random_state(settings.samples, settings.seed)
    return lambda q, v, a: reference.torque(*(part[: len(q)] for part in whole))


def _pipeline_alone(comm: MPI.Intracomm, spent: Array) -> float:
    """Seconds a sample of the pipeline with a core a robot and a network that takes no time; on rank 0.

    The robots' own work, which they do at the same time (its largest over ranks), and all hops one after another.
    """
    mine = spent[:2] / spent[2]
    most, total = np.empty(2), np.empty(2)
    wait(comm.Ireduce(mine, most, MPI.MAX))
    wait(comm.Ireduce(mine, total, MPI.SUM))
    return float(most[0] + total[1])


def _error(
    comm: MPI.Intracomm, model: Model, settings: BenchSettings, reference: Reference | None, torque: Array
) -> dict[str, Any] | None:
    """Largest error of all robots' torques over the largest torque, on rank 0."""
    columns = comm.gather(torque[:SINGLES])
    if columns is None:
        return None
    whole = tuple(part[:SINGLES] for part in model.random_state(settings.samples, settings.seed))
    ours = np.concatenate(columns, axis=1)
    against = "pinocchio" if reference is not None else "mp2a serial"
    theirs = reference.torque(*whole) if reference is not None else rnea(model, *whole)
    return {"relative": float(np.abs(ours - theirs).max() / np.abs(theirs).max()), "against": against}


def _counted(formation: DistributedModel) -> dict[str, int]:
    """Count rounds, messages and bytes of a sample as the schedule says."""
    count = formation.schedule.count(METHODS[formation.method].doubles)
    return {"rounds": count.rounds, "messages": count.total, "bytes": 8 * count.doubles}


def _sent(comm: MPI.Intracomm, formation: DistributedModel, samples: int) -> dict[str, int] | None:
    """Messages of a call and bytes a sample that all ranks have sent in the one call so far, on rank 0."""
    transport = formation.transport
    mine = np.array([sum(transport.messages.values()), transport.doubles])
    total = comm.reduce(mine)
    return {"messages": int(total[0]), "bytes": 8 * int(total[1]) // samples} if total is not None else None


def _kernels(comm: MPI.Intracomm) -> str | None:
    """Tell which kernels the ranks use, and on how many of them, on rank 0."""
    everyone = comm.gather(kernels_in_use())
    if everyone is None:
        return None
    counts = Counter(everyone)
    return "; ".join(f"{kind} on {count} ranks" if len(counts) > 1 else kind for kind, count in counts.items())


def _memory(comm: MPI.Intracomm) -> dict[str, Any] | None:
    """Memory of the ranks in bytes: shared pages counted once (proportional), and private, on rank 0."""
    fields = {"Pss": 0, "Private_Clean": 0, "Private_Dirty": 0}
    try:
        for line in Path("/proc/self/smaps_rollup").read_text(encoding="ascii").splitlines():
            name, _, rest = line.partition(":")
            if name in fields:
                fields[name] = int(rest.split()[0]) * 1024
    except OSError:
        return None
    sizes = comm.gather((fields["Pss"], fields["Private_Clean"] + fields["Private_Dirty"]))
    if sizes is None:
        return None
    others = [private for _, private in sizes[1:]]
    return {
        "proportional_total": sum(pss for pss, _ in sizes),
        "rank_0": sizes[0][0],
        "private_median": int(statistics.median(others)) if others else sizes[0][1],
    }


def _network(link: Link, settings: BenchSettings, measured: dict[str, dict[str, Timing]]) -> cost_model.Network:
    """Constants of eq. 11-13: as given, or measured between ranks 0 and 1 and from the pipeline."""
    small, large = (_ping_pong(link, size) for size in (6, 84_000))
    latency = settings.latency if settings.latency is not None else small
    speed = settings.speed if settings.speed is not None else 64 * 84_000 / max(large - small, 1e-9)
    hops = statistics.median(measured["single"][PIPELINE].wall)
    serial = settings.serial_time if settings.serial_time is not None else hops * settings.samples
    return cost_model.Network(serial, latency, speed, settings.bits)


def _ping_pong(link: Link, doubles: int) -> float:
    """Median one-way seconds of a message between ranks 0 and 1; 0 elsewhere."""
    barrier(link.comm)
    times = measure_latency(link, doubles, 20)
    if not times:
        time.sleep(_QUIET)  # and not in the barrier, where hundreds of ranks looking for it would be in the way
    barrier(link.comm)
    return statistics.median(times) if times else 0.0


def _modelled(n: int, settings: BenchSettings, network: cost_model.Network) -> dict[str, dict[str, float]]:
    """Seconds a sample that eq. 13 gives with the true counts and with Table I's, and a pipeline's messages."""
    samples = settings.samples
    out = {}
    for label, counts in (
        ("kogge-stone", cost_model.true_messages),
        ("kogge-stone, table I", cost_model.table_one_messages),
    ):
        seconds = cost_model.total_time(n, samples, counts(n), network) / samples
        out[label] = {"batch": seconds, "single": seconds}
    hops = network.serial_time if settings.serial_time is not None else cost_model.pipeline_time(n, samples, network)
    out["serial"] = {"batch": hops / samples, "single": hops / samples}
    return out


def _extrapolated(settings: BenchSettings, measured: dict[str, dict[str, Timing]]) -> dict[str, dict[str, float]]:
    """Tell what a machine with a core a robot would need: the largest processor time of a rank."""
    return {
        name: {size: statistics.median(values[name].cpu) for size, values in measured.items()}
        for name in settings.methods
    }
