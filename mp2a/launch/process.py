"""Ranks as one process of this one: started, waited for and ended together."""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, NoReturn

from mp2a.cores import set_timer_slack, usable_cores
from mp2a.launch.command import Launch, mpirun_command, open_mpi_version

# What the kernel may add to a sleep, in nanoseconds. MPI_Init waits in sleeps of 100 µs, and the wake-ups of 256 ranks
# starve the daemon they wait for: done in 42 s with the usual slack, in 27 s with 10 ms. More brings nothing, and
# 100 ms slows the daemon, which inherits it.
_START_SLACK = 10_000_000

_SHARED_MEMORY = "/dev/shm"

_SIGNALS = signal.SIGTERM, signal.SIGHUP
_KILLED = 128


class Ranks(subprocess.Popen[Any]):
    """A launcher and the ranks it started, a `subprocess.Popen`; as a context it ends them all when it is left.

    A SIGTERM or SIGHUP that would end this process at once, and leave the ranks running, leaves the context first.
    """

    directory: tempfile.TemporaryDirectory[str]
    """Where Open MPI keeps what the ranks share; gone with this object, however the ranks ended."""

    def __enter__(self) -> "Ranks":
        own = threading.current_thread() is threading.main_thread()
        self._handled = [number for number in _SIGNALS if own and signal.getsignal(number) == signal.SIG_DFL]
        for number in self._handled:
            signal.signal(number, _leave)
        return self

    def __exit__(self, *error: Any) -> None:
        try:
            end(self)
            super().__exit__(*error)
        finally:
            for number in self._handled:
                signal.signal(number, signal.SIG_DFL)


def _leave(number: int, frame: FrameType | None) -> NoReturn:
    raise SystemExit(_KILLED + number)


def start(
    ranks: int,
    program: Sequence[str],
    *,
    environment: Mapping[str, str] | None = None,
    preload: Sequence[str] = (),
    **options: Any,
) -> Ranks:
    """Start a program on many ranks, as `mpirun_command` says, in a session of their own.

    Use what is returned as a context, or call `end` on it: only that leaves no rank behind.

    Parameters
    ----------
    ranks : int
        How many processes to start.
    program : sequence of str
        The program and its arguments.
    environment : mapping of str to str, optional
        Variables to add, as for `mpirun_command`.
    preload : sequence of str, optional
        Modules the ranks run. With more ranks than cores, Open MPI, Linux and a program ``[sys.executable, "-m",
        module, …]`` or ``[sys.executable, "script.py", …]``, they are imported once, with mpi4py and numpy, and all
        ranks are forked from there, which halves the time and the memory of a start. Otherwise this says nothing.
        Their import must not look at what differs between ranks. A forked rank finds MPI initialised, and one that
        raises ends all. When mpirun ends the ranks, they get no other signal than SIGKILL.
    **options
        Options of `subprocess.Popen`.

    Returns
    -------
    Ranks
        A `subprocess.Popen` that ends when all ranks have, with the status of mpirun (for one that was killed, 128 and
        the signal).

    Raises
    ------
    DependencyError
        If there is no launcher.
    """
    shared = _SHARED_MEMORY if os.access(_SHARED_MEMORY, os.W_OK | os.X_OK) else None
    directory = tempfile.TemporaryDirectory(prefix="mp2a-", dir=shared, ignore_cleanup_errors=True)
    launch = mpirun_command(ranks, program, environment=environment, directory=directory.name)
    crowded = ranks > usable_cores()
    command = launch.command
    if preload and crowded and sys.platform == "linux" and open_mpi_version(command[0]) and _is_python(program):
        command = _forked(ranks, launch, program, preload)
    options = {"stdin": subprocess.DEVNULL} | options | {"env": launch.environment, "start_new_session": True}
    before = set_timer_slack(_START_SLACK) if crowded else 0
    try:
        process = Ranks(command, **options)
    finally:
        if before:
            set_timer_slack(before)
    process.directory = directory
    return process


def _is_python(program: Sequence[str]) -> bool:
    """Tell whether a program is a module or a script for this Python, with no other option of the interpreter."""
    return (
        len(program) > 1
        and program[0] == sys.executable
        and (program[1][:1] != "-" or program[1] == "-m" != program[-1])
    )


def _forked(ranks: int, launch: Launch, program: Sequence[str], preload: Sequence[str]) -> tuple[str, ...]:
    """Return the command of the server that forks the ranks, which is given mpirun's whole command."""
    numbers = str(ranks), str(len(program))
    return (sys.executable, "-m", "mp2a.launch.forked", ",".join(preload), *numbers, *launch.command)


class _Process(NamedTuple):
    """A process that runs, as ``/proc`` has it."""

    number: int
    name: str
    parent: int
    session: int


def _processes() -> Iterator[_Process]:
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            # "pid (name) state parent group session ...", and the name may hold anything.
            name, _, facts = (entry / "stat").read_text(errors="replace").partition("(")[2].rpartition(")")
            state, parent, _, session = facts.split()[:4]
            if state not in "ZX":
                yield _Process(int(entry.name), name, int(parent), int(session))


def _sessions(process: Ranks) -> set[int]:
    """Return the session of a launch, and those that MPICH's proxies have given their ranks, one each."""
    processes = list(_processes())
    proxies = {one.number for one in processes if one.session == process.pid and one.name.startswith("hydra")}
    return {process.pid} | {one.session for one in processes if one.parent in proxies}


def end(process: Ranks, *, grace: float = 5.0) -> None:
    """End what `start` started.

    Parameters
    ----------
    process : Ranks
        The launcher, which is asked to end.
    grace : float
        The time after which every rank that is left is killed, in seconds.
    """
    sessions = _sessions(process)
    try:
        if process.poll() is None:
            process.terminate()  # not SIGINT, which Open MPI wants twice
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(grace)
    finally:
        with contextlib.suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
        # Open MPI gives every rank a process group of its own, but the session stays. Look again until none is left,
        # as one may have been forking.
        for _ in range(200):
            members = [one.number for one in _processes() if one.session in sessions]
            if not members:
                break
            for member in members:
                with contextlib.suppress(OSError):
                    os.kill(member, signal.SIGKILL)
            time.sleep(0.02)
        process.wait()
        process.directory.cleanup()


def run(
    ranks: int,
    program: Sequence[str],
    *,
    timeout: float | None = None,
    environment: Mapping[str, str] | None = None,
    preload: Sequence[str] = (),
    **options: Any,
) -> subprocess.CompletedProcess[Any]:
    """Run a program on many ranks and wait for it; no rank is left when this returns or raises.

    Parameters
    ----------
    ranks, program, environment, preload, **options
        The same as of `start`.
    timeout : float, optional
        The time after which all ranks are ended, in seconds.

    Returns
    -------
    subprocess.CompletedProcess
        The status of mpirun, and what the ranks wrote to pipes.

    Raises
    ------
    DependencyError
        If there is no launcher.
    subprocess.TimeoutExpired
        After the timeout.
    """
    with start(ranks, program, environment=environment, preload=preload, **options) as process:
        stdout, stderr = process.communicate(timeout=timeout)
    return subprocess.CompletedProcess(process.args, process.returncode, stdout, stderr)
