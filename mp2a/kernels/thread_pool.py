"""Threads that share the pieces of a job; compiled kernels run without Python's lock."""

from __future__ import annotations

import os
import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mp2a import kernels

if TYPE_CHECKING:
    from mp2a.kernels.library import Kernel
    from mp2a.spatial import Array

OPEN, ACTIVE, NEXT, PIECES, CHUNKS, THREADS, LOOKS, KERNEL, VERDICT, JOBS, SCRATCH, YIELD = range(12)
"""Numbers that the threads share: whether there is a job to take pieces of; how many threads look at it just now; the
next piece, and how many there are; chunks of the one job, or 0 if every piece is a job of one chunk; threads that
take part; how often to look out for the next job; the addresses of the kernel's code and of the pointer to its verdict;
of tables of addresses of pointers, to each piece's job and its scratch memory, or to the one job and each thread's
scratch memory; and of the system's function that lets another thread run."""

FIELDS = 12

_LOOKS, _FEW_LOOKS = 20_000, 1_000
"""How often a worker looks for another job before it sleeps: after short jobs for some tenths of a
millisecond; after jobs of milliseconds hardly, for who looks slows the caller down."""


class ThreadPool:
    """Threads for jobs that may be short, to which handing over from Python would add half (`mp2a.kernels.worker`).

    They are started when first needed, look out for jobs for a while after each, and then sleep. The pool serves one
    caller at a time; another one that comes meanwhile works alone.
    """

    def __init__(self) -> None:
        self._fields: NDArray[np.int64] = np.zeros(FIELDS, dtype=np.int64)
        self._fields[YIELD] = kernels.yield_address()
        self._busy, self._counting = threading.Lock(), threading.Lock()
        self._wake = threading.Semaphore(0)
        self._workers = self._sleeping = 0

    def run(self, kernel: Kernel, job: NDArray[np.int64], chunks: int, pieces: int, scratch: Array) -> bool:
        """Run a kernel on all chunks of a job; tells whether every sample is valid.

        Parameters
        ----------
        kernel
            As `mp2a.kernels.rnea` describes it.
        job
            What it is to do.
        chunks, pieces
            How many chunks there are, and in how many pieces the threads take them.
        scratch
            Memory for each thread, a row each.
        """
        at, verdict, threads = kernels.pointer, np.zeros(1, dtype=np.int64), len(scratch)
        if threads == 1 or not self._share(kernel, (pieces, chunks, threads), _LOOKS, [job], verdict, list(scratch)):
            kernel(at(job), 0, chunks, at(scratch), at(verdict))
        return not verdict[0]

    def run_each(self, kernel: Kernel, jobs: Sequence[NDArray[np.int64]], scratch: Array, threads: int) -> bool:
        """Run a kernel on the one chunk of each job, with a row of scratch memory each; as `run`."""
        at, verdict, rows = kernels.pointer, np.zeros(1, dtype=np.int64), list(scratch)
        looks = _LOOKS if len(jobs) <= threads else _FEW_LOOKS  # several jobs a thread last for milliseconds
        if not self._share(kernel, (len(jobs), 0, threads), looks, jobs, verdict, rows):
            for job, row in zip(jobs, rows, strict=True):
                kernel(at(job), 0, 1, at(row), at(verdict))
        return not verdict[0]

    def _share(
        self, kernel: Kernel, sizes: tuple[int, int, int], looks: int, jobs: Sequence[NDArray[np.int64]],
        verdict: NDArray[np.int64], rows: Sequence[Array],
    ) -> bool:  # fmt: skip
        """Do it with workers; tells whether they were wanted and to be had. ``sizes``: pieces, chunks and threads."""
        if sizes[-1] == 1 or not self._busy.acquire(blocking=False):
            return False
        try:
            at = kernels.pointer
            tables: list[NDArray[np.int64]] = [np.array([at(x) for x in each], dtype=np.int64) for each in (jobs, rows)]
            places = (table.ctypes.data for table in tables)
            self._fields[PIECES:YIELD] = *sizes, looks, kernels.address(kernel), at(verdict), *places
            self._rouse(sizes[-1] - 1)
            run = kernels.compiled("pool_run")
            assert run is not None
            run(self._fields.ctypes.data)
        finally:
            self._busy.release()
        return True

    def _rouse(self, wanted: int) -> None:
        """Have so many workers, and all of them awake."""
        while self._workers < wanted:
            self._workers += 1
            threading.Thread(target=self._work, args=(self._workers,), name="mp2a", daemon=True).start()
        with self._counting:
            sleeping, self._sleeping = self._sleeping, 0
        if sleeping:
            self._wake.release(sleeping)

    def _work(self, thread: int) -> None:
        work, fields = kernels.compiled("pool_worker"), self._fields.ctypes.data
        assert work is not None
        while True:
            work(fields, thread)
            with self._counting:
                self._sleeping += 1
            self._wake.acquire()


THREAD_POOL = ThreadPool()


def _start_anew() -> None:
    """Forget the threads of the parent process, of which a forked one has none."""
    THREAD_POOL.__init__()  # type: ignore[misc]


os.register_at_fork(after_in_child=_start_anew)
