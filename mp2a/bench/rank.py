"""What every rank of the benchmark runs: the contenders in turn, each timed by itself."""

import ctypes
import gc
import os
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from mp2a import model
from mp2a.bench.opponents import Centre, Relay
from mp2a.bench.settings import STARTED, Settings
from mp2a.chain import Chain
from mp2a.cores import is_oversubscribed, usable_cores
from mp2a.distributed import DistributedChain
from mp2a.dynamics import rnea
from mp2a.exceptions import MissingError
from mp2a.methods import METHODS
from mp2a.reference import Reference
from mp2a.spatial import Array
from mp2a.transport.wait import wait

_PIPELINE = 16
_BATCHES = 10
_SINGLES = 64
_QUIET = 1.0


class Timing(NamedTuple):
    """Seconds a sample, one value a repeat."""

    wall: list[float]
    """From the barrier to the last rank's end."""
    cpu: list[float]
    """Largest processor time of a rank."""

    def summary(self) -> dict[str, Any]:
        """Medians and all values, for the results file."""
        return {
            "wall": statistics.median(self.wall),
            "cpu": statistics.median(self.cpu),
            "walls": self.wall,
            "cpus": self.cpu,
        }


def run(settings: Settings, report: Callable[[str], None]) -> dict[str, Any] | None:
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
    barrier(comm)
    up = time.time()
    say("chain")
    chain = Chain.random(n, settings.seed)
    batch = chain.random_state(settings.samples, settings.seed, body=rank)
    formation = DistributedChain(comm, chain, settings.method)
    reference, missing = _reference(chain) if rank == 0 else (None, None)
    pinocchio_fits = comm.bcast(reference is not None)

    relay = Relay(comm, chain)
    contenders: dict[str, Callable[..., Array]] = {
        settings.method: lambda *state: formation.rnea(*state).torque,
        "relay": relay.rnea,
        "relay, pipelined": Relay(comm, chain, _PIPELINE).rnea,
    }
    if pinocchio_fits:
        contenders["centre"] = Centre(comm, chain, reference).rnea
        contenders["pinocchio"] = _alone(chain, reference, settings)
    say("first calls")
    torque = contenders[settings.method](*batch)
    sent = _sent(comm, formation, settings.samples)
    error = _error(comm, chain, settings, reference, torque)
    memory = _memory(comm)
    some = tuple(part[:_SINGLES] for part in batch)
    measured, hops = {}, {}
    for size, state in (("batch", batch), ("single", some)):
        before = np.array([relay.alone, relay.hopping, relay.samples])
        measured[size] = _measure(comm, contenders, state, settings, say, single=size == "single")
        hops[size] = _relay_alone(comm, np.array([relay.alone, relay.hopping, relay.samples]) - before)
    say("network")
    network = _network(comm, settings, measured)
    count = formation.schedule.count(METHODS[settings.method].doubles)
    formation.close()
    if rank:
        return None
    began = os.environ.get(STARTED)
    return {
        **{"n": n, "samples": settings.samples, "seed": settings.seed, "method": settings.method},
        "date": time.strftime("%Y-%m-%d %H:%M:%S%z"),
        "cores": usable_cores(),
        "oversubscribed": is_oversubscribed(),
        "repeats": settings.repeats,
        "started_s": up - float(began) if began else None,
        "memory": memory,
        "schedule": {"rounds": count.rounds, "messages": count.total, "bytes": 8 * count.doubles},
        "sent": sent,
        "error": error,
        "missing": missing,
        "measured": {name: {size: values[name].summary() for size, values in measured.items()} for name in contenders},
        "extrapolated": {
            settings.method: {
                size: statistics.median(values[settings.method].cpu) for size, values in measured.items()
            },
            "relay": hops,
        },
        "modelled": _modelled(n, settings, network),
        "network": network._asdict(),
    }


def barrier(comm: MPI.Intracomm) -> None:
    """Wait for all ranks, asleep where ranks share cores."""
    wait(comm.Ibarrier())


def _reference(chain: Chain) -> tuple[Reference | None, str | None]:
    try:
        return Reference(chain), None
    except MissingError as error:
        return None, str(error)


def _alone(chain: Chain, reference: Reference | None, settings: Settings) -> Callable[..., Array]:
    """Time pinocchio's serial loop on rank 0, which knows all; the other ranks do nothing."""
    if reference is None:
        return lambda q, v, a: q
    whole = chain.random_state(settings.samples, settings.seed)
    return lambda q, v, a: reference.torque(*(part[: len(q)] for part in whole))


def _measure(
    comm: MPI.Intracomm,
    contenders: dict[str, Callable[..., Array]],
    state: tuple[Array, ...],
    settings: Settings,
    say: Callable[[str], None],
    *,
    single: bool = False,
) -> dict[str, Timing]:
    """Time the contenders in turn, interleaved, so that what the machine does meanwhile falls on all alike."""
    size = "one sample at a time" if single else f"{len(state[0])} samples together"
    say(f"{size}: first calls")
    first = {name: _timed(comm, call, state, 1, single=single) for name, call in contenders.items()}
    samples = 1 if single else len(state[0])
    walls = {name: wall * samples for name, (wall, _) in first.items()}
    repeats, calls = comm.bcast(_affordable(walls, settings, min(_SINGLES, len(state[0])) if single else _BATCHES))
    if repeats == 0:
        return {name: Timing([wall], [cpu]) for name, (wall, cpu) in first.items()}
    timings = {name: Timing([], []) for name in contenders}
    for repeat in range(repeats):
        for name, call in contenders.items():
            say(f"{size}: {name}, repeat {repeat + 1} of {repeats}")
            wall, cpu = _timed(comm, call, state, calls[name], single=single)
            timings[name].wall.append(wall)
            timings[name].cpu.append(cpu)
    return timings


def _affordable(walls: dict[str, float], settings: Settings, most: int) -> tuple[int, dict[str, int]]:
    """How many repeats, and calls in each, the time allows; no repeat where the first calls have used it up."""
    repeats = min(settings.repeats, int(settings.seconds / sum(walls.values())))
    share = settings.seconds / max(repeats, 1) / len(walls)
    return repeats, {name: min(max(int(share / wall), 1), most) for name, wall in walls.items()}


def _timed(
    comm: MPI.Intracomm, call: Callable[..., Array], state: tuple[Array, ...], calls: int, *, single: bool
) -> tuple[float, float]:
    """Wall and largest processor seconds a sample of some calls in a row."""
    arguments = _one_by_one(state)[:calls] if single else [state] * calls
    gc.collect()
    _give_back()
    barrier(comm)
    wall, cpu = time.perf_counter(), time.process_time()
    for sample in arguments:
        call(*sample)
    mine = np.array([time.perf_counter() - wall, time.process_time() - cpu])
    most = np.empty(2)
    wait(comm.Iallreduce(mine, most, MPI.MAX))
    done = calls if single else calls * len(state[0])
    return float(most[0]) / done, float(most[1]) / done


def _give_back() -> None:
    """Return the memory of what the last contender left to the system, so that hundreds of ranks fit."""
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc's
        if trim is not None:
            trim(0)


def _one_by_one(state: tuple[Array, ...]) -> list[tuple[Array, ...]]:
    """Cut a trajectory into its samples."""
    return [tuple(part[t : t + 1] for part in state) for t in range(len(state[0]))]


def _relay_alone(comm: MPI.Intracomm, spent: Array) -> float:
    """Seconds a sample of the relay with a core a robot and a network that takes no time; on rank 0.

    The robots' own work, which they do at the same time (its largest over ranks), and all hops one after another.
    """
    mine = spent[:2] / spent[2]
    most, total = np.empty(2), np.empty(2)
    wait(comm.Ireduce(mine, most, MPI.MAX))
    wait(comm.Ireduce(mine, total, MPI.SUM))
    return float(most[0] + total[1])


def _error(
    comm: MPI.Intracomm, chain: Chain, settings: Settings, reference: Reference | None, torque: Array
) -> dict[str, Any] | None:
    """Largest error of all robots' torques over the largest torque, on rank 0."""
    columns = comm.gather(torque[:_SINGLES])
    if columns is None:
        return None
    whole = tuple(part[:_SINGLES] for part in chain.random_state(settings.samples, settings.seed))
    ours = np.concatenate(columns, axis=1)
    against = "pinocchio" if reference is not None else "mp2a serial"
    theirs = reference.torque(*whole) if reference is not None else rnea(chain, *whole)
    return {"relative": float(np.abs(ours - theirs).max() / np.abs(theirs).max()), "against": against}


def _sent(comm: MPI.Intracomm, formation: DistributedChain, samples: int) -> dict[str, int] | None:
    """Messages of a call and bytes a sample that all ranks have sent in the one call so far, on rank 0."""
    transport = formation.transport
    mine = np.array([sum(transport.messages.values()), transport.doubles])
    total = comm.reduce(mine)
    return {"messages": int(total[0]), "bytes": 8 * int(total[1]) // samples} if total is not None else None


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


def _network(comm: MPI.Intracomm, settings: Settings, measured: dict[str, dict[str, Timing]]) -> model.Network:
    """Constants of eq. 11-13: as given, or measured between ranks 0 and 1 and from the relay."""
    small, large = (_ping_pong(comm, size) for size in (6, 84_000))
    latency = settings.latency if settings.latency is not None else small
    speed = settings.speed if settings.speed is not None else 64 * 84_000 / max(large - small, 1e-9)
    relay = statistics.median(measured["single"]["relay"].wall)
    serial = settings.serial_time if settings.serial_time is not None else relay * settings.samples
    return model.Network(serial, latency, speed, settings.bits)


def _ping_pong(comm: MPI.Intracomm, doubles: int, rounds: int = 50) -> float:
    """Median one-way seconds of a message between ranks 0 and 1; 0 for one rank alone."""
    rank = comm.Get_rank()
    barrier(comm)
    if rank > 1 or comm.Get_size() == 1:
        time.sleep(_QUIET)  # and not in the barrier, where hundreds of ranks looking for it would be in the way
        barrier(comm)
        return 0.0
    data, times = np.zeros(doubles), []
    for _ in range(rounds):
        began = time.perf_counter()
        for sender in (0, 1):
            wait(comm.Isend(data, 1 - rank) if sender == rank else comm.Irecv(data, 1 - rank))
        times.append((time.perf_counter() - began) / 2)
    barrier(comm)
    return statistics.median(times)


def _modelled(n: int, settings: Settings, network: model.Network) -> dict[str, dict[str, float]]:
    """Seconds a sample that eq. 13 gives with the true counts and with Table I's, and a relay's messages."""
    samples = settings.samples
    out = {}
    for label, counts in (("kogge-stone", model.true_messages), ("kogge-stone, table I", model.table_one_messages)):
        seconds = model.total_time(n, samples, counts(n), network) / samples
        out[label] = {"batch": seconds, "single": seconds}
    hops = network.serial_time if settings.serial_time is not None else model.relay_time(n, samples, network)
    out["serial"] = {"batch": hops / samples, "single": hops / samples}
    return out
