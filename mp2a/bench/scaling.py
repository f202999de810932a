"""Strong and weak scaling: what more ranks bring to one long chain, or to a chain that grows with them."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from mp2a.bench.contenders import BASELINES, ONE_PROCESS
from mp2a.tables import Column, Spread, Table, show_ratio, show_seconds

Run = Mapping[str, Any]


class Scaling(NamedTuple):
    """Runs of chains in blocks that belong together, by rising number of ranks."""

    bodies: int
    """Of the whole chain if it is the same for all runs, else of each rank."""
    weak: bool
    """Whether the chain grows with the ranks."""
    runs: list[Run]

    @property
    def title(self) -> str:
        """What scales how, in a few words."""
        return f"weak scaling, {self.bodies} bodies a rank" if self.weak else f"strong scaling, {self.bodies} bodies"

    def times(self, name: str) -> dict[int, float]:
        """Return the seconds of one sample by number of ranks; empty for who was not measured."""
        return {run["n"]: run["measured"][name]["single"]["wall"] for run in self.runs if name in run["measured"]}

    def efficiency(self, name: str) -> dict[int, float]:
        """Return by number of ranks the part of them that is worth something, measured by the smallest number.

        For strong scaling n₀ T(n₀) / (n T(n)), for weak scaling T(n₀) / T(n).
        """
        times = self.times(name)
        first = min(times, default=1)
        return {n: times[first] / seconds * (1 if self.weak else first / n) for n, seconds in times.items()}

    @property
    def methods(self) -> list[str]:
        """Our methods among those who were measured."""
        return list(dict.fromkeys(name for run in self.runs for name in run["measured"] if name not in BASELINES))


def scalings(runs: Iterable[Run]) -> list[Scaling]:
    """Sort runs of chains in blocks by what they are about, strong scaling first, of several alike the last."""
    found: dict[tuple[bool, int, Any, Any], dict[int, Run]] = {}
    for run in runs:
        weak, bodies = bool(run.get("bodies_per_rank")), run.get("bodies") or run.get("bodies_per_rank")
        if bodies:
            found.setdefault((weak, bodies, run["samples"], str(run["emulated"])), {})[run["n"]] = run
    return [Scaling(key[1], key[0], [alike[n] for n in sorted(alike)]) for key, alike in sorted(found.items())]


def scaling_table(scaling: Scaling) -> Table:
    """Make a table of times and efficiencies, and of how many times as fast as one process the ranks are."""
    alone = scaling.times(ONE_PROCESS)
    columns = [
        Column("method", left=True), Column("ranks"), Column("one sample", _median, "s"),
        Column("efficiency", lambda part: f"{part:.0%}"), Column(f"times as fast as {ONE_PROCESS}", show_ratio),
    ]  # fmt: skip
    rows = []
    for name in scaling.methods:
        times, efficiency = scaling.times(name), scaling.efficiency(name)
        for run in scaling.runs:
            n, walls = run["n"], run["measured"][name]["single"]["walls"]
            ratio = alone[n] / times[n] if n in alone else None
            rows.append([name, n, Spread.of(walls), efficiency[n], ratio])
    return Table(f"{scaling.title}: measured", columns, rows, keys=2)


def _median(spread: Spread) -> str:
    return show_seconds(spread.median)
