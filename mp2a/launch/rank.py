"""What a forked process does as a rank: it takes over what mpirun gave to its stub, and runs the program."""

import atexit
import ctypes
import os
import runpy
import signal
import sys
import threading
from collections.abc import Mapping, Sequence
from typing import NoReturn

_PR_SET_PDEATHSIG = 1
_STANDARD = 0, 1, 2


def die_with(parent: int, number: int) -> None:
    """Have the kernel send this process a signal when its parent is gone, which holds across an exec."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number, 0, 0, 0)
    if os.getppid() != parent:
        os.kill(os.getpid(), number)


def run_as_rank(
    parent: int,
    environment: Mapping[bytes, bytes],
    folder: str,
    descriptors: Sequence[int],
    program: Sequence[str],
) -> NoReturn:
    """Run a program as a rank in this process, just forked, and end it.

    The interpreter is not torn down: that takes 11 ms, and writes to, and so copies, most of what ranks share.

    Parameters
    ----------
    parent : int
        The process it was forked from.
    environment : mapping of bytes to bytes
        The environment that mpirun gave to the stub.
    folder : str
        The working directory of the stub.
    descriptors : sequence of int
        The stub's standard input, output and error.
    program : sequence of str
        The program, as `mp2a.launch.start` takes it.
    """
    status = 1
    try:
        die_with(parent, signal.SIGKILL)
        os.setpgid(0, 0)  # as mpirun does with its children: a rank that signals its group means its own
        for descriptor, standard in zip(descriptors, _STANDARD, strict=True):
            os.dup2(descriptor, standard)
            os.close(descriptor)
        for stream in (sys.stdout, sys.stderr):
            stream.reconfigure(line_buffering=stream is sys.stderr or stream.isatty())  # type: ignore[union-attr]
        os.environb.clear()
        os.environb.update(environment)
        os.chdir(folder)
        if "numpy.random" in sys.modules:
            # The module random does so by itself. Without it, all ranks would draw the same numbers.
            sys.modules["numpy.random"].seed()
        status = _run(program)
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        os._exit(status)


def _run(program: Sequence[str]) -> int:
    """Run the program between MPI_Init and MPI_Finalize; returns its exit status."""
    import mpi4py
    from mpi4py import MPI

    MPI.Init_thread(getattr(MPI, f"THREAD_{mpi4py.rc.thread_level.upper()}"))
    try:
        status, alone = _main(program), False
        # What the end of an interpreter does before it clears its modules.
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        sys.stdout.flush()
    except BaseException:
        sys.excepthook(*sys.exc_info())
        status, alone = 1, True
    sys.stderr.flush()
    if not MPI.Is_finalized():
        if alone or (status and tuple(program[1:3]) == ("-m", "mpi4py")):
            MPI.COMM_WORLD.Abort(status)  # the others would wait for this rank for ever
        MPI.Finalize()
    return status


def _main(program: Sequence[str]) -> int:
    """Run a module or a script as the interpreter does; returns the exit status that it asks for."""
    safe = getattr(sys.flags, "safe_path", False)
    try:
        if program[1] == "-m":
            sys.argv = list(program[2:])
            runpy.run_module(program[2], run_name="__main__", alter_sys=True)
        else:
            sys.argv = list(program[1:])
            if not safe:
                sys.path[0] = os.path.dirname(os.path.realpath(program[1]))  # noqa: PTH120
            runpy.run_path(program[1], run_name="__main__")
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return end.code or 0
        print(end.code, file=sys.stderr)
        return 1
    return 0
