"""What started this rank, and how a process notices that it is gone.

When mpirun itself is killed, the ranks of Open MPI go on without it: nobody would stop their robots. So a rank that
drives ends with its launcher, and the watchdog of its robot watches the launcher as well. Linux tells both of its end
at once, whoever has to collect what is left of it (pidfd, since Linux 5.3); elsewhere nothing is watched.

Without numpy, for the watchdog needs none.
"""

import contextlib
import os
import select
import signal
import sys
import threading
from pathlib import Path

from mp2a.mpi_environment import RANK_VARIABLES


def launcher_pid() -> int | None:
    """Return the process that started this rank: the nearest ancestor that is not a rank itself, nor in one.

    A script that mpirun starts, and that starts the planner, has the variables of a rank; mpirun has not.
    """
    pid = os.getpid()
    while pid > 1 and _is_in_rank(pid):
        pid = _parent(pid)
    return pid if pid > 1 and pid != os.getpid() else None


def open_launcher(pid: int | None) -> int | None:
    """Return a file descriptor that can be read once process ``pid`` has ended; None if it cannot be watched.

    Raises
    ------
    ProcessLookupError
        If it has ended already.
    """
    if pid is None or not hasattr(os, "pidfd_open"):
        return None
    try:
        return os.pidfd_open(pid)
    except ProcessLookupError:
        raise
    except OSError:  # an older kernel
        return None


def end_with_launcher() -> None:
    """Let this rank end, by SIGTERM, as soon as what started it has ended; collective calls would wait for ever."""
    with contextlib.suppress(ProcessLookupError):
        descriptor = open_launcher(launcher_pid())
        if descriptor is not None:
            threading.Thread(target=_end_after, args=(descriptor,), daemon=True).start()


def _end_after(descriptor: int) -> None:
    select.select([descriptor], [], [])
    with contextlib.suppress(OSError):  # the terminal may be gone as well
        print("mp2a: mpirun has ended, and so does this rank", file=sys.stderr, flush=True)
    os.kill(os.getpid(), signal.SIGTERM)


def _is_in_rank(pid: int) -> bool:
    try:
        variables = Path(f"/proc/{pid}/environ").read_bytes().split(b"\0")
    except OSError:  # of another user, which a rank of ours is not
        return False
    return any(os.fsdecode(variable.partition(b"=")[0]) in RANK_VARIABLES for variable in variables)


def _parent(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        return 0
