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
from mp2a.bench.contenders import PIPELINE
from mp2a.bench.lineup import line_up
from mp2a.bench.machine import describe_machine, kernels_in_use
from mp2a.bench.pipeline import Pipeline
from mp2a.bench.settings import STARTED, BenchSettings
from mp2a.bench.timing import SINGLES, Timing, barrier, time_in_turn, trim_memory
from mp2a.cores import is_oversubscribed, usable_cores
from mp2a.distributed import DistributedModel
from mp2a.dynamics import rnea
from mp2a.exceptions import DependencyError
from mp2a.methods import METHODS, block
from mp2a.model import Model
from mp2a.mpi import MPI
from mp2a.reference import Reference
from mp2a.spatial import Array
from mp2a.transport.agreement import shared_errors
from mp2a.transport.link import Link, make_link, measure_latency
from mp2a.transport.wait import wait

_QUIET = 1.0
_ROUNDING = 1e-9


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
    model = Model.random(settings.chain_length(n), settings.seed)
    whole = _random_state(model, settings) if rank == 0 else None
    link = make_link(comm, settings.network)
    lineup = line_up(link, model, settings, whole)
    batch = _own_part(comm, whole, next(iter(lineup.formations.values())).v_columns)
    methods = {}
    for name, call in lineup.distributed.items():
        say(f"checking {name}")
        error = _check(comm, name, model, call(*batch), lineup.reference, whole)
        if name in lineup.formations:
            formation = lineup.formations[name]
            methods[name] = {**_counted(formation), "sent": _sent(comm, formation, settings.samples), "error": error}
    trim_memory()
    memory, used = _memory(comm), _kernels(comm)
    measured: dict[str, dict[str, Timing]] = {}
    hops = {}
    sizes = {"batch": batch, "single": tuple(part[:SINGLES] for part in batch)}
    if settings.samples == 1:
        del sizes["batch"]
    for size, state in sizes.items():
        before = _spent(lineup.pipeline)
        measured[size] = time_in_turn(comm, lineup.contenders, state, settings, say, single=size == "single")
        if lineup.pipeline is not None:
            hops[size] = _pipeline_alone(comm, _spent(lineup.pipeline) - before)
    say("network")
    constants = _network(link, settings, measured["single"])
    lineup.close()
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
        "missing": lineup.missing,
        "methods": methods,
        "measured": {
            name: {size: values[name].summary() for size, values in measured.items()} for name in lineup.contenders
        },
        "extrapolated": _extrapolated(settings, measured) | ({PIPELINE: hops} if hops else {}),
        "modelled": None if constants is None else _modelled(n, settings, constants),
        "constants": None if constants is None else constants._asdict(),
    }


def _random_state(model: Model, settings: BenchSettings) -> tuple[Array, ...]:
    """q, v and a of a whole chain of revolute joints; faster than `Model.random_state`, which goes body by body."""
    rng, shape = np.random.default_rng(settings.seed), (settings.samples, model.nv)
    v, a = rng.normal(size=(2, *shape)) / np.sqrt(len(model))
    return rng.uniform(-np.pi, np.pi, shape), v, a


def _own_part(comm: MPI.Intracomm, whole: tuple[Array, ...] | None, columns: slice) -> tuple[Array, ...]:
    """Hand every rank the state of its own joints, which rank 0 has; collective."""
    wanted = comm.gather(columns)
    parts = None
    if whole is not None and wanted is not None:
        parts = [tuple(np.ascontiguousarray(part[:, own]) for part in whole) for own in wanted]
    own: tuple[Array, ...] = comm.scatter(parts)
    return own


def _spent(pipeline: Pipeline | None) -> Array:
    """Processor seconds of the pipeline so far, alone and hopping, and its samples."""
    return np.array([pipeline.alone, pipeline.hopping, pipeline.samples]) if pipeline is not None else np.zeros(3)


def _pipeline_alone(comm: MPI.Intracomm, spent: Array) -> float:
    """Seconds a sample of the pipeline with a core a robot and a network that takes no time; on rank 0.

    The robots' own work, which they do at the same time (its largest over ranks), and all hops one after another.
    """
    mine = spent[:2] / spent[2]
    most, total = np.empty(2), np.empty(2)
    wait(comm.Ireduce(mine, most, MPI.MAX))
    wait(comm.Ireduce(mine, total, MPI.SUM))
    return float(most[0] + total[1])


def _check(
    comm: MPI.Intracomm,
    name: str,
    model: Model,
    torque: Array,
    reference: Reference | None,
    whole: tuple[Array, ...] | None,
) -> dict[str, Any] | None:
    """Largest error of all torques over the largest torque, on rank 0; raises on all if that is no rounding."""
    columns = comm.gather(torque[:SINGLES])
    error = None
    with shared_errors(comm):
        if columns is not None and whole is not None:
            state = tuple(part[:SINGLES] for part in whole)
            theirs = reference.torque(*state) if reference is not None else rnea(model, *state)
            against = "pinocchio" if reference is not None else "mp2a.rnea"
            relative = float(np.abs(np.concatenate(columns, axis=1) - theirs).max() / np.abs(theirs).max())
            if not relative < _ROUNDING:
                raise DependencyError(f"{name}: its torques differ from {against}'s by {relative:.0e} of the largest")
            error = {"relative": relative, "against": against}
    return error


def _counted(formation: DistributedModel) -> dict[str, int]:
    """Count rounds, messages and bytes of a sample as the schedule says."""
    count = formation.schedule.count({**block.DOUBLES, **METHODS[formation.method].doubles})
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


def _network(link: Link, settings: BenchSettings, single: dict[str, Timing]) -> cost_model.Network | None:
    """Constants of eq. 11-13, as given, or measured between ranks 0 and 1 and from the pipeline; None without those."""
    if PIPELINE not in single or link.comm.Get_size() == 1:
        return None
    small, large = (_ping_pong(link, size) for size in (6, 84_000))
    latency = settings.latency if settings.latency is not None else small
    speed = settings.speed if settings.speed is not None else 64 * 84_000 / max(large - small, 1e-9)
    hops = statistics.median(single[PIPELINE].wall)
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
