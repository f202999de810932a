"""Timing contenders fairly: interleaved, over all ranks, within a time allowed."""

import ctypes
import gc
import statistics
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from mp2a.bench.settings import BenchSettings
from mp2a.mpi import MPI
from mp2a.spatial import Array
from mp2a.transport.wait import wait

SINGLES = 64
"""Most samples that are timed one at a time in a repeat."""

_BATCHES = 10


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


def barrier(comm: MPI.Intracomm) -> None:
    """Wait for all ranks, asleep where ranks share cores."""
    wait(comm.Ibarrier())


def time_in_turn(
    comm: MPI.Intracomm,
    contenders: Mapping[str, Callable[..., Array]],
    state: tuple[Array, ...],
    settings: BenchSettings,
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
    repeats, calls = comm.bcast(_affordable(walls, settings, min(SINGLES, len(state[0])) if single else _BATCHES))
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


def _affordable(walls: dict[str, float], settings: BenchSettings, most: int) -> tuple[int, dict[str, int]]:
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
    trim_memory()
    barrier(comm)
    wall, cpu = time.perf_counter(), time.process_time()
    for sample in arguments:
        call(*sample)
    mine = np.array([time.perf_counter() - wall, time.process_time() - cpu])
    most = np.empty(2)
    wait(comm.Iallreduce(mine, most, MPI.MAX))
    done = calls if single else calls * len(state[0])
    return float(most[0]) / done, float(most[1]) / done


def trim_memory() -> None:
    """Return the memory of what the last contender left to the system, so that hundreds of ranks fit."""
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc's
        if trim is not None:
            trim(0)


def _one_by_one(state: tuple[Array, ...]) -> list[tuple[Array, ...]]:
    """Cut a trajectory into its samples."""
    return [tuple(part[t : t + 1] for part in state) for t in range(len(state[0]))]
