"""Ticks of time: real ones that do not drift, and virtual ones."""

import time
from collections.abc import Callable, Sequence
from typing import Any

from mp2a.checks import positive


class RealTimeClock:
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
        """Return the time since the start, s; negative before."""
        return self._clock() - self.start

    def wait(self, done: bool = False) -> bool:
        """Sleep until the next tick that is not over yet; returns ``done``."""
        passed = int((self._clock() - self._begin) / self._period)
        self._tick = max(self._tick + 1, passed)
        left = self._begin + self._tick * self._period - self._clock()
        if left > 0:
            self._sleep(left)
        return done


class VirtualClock:
    """Time that passes as fast as the loop runs, and takes the robots along.

    Parameters
    ----------
    period
        s a tick.
    robots
        What moves: each has ``advance(t)``, which takes it to ``t`` s, and ``over``, after which nothing more comes.
    """

    def __init__(self, period: float, robots: Sequence[Any]) -> None:
        self._period, self._robots, self._tick = period, robots, 0

    def now(self) -> float:
        """Return the time since the start, s."""
        return self._tick * self._period

    def wait(self, done: bool = False) -> bool:
        """Let a tick pass; returns ``done``, or whether there is no more to come."""
        self._tick += 1
        for robot in self._robots:
            robot.advance(self.now())
        return done or all(robot.over for robot in self._robots)
