"""Pieces of work for several threads; compiled kernels run without Python's lock."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

Result = TypeVar("Result")


def share(work: Callable[[Iterator[int]], Result], pieces: int, threads: int) -> list[Result]:
    """Have threads, this one among them, work until no piece is left.

    Parameters
    ----------
    work
        Gets the numbers of the pieces to do, one by one.
    pieces, threads
        How many there are.

    Returns
    -------
    list
        What the work of each thread returned.
    """
    if threads == 1:
        return [work(iter(range(pieces)))]
    left = iter(range(pieces))
    others = [_pool(threads - 1).submit(work, left) for _ in range(threads - 1)]
    return [work(left), *(other.result() for other in others)]


@cache
def _pool(workers: int) -> ThreadPoolExecutor:
    from concurrent.futures import ThreadPoolExecutor

    return ThreadPoolExecutor(workers, thread_name_prefix="mp2a")
