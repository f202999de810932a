"""How contenders look: one label, colour and marker for each, the same in every picture."""

from typing import NamedTuple

from mp2a.bench.contenders import (
    GATHER_SCATTER,
    GATHER_SCATTER_TREE,
    LABELS,
    MPI_SCAN,
    MPI_SCAN_DOUBLING,
    ONE_PROCESS,
    PINOCCHIO,
    PIPELINE,
    PIPELINE_BLOCKS,
)


class Look(NamedTuple):
    """The label, colour and marker of a curve; the colours keep apart for colour-blind readers (Okabe and Ito)."""

    label: str
    color: str
    marker: str


INK = "#222222"
FAINT = "#8a8a8a"
_COLORS_AND_MARKERS = {
    "kogge-stone": ("#0072B2", "o"),
    "compact": ("#56B4E9", "p"),
    "sweep": ("#000000", ">"),
    MPI_SCAN: ("#DDCC77", "v"),
    MPI_SCAN_DOUBLING: ("#A67C00", "v"),
    PIPELINE: ("#D55E00", "s"),
    PIPELINE_BLOCKS: ("#E69F00", "s"),
    GATHER_SCATTER: ("#009E73", "D"),
    GATHER_SCATTER_TREE: ("#88CC66", "d"),
    ONE_PROCESS: ("#332288", "*"),
    PINOCCHIO: ("#AA4499", "^"),
}
LOOKS = {name: Look(LABELS[name], *look) for name, look in _COLORS_AND_MARKERS.items()} | {
    "kogge-stone, table I": Look("kogge-stone, counts of Table I", "#CC6677", "o"),
    "serial": Look("serial O(n)", "#555555", "v"),
}
"""The contenders, and what is only modelled, in the order of legends."""
_SPARE = ("#44AA99", "#999933", "#882255", "#6699CC")


def look(contender: str) -> Look:
    """Return how a contender is drawn; one that `LOOKS` does not hold gets a hexagon in a colour that its name gives.

    Parameters
    ----------
    contender
        Its name in the results.
    """
    return LOOKS.get(contender) or Look(contender, _SPARE[sum(contender.encode()) % len(_SPARE)], "h")


def in_order(contenders: set[str]) -> list[str]:
    """Return names of contenders in the order of `LOOKS`, those it does not hold behind them."""
    return [name for name in LOOKS if name in contenders] + sorted(contenders - LOOKS.keys())
