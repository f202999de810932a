"""What a run of the benchmark is made with; known to the launcher and to the ranks."""

from typing import Any, NamedTuple

from mp2a.bench.contenders import FAMILIES
from mp2a.network import EmulatedNetwork

STARTED = "MP2A_STARTED"
"""Environment variable in which the launcher says when it began, as a Unix time."""

PROGRESS = "mp2a: doing: "
"""How a line begins in which rank 0 says to the launcher what it does."""

ERROR = "mp2a: error: "
"""How a line begins that says what went wrong."""


class BenchSettings(NamedTuple):
    """Options of ``mp2a bench``, by their names."""

    samples: int = 2000
    repeats: int = 5
    seed: int = 0
    methods: tuple[str, ...] = ("kogge-stone", "compact", "sweep")
    """Distributed methods to measure, of `mp2a.methods.METHODS`."""
    baselines: tuple[str, ...] = FAMILIES
    """What to measure beside them, of `mp2a.bench.contenders.FAMILIES`."""
    bodies: int | None = None
    """Bodies of the whole chain, of which the ranks hold blocks."""
    bodies_per_rank: int | None = None
    """Bodies of each rank. Without either of the two a rank holds one."""
    network: EmulatedNetwork | None = None
    """Network to emulate between the ranks."""
    seconds: float = 10.0
    """Time for the repeats of all contenders; where one call each takes longer, there are fewer repeats."""
    serial_time: float | None = None
    """T_s of eq. 13, s; None: as measured."""
    latency: float | None = None
    """L_a, s; None: as measured."""
    speed: float | None = None
    """N_TS, bit/s; None: as measured."""
    bits: float = 64.0
    """Bits a number."""

    def chain_length(self, ranks: int) -> int:
        """Return how many bodies the chain has on so many ranks."""
        return self.bodies or (self.bodies_per_rank or 1) * ranks

    def identity(self) -> dict[str, Any]:
        """Tell what makes two runs of the same n the same run, as it is in the results file."""
        return {
            "samples": self.samples,
            "seed": self.seed,
            "requested": [*self.methods, *self.baselines],
            "bodies": self.bodies,
            "bodies_per_rank": self.bodies_per_rank,
            "emulated": None if self.network is None else list(self.network),
        }
