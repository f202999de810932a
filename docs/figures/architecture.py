"""Draw docs/figures/architecture.png: the layers of docs/architecture.md, and the way of a number through a call."""

import re
from pathlib import Path

import matplotlib.pyplot as plt

HERE = Path(__file__).parent
STEPS = (
    ("q, v, a of this rank", None),
    ("distributed: DistributedModel.rnea", "distributed"),
    ("program.calls: errors of one rank are raised on all", "program"),
    ("program.rank: what methods.block recorded", "program"),
    ("validation: arrays unlike those of the last call", "validation"),
    ("kernels.replay: finite? own joint, placed", "kernels"),
    ("kernels.replay and MPI: the rounds", "kernels"),
    ("kernels.replay: motion, force, torque", "kernels"),
    ("torque, or InverseDynamics", None),
)


def layers() -> list[tuple[list[str], str]]:
    """Read names and meaning of each layer, from the top."""
    text = re.search(r"```layers\n(.*?)```", (HERE.parent / "architecture.md").read_text(), flags=re.DOTALL)
    assert text is not None
    rows = [re.split(r"\s{2,}", line, maxsplit=1) for line in text[1].splitlines()]
    return [(row[0].split(), row[1] if len(row) > 1 else "") for row in rows]


def main() -> None:
    """Draw it."""
    rows = layers()
    figure, (left, right) = plt.subplots(1, 2, figsize=(13, 7.2), width_ratios=(1.45, 1), layout="constrained")
    colours = plt.get_cmap("viridis")
    shade = {}
    for k, (names, meaning) in enumerate(rows):
        colour = colours(0.25 + 0.7 * k / len(rows))
        shade.update(dict.fromkeys(names, colour))
        y = len(rows) - k
        left.barh(y, 1, height=0.86, color=colour, alpha=0.55)
        left.text(0.012, y, "  ".join(names), va="center", family="monospace", fontsize=9, weight="bold")
        left.text(0.39, y, meaning, va="center", fontsize=8.5)
    left.set_title("Imports run one way: each line knows those below it", loc="left", fontsize=11)
    left.set_xlim(0, 1)
    for k, (text, layer) in enumerate(STEPS):
        y = len(STEPS) - k
        box = {"boxstyle": "round,pad=0.55", "facecolor": shade.get(layer, "white"), "alpha": 0.6}
        right.text(0.5, y, text, ha="center", va="center", fontsize=9.5, bbox=box)
        if k:
            arrow = {"arrowstyle": "-|>", "color": "black"}
            right.annotate("", (0.5, y + 0.3), (0.5, y + 0.7), arrowprops=arrow)
    exchange = len(STEPS) - 6
    for y, label in ((exchange + 0.12, "to other ranks"), (exchange - 0.12, "")):
        ends = ((1.0, y), (0.93, y)) if label else ((0.93, y), (1.0, y))
        right.annotate("", *ends, arrowprops={"arrowstyle": "-|>", "color": "black"})
    right.text(1.0, exchange + 0.32, "other ranks", ha="right", fontsize=8.5)
    right.set_title("The way of a number through a call on one rank", loc="left", fontsize=11)
    right.set_xlim(0, 1)
    right.set_ylim(0.4, len(STEPS) + 0.6)
    for axes in (left, right):
        axes.axis("off")
    figure.savefig(HERE / "architecture.png", dpi=110)


if __name__ == "__main__":
    main()
