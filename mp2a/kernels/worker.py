"""Threads that share the pieces of a job without the interpreter.

Who has just worked looks out for the next job for a while, since waking a thread takes longer than many a job.
`mp2a.kernels.thread_pool` keeps the threads. Only building the kernels imports this module.
"""

from typing import Any

from mp2a.kernels.primitives import add_atomic, call, call_int, compiled, integers_at, load_atomic, pause, store_atomic

# Compiled functions take plain global numbers, not attributes.
from mp2a.kernels.thread_pool import (
    ACTIVE,
    CHUNKS,
    JOBS,
    KERNEL,
    LOOKS,
    NEXT,
    OPEN,
    PIECES,
    SCRATCH,
    THREADS,
    VERDICT,
    YIELD,
)

_LOOKS_A_TURN = 64
"""Looks after which a thread that waits lets others run, one of which may be that which it waits for."""


@compiled
def _wait(pool: Any, look: Any) -> None:
    """Let some time pass between two looks."""
    if look % _LOOKS_A_TURN == 0:
        call_int(pool[YIELD], 0, ())
    pause()


@compiled
def _work(pool: Any, thread: Any) -> None:
    """Do pieces until none is left."""
    kernel, verdict, chunks, pieces = pool[KERNEL], pool[VERDICT], pool[CHUNKS], pool[PIECES]
    jobs, scratch = integers_at(pool[JOBS]), integers_at(pool[SCRATCH])
    piece = add_atomic(pool, NEXT, 1)
    while piece < pieces:
        if chunks:
            first, last = piece * chunks // pieces, (piece + 1) * chunks // pieces
            call(kernel, (jobs[0], first, last, scratch[thread], verdict))
        else:
            call(kernel, (jobs[piece], 0, 1, scratch[piece], verdict))
        piece = add_atomic(pool, NEXT, 1)


def worker(pool_at: Any, thread: Any) -> None:
    """Look out for jobs and help with them; returns when there has been none for some looks in a row."""
    pool = integers_at(pool_at)
    look = 0
    while look < load_atomic(pool, LOOKS):
        look += 1
        if load_atomic(pool, OPEN):
            # First say so, then look again: a job is only changed when it is closed and nobody is active.
            add_atomic(pool, ACTIVE, 1)
            if load_atomic(pool, OPEN) and thread < pool[THREADS] and load_atomic(pool, NEXT) < pool[PIECES]:
                _work(pool, thread)
                look = 0
            add_atomic(pool, ACTIVE, -1)
        _wait(pool, look)


def run(pool_at: Any) -> None:
    """Open the job that the pool describes, work on it, and return when it is done."""
    pool = integers_at(pool_at)
    store_atomic(pool, NEXT, 0)
    store_atomic(pool, OPEN, 1)
    _work(pool, 0)
    store_atomic(pool, OPEN, 0)
    look = 0
    while load_atomic(pool, ACTIVE):
        look += 1
        _wait(pool, look)
