"""Waiting for a message without taking the processor from the robot that has yet to send it."""

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from mp2a.cores import is_oversubscribed

if TYPE_CHECKING:
    from mpi4py import MPI

_FIRST_NAP, _LONGEST_NAP = 50e-6, 2e-3
_LOOKS = 64
_POLITE = is_oversubscribed()


def wait(request: "MPI.Request") -> None:
    """Wait for a request: with a core a rank in MPI itself, which is fastest; otherwise asleep between looks."""
    if _POLITE:
        wait_unless(request, None, lambda: False)
    else:
        request.Wait()


def wait_unless(request: "MPI.Request", status: "MPI.Status | None", hopeless: Callable[[], bool]) -> bool:
    """Wait for a request, but give up when ``hopeless()``, asked now and then, says it will not come.

    Returns
    -------
    bool
        Whether the request is complete.
    """
    nap, looks = _FIRST_NAP, 0
    while not request.Test(status):
        looks += 1
        if (_POLITE or looks % _LOOKS == 0) and hopeless():
            return False
        if _POLITE:
            time.sleep(nap)
            nap = min(2 * nap, _LONGEST_NAP)
    return True
