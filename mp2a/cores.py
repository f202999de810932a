"""What a rank has to know of the machine it shares with other ranks."""

import ctypes
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache

from mp2a.mpi_environment import rank_info

USUAL_SLACK = 50_000
"""Nanoseconds the kernel may add to a sleep, unless told otherwise."""

_PR_SET_TIMERSLACK = 29
_PR_GET_TIMERSLACK = 30


def usable_cores() -> int:
    """Return how many processor cores this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _local_ranks() -> int:
    info = rank_info()
    return info.local_size if info else 1


def _machine_cores() -> int:
    """Return how many cores all ranks of this machine have together."""
    if not hasattr(os, "sched_getaffinity"):
        return usable_cores()
    cores = os.sched_getaffinity(0)
    with suppress(OSError):
        # A rank that is bound to one core sees only that one; the launcher, its parent, sees all.
        cores |= os.sched_getaffinity(os.getppid())
    return len(cores)


@cache
def is_oversubscribed() -> bool:
    """Tell, in a rank and without asking the others, whether this machine has more ranks than cores."""
    return _local_ranks() > _machine_cores()


@cache
def mpi_yields() -> bool:
    """Tell whether MPI itself leaves the core to others whenever it is asked for a message that is not there."""
    return os.environ.get("OMPI_MCA_mpi_yield_when_idle") == "1"  # noqa: SIM112  that is its name


@cache
def threads_per_rank() -> int:
    """Return how many threads this process may run without taking cores from the other ranks of this machine."""
    return max(1, min(usable_cores(), _machine_cores() // _local_ranks()))


def available_memory() -> int | None:
    """Return the memory a new process could take without swapping, in bytes; None where the system does not say."""
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:  # noqa: PTH123
            return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        return None


def set_timer_slack(nanoseconds: int) -> int:
    """Set how much the kernel may add to this thread's sleeps, and to those of processes it starts.

    Returns
    -------
    int
        What it was before, in ns; 0 where there is no such thing.
    """
    prctl = _prctl()
    if prctl is None:
        return 0
    before = prctl(_PR_GET_TIMERSLACK, 0)
    prctl(_PR_SET_TIMERSLACK, nanoseconds)
    return before


def restore_timer_slack() -> None:
    """Make this thread's sleeps exact again after a start with `mp2a.launch`; for after MPI_Init."""
    prctl = _prctl()
    if prctl is not None and prctl(_PR_GET_TIMERSLACK, 0) > USUAL_SLACK:
        set_timer_slack(USUAL_SLACK)


@cache
def _prctl() -> Callable[..., int] | None:
    """Return the C library's prctl, or None where there is none."""
    if sys.platform != "linux":
        return None
    try:
        function = ctypes.CDLL(None).prctl
    except (OSError, AttributeError):
        return None
    function.argtypes = [ctypes.c_int] + [ctypes.c_ulong] * 4
    return lambda option, value: int(function(option, value, 0, 0, 0))
