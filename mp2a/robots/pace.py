"""Ticks of real time that do not drift."""

import time
from collections.abc import Callable

from mp2a.checks import positive


class Ticker:
    """Ticks at fixed times of a monotonic clock: what one tick is late, the next is not.

    Parameters
    ----------
    period
        s between ticks.
    start
        Reading of ``clock`` that counts as zero; None: now.
    clock, sleep
        Of the machine; others in tests.

    Notes
    -----
    The k-th tick is due at ``begin + k · period`` (begin: when this was built), never a period after the one before.
    Ticks that were missed are left out, not caught up with.
    """

    def __init__(
        self,
        period: float,
        start: float | None = None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._period = positive("period", period)
        self._clock, self._sleep = clock, sleep
        self._begin = clock()
        self.start = self._begin if start is None else start
        self._tick = 0

    def now(self) -> float:
        """Tell the time since the start, s; negative before."""
        return self._clock() - self.start

    def due(self) -> float:
        """Tell the reading of the clock at which the next tick is due; those that are over are left out."""
        passed = int((self._clock() - self._begin) / self._period)
        self._tick = max(self._tick + 1, passed)
        return self._begin + self._tick * self._period

    def wait(self, done: bool = False) -> bool:
        """Sleep until the next tick; returns ``done``."""
        left = self.due() - self._clock()
        if left > 0:
            self._sleep(left)
        return done
