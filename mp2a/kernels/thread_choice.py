"""Whether a job is shared among threads: it is where that has been clearly quicker of late."""

from collections import deque

from mp2a.kernels.model_cache import ModelCache

_CLEARLY = 0.85
"""Sharing is quicker where it takes less than this part of the time."""

_MEMORY = 5
"""Times of each way that are remembered; their median counts."""

_ENOUGH = 3
"""Times of each way with which to begin to choose, for one of them may be that of a job that was held up."""

_TRIALS = 0.01
"""Part of all the time that may go into trying again what was slower."""


class ThreadChoice:
    """Chooses for jobs of one kind between working alone and sharing.

    What other threads gain cannot be told from the job: where other programs run, a thread may have to wait for a core,
    or take that of the caller. So both ways are timed.
    """

    def __init__(self) -> None:
        self._seconds: dict[bool, deque[float]] = {way: deque(maxlen=_MEMORY) for way in (False, True)}
        self._is_quicker = False
        self._saved_up = 0.0

    def is_shared(self) -> bool:
        """Tell whether the next job is to be shared."""
        tried_alone, tried_shared = (len(self._seconds[way]) for way in (False, True))
        if tried_shared < _ENOUGH:
            return tried_shared < tried_alone
        other = not self._is_quicker
        return other if self._saved_up >= _median(self._seconds[other]) else self._is_quicker

    def note(self, shared: bool, seconds: float) -> None:
        """Take notice of how long a job has taken that was shared, or not."""
        self._saved_up = self._saved_up + _TRIALS * seconds if shared is self._is_quicker else 0.0
        self._seconds[shared].append(seconds)
        self._is_quicker = _median(self._seconds[True]) < _CLEARLY * _median(self._seconds[False])


def _median(seconds: deque[float]) -> float:
    """Median, so that it does not count where once in a while the system takes the core away; 0 of nothing."""
    return sorted(seconds)[len(seconds) // 2] if seconds else 0.0


CHOICES: ModelCache[ThreadChoice] = ModelCache(lambda *_: ThreadChoice())
"""By model, kernel and size of the job."""
