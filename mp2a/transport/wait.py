"""Waiting for a message without taking the processor from the robot that has yet to send it.

With a core a rank, waiting in MPI is fastest. With more ranks than cores a rank first yields, since with all robots
busy the scheduler is the bottleneck (sleeping at once costs a factor of 3 with 8 ranks on two cores), and then sleeps,
since yielding for ever burns the cores while somebody is late. The naps stay short: the last one is overslept by half.
"""

import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from mp2a.cores import is_oversubscribed, restore_timer_slack

if TYPE_CHECKING:
    from mp2a.mpi import MPI

YIELDS = 20
"""How often a rank that shares its core yields before it sleeps."""
_FIRST_NAP, _LONGEST_NAP, _GROWTH = 10e-6, 1e-3, 1.5
_LOOKS = 64


def wait(request: "MPI.Request") -> None:
    """Wait for a request: in MPI itself with a core a rank, otherwise yielding and then asleep between looks."""
    if is_oversubscribed():
        wait_unless(request, lambda: False)
    else:
        request.Wait()


def wait_unless(request: "MPI.Request", hopeless: Callable[[], bool], longest_nap: float | None = None) -> bool:
    """Wait for a request, but give up when ``hopeless()``, asked now and then, says it will not come.

    Parameters
    ----------
    request
        What is waited for.
    hopeless
        Tells whether there is nothing to wait for any more.
    longest_nap
        Sleep between looks, up to this many seconds; None: only where ranks share cores, up to 1 ms.

    Returns
    -------
    bool
        Whether the request is complete.
    """
    polite = longest_nap is not None or is_oversubscribed()
    most = _LONGEST_NAP if longest_nap is None else max(longest_nap, _FIRST_NAP)
    nap, looks = _FIRST_NAP, 0
    while not request.Test():
        looks += 1
        if looks % (YIELDS if polite else _LOOKS) == 0 and hopeless():
            return False
        if not polite:
            continue
        if looks <= YIELDS:
            os.sched_yield()
        else:
            if nap == _FIRST_NAP:
                restore_timer_slack()  # or a rank that `mp2a.launch` started would oversleep by 10 ms
            time.sleep(nap)
            nap = min(_GROWTH * nap, most)
    return True
