"""The process all ranks are forked from: ``python -m mp2a.launch.forked modules ranks length mpirun … program …``.

It imports mpi4py, numpy and the modules once, starts mpirun on stubs, and forks a rank for each stub that connects:
with 512 ranks on two cores half the time and half the memory of 512 interpreters that import for themselves. A rank
that ends is reported to its stub, and a stub that ends takes its rank with it, so that mpirun governs the ranks as if
it had started them. Whoever is killed, all others end: ranks and mpirun when the server does (the kernel sees to it),
stubs when their connection closes.
"""

import contextlib
import gc
import marshal
import os
import selectors
import signal
import socket
import struct
import sys
import time
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from mp2a.exceptions import DependencyError
from mp2a.launch.rank import die_with, run_as_rank

_ALWAYS = ("mp2a.mpi", "numpy")
_BACKLOG = 4096
_KILLED = 128
_GRACE = 10.0
_STANDARD = 3
_HEADER = struct.Struct("Q")
_PEER = struct.Struct("3i")
_SIGNALS = signal.SIGCHLD, signal.SIGTERM


def main(modules: str, ranks: str, length: str, *command: str) -> int:
    """Preload the modules and serve; returns mpirun's exit status.

    Parameters
    ----------
    modules : str
        The modules to import, separated by commas.
    ranks : str
        How many ranks mpirun starts.
    length : str
        How many words at the end of the command are the program.
    *command : str
        mpirun, its options and the program.

    Returns
    -------
    int
        The status.
    """
    import mpi4py

    mpi4py.rc.initialize = False  # a process that has initialised MPI may not fork
    os.environ.pop("MPI4PY_RC_INITIALIZE", None)  # which would win
    try:
        for name in (*_ALWAYS, *modules.split(",")):
            import_module(name)
    except DependencyError as error:
        print(error, file=sys.stderr)
        return 1
    if len(list(Path("/proc/self/task").iterdir())) > 1:
        # Threads are not forked, and what they held stays locked: every rank has to import for itself.
        os.execv(command[0], command)
    launcher, program = command[: -int(length)], command[-int(length) :]
    return _Server(int(ranks), program).serve(
        (*launcher, sys.executable, "-I", "-S", str(Path(__file__).with_name("stub.py")))
    )


class _Server:
    """The server, which forks ranks, and tells stubs of the end of ranks and ranks of the end of stubs."""

    def __init__(self, missing: int, program: Sequence[str]) -> None:
        self.missing = missing
        """How many ranks mpirun has not started yet."""
        self.program = program
        self.process = os.getpid()
        self.mpirun = 0
        self.status: int | None = None
        self.deadline: float | None = None
        self.stubs: dict[int, socket.socket] = {}
        """The connection to each stub, by the process of its rank."""
        self.ranks: dict[Any, int] = {}
        """The process of each rank, by the connection to its stub."""
        self.listener = socket.socket(socket.AF_UNIX)
        # Signals come as bytes through a pipe, so that none interrupts anything.
        self.signal_reader, self.signal_writer = os.pipe()
        self.handlers = {number: signal.signal(number, lambda *_: None) for number in _SIGNALS}
        self.selector = selectors.DefaultSelector()

    def serve(self, command: tuple[str, ...]) -> int:
        """Run mpirun to its end; returns its exit status."""
        os.set_blocking(self.signal_writer, False)
        signal.set_wakeup_fd(self.signal_writer)
        self.listener.bind("")  # the kernel finds a name, which is in no file system, where it might be left
        self.listener.listen(_BACKLOG)
        self.selector.register(self.signal_reader, selectors.EVENT_READ)
        self.selector.register(self.listener, selectors.EVENT_READ)
        sys.stdout.flush()  # or every rank would say it again
        gc.collect()
        gc.freeze()  # the collector would write to what ranks share, and so copy it
        try:
            self._start(command)
            while self.status is None:
                for key, _ in self.selector.select(self._timeout()):
                    if key.fileobj == self.signal_reader:
                        self._handle_signals()
                    elif key.fileobj is self.listener:
                        self._fork_rank()
                    elif process := self.ranks.pop(key.fileobj, None):
                        # A stub says nothing more: it has ended, and its rank has to.
                        os.kill(process, signal.SIGKILL)
                        self.selector.unregister(key.fileobj)
                        self._set_deadline()
        finally:
            self._end()
        return self.status

    def _set_deadline(self) -> None:
        """Give mpirun, which should end now, some time to do so.

        Open MPI 5.0.11 often waits for ever when a rank dies, or it is told to end, while it starts others (64 ranks,
        not forked: in 15 of 25 tries). Otherwise it takes 0.8 s with 256 ranks.
        """
        if self.deadline is None:
            self.deadline = time.monotonic() + _GRACE

    def _timeout(self) -> float | None:
        """Return how long to wait for the next event; None for ever."""
        if self.deadline is None:
            return None
        left = self.deadline - time.monotonic()
        if left <= 0:
            os.kill(self.mpirun, signal.SIGKILL)
            self.deadline = None
            return None
        return left

    def _fork(self, child: Callable[[], NoReturn]) -> int:
        """Fork a process in which nothing is left of the server; returns its number."""
        process = os.fork()
        if process:
            return process
        try:
            signal.set_wakeup_fd(-1)
            for number, handler in self.handlers.items():
                signal.signal(number, handler)
            self.selector.close()
            for file in (self.listener, *self.stubs.values()):
                file.close()
            for descriptor in (self.signal_reader, self.signal_writer):
                os.close(descriptor)
            child()
        except BaseException:
            sys.excepthook(*sys.exc_info())
        finally:
            os._exit(1)

    def _start(self, command: tuple[str, ...]) -> None:
        """Start mpirun."""
        environment = {**os.environb, b"MP2A_FORK_SERVER": self.listener.getsockname()[1:]}

        def mpirun() -> NoReturn:
            for number in (signal.SIGPIPE, signal.SIGXFSZ):  # which Python ignores
                signal.signal(number, signal.SIG_DFL)
            die_with(self.process, signal.SIGKILL)  # at a SIGTERM it may wait for ever, and nobody is left to see that
            os.execve(command[0], command, environment)

        self.mpirun = self._fork(mpirun)

    def _fork_rank(self) -> None:
        """Fork the rank of a stub that has connected."""
        stub, _ = self.listener.accept()
        _, user, _ = _PEER.unpack(stub.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size))
        if user != os.geteuid():  # anyone on the machine can connect
            stub.close()
            return
        header, descriptors, _, _ = socket.recv_fds(stub, _HEADER.size, _STANDARD)
        data, size = b"", _HEADER.unpack(header)[0] if header else 0
        while len(data) < size and (more := stub.recv(size - len(data))):
            data += more
        if not size or len(data) < size:
            stub.close()  # killed already: mpirun knows
            return
        environment, folder = marshal.loads(data)

        def rank() -> NoReturn:
            stub.close()
            run_as_rank(self.process, environment, folder, descriptors, self.program)

        self.missing -= 1
        process = self._fork(rank)
        for descriptor in descriptors:
            os.close(descriptor)
        self.stubs[process], self.ranks[stub] = stub, process
        self.selector.register(stub, selectors.EVENT_READ)

    def _handle_signals(self) -> None:
        """Handle the signals that have come."""
        if signal.SIGTERM in os.read(self.signal_reader, _BACKLOG):
            os.kill(self.mpirun, signal.SIGTERM)
            self._set_deadline()
        while self.status is None:
            process, status = os.waitpid(-1, os.WNOHANG)
            if not process:
                break
            code = os.waitstatus_to_exitcode(status)
            if process == self.mpirun:
                self.status = code if code >= 0 else _KILLED - code
            else:
                self._rank_ended(process, code)

    def _rank_ended(self, process: int, code: int) -> None:
        """Have the stub of a rank end in the same way."""
        stub = self.stubs.pop(process)
        if self.ranks.pop(stub, None):
            self.selector.unregister(stub)
            if code and self.missing:  # later, ranks may have agreed to go on without
                self._set_deadline()
            with contextlib.suppress(OSError):  # ended meanwhile
                stub.sendall(b"exit %d\n" % code if code >= 0 else b"kill %d $$; exit %d\n" % (code, _KILLED - code))
        stub.close()

    def _end(self) -> None:
        """End mpirun, if something went wrong here, and the ranks of an mpirun that was killed."""
        if self.status is None and self.mpirun:
            os.kill(self.mpirun, signal.SIGTERM)
        for process in self.stubs:
            os.kill(process, signal.SIGKILL)
        for process in self.stubs:
            os.waitpid(process, 0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
