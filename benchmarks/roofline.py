"""What one core could reach at most, and what the batched recursion reaches of it.

    python benchmarks/roofline.py --format markdown

Counts the vector instructions of a revolute body in what the compiler makes of the formulas, and the bytes that go to
and from memory; measures what this processor can do of either; and times the recursion beside that. Writes
results/roofline.json and draws results/roofline.png.
"""

import statistics
from typing import Any

import counts
import numpy as np
import peaks
from batch import ours
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from measure import finish, need_kernels, script_parser, spread, take_turns
from rich.console import Console

from mp2a import Model
from mp2a.bench.machine import describe_machine
from mp2a.cli.options import ranks as numbers
from mp2a.kernels.symbols import LANES
from mp2a.kernels.tables import NUMBER_FORMATS, make_tables
from mp2a.plot.looks import FAINT, INK, Look
from mp2a.plot.style import canvas, curve, handle, legends, robots_axis, save_figure, styled
from mp2a.tables import Column, Table, show_plain

CASES = {
    "rows": Look("torque, (T, n)", "#0072B2", "o"),
    "columns": Look("torque, (n, T)", "#D55E00", "s"),
    "rows bodies": Look("with bodies, (T, n)", "#56B4E9", "p"),
    "columns bodies": Look("with bodies, (n, T)", "#E69F00", "D"),
}
IN_AND_OUT, REPORTED = 32, 144
"""Bytes a body and sample: q, v, a and the torque; and motion and force where they are asked for."""

_LARGEST_STREAM = 4_000_000
"""Doubles of an array beyond which memory gets no slower."""


def main() -> None:
    """Measure, save, draw and print."""
    parser = script_parser(__doc__, "roofline.json")
    parser.add_argument("--n", type=numbers, default=[8, 32, 128, 512], help="numbers of bodies")
    parser.add_argument("--samples", type=int, default=2000, help="T (default: 2000)")
    options = parser.parse_args()
    need_kernels()
    with Console(stderr=True).status("arithmetic") as spinner:
        results: dict[str, Any] = {"machine": describe_machine(), "samples": options.samples}
        results["peaks"] = peaks.measure()._asdict()
        results["chains"] = counts.chains()
        results["counts"] = {case: {part: count._asdict() for part, count in counted(case).items()} for case in CASES}
        results["runs"] = []
        for n in options.n:
            spinner.update(f"n = {n}")
            results["runs"].append(run(n, options.samples, options.repeats))
    finish(results, tables(results), [], options)
    print(save_figure(figure(results), options.out.with_suffix(".png")))


def counted(case: str) -> dict[str, counts.Count]:
    """Count the instructions of a case, by part of the work."""
    return counts.body(rows=case.startswith("rows"), bodies=case.endswith("bodies"))


def run(n: int, samples: int, repeats: int) -> dict[str, Any]:
    """Time all cases of one length, and memory as large as theirs."""
    model = Model.random(n)
    state = model.random_state(samples)
    size = min(n * samples, _LARGEST_STREAM)
    scratch = make_tables(model, NUMBER_FORMATS[np.dtype(np.float64)], False).scratch
    return {
        "n": n,
        "seconds": take_turns({case: ours(model, state, *_parts(case)) for case in CASES}, repeats),
        "stream": peaks.streams(size, outputs=1),
        "new": peaks.new_memory(min(18 * n * samples, _LARGEST_STREAM)),
        "scratch bytes": 8 * scratch,
        "scratch": peaks.streams(max(scratch // 2, LANES), outputs=1, inputs=1),
    }


def _parts(case: str) -> tuple[str, str]:
    layout, _, detail = case.partition(" ")
    return layout, detail


# ---- bounds ------------------------------------------------------------------------------------------------------


def bounds(results: dict[str, Any], run: dict[str, Any], case: str) -> dict[str, float]:
    """Work out the least time for each thing that limits, ns a body and sample.

    "arithmetic" is that of the way out and of the way back, one after the other; each takes at least what the units
    for products need, and at least as long as its longest chain of operations that wait for each other.
    """
    peak = peaks.Peaks(**results["peaks"])
    parts = {part: counts.Count(**count) for part, count in results["counts"][case].items()}
    back = sum((count for part, count in parts.items() if part in counts.WAY_BACK), counts.Count())
    out = sum((count for part, count in parts.items() if part not in counts.WAY_BACK), counts.Count())
    links = results["chains"]
    phases = [max(units(count, peak), links[k] * peak.wait) for k, count in enumerate((out, back))]
    transfer = IN_AND_OUT / run["stream"]
    if case.endswith("bodies"):
        transfer += REPORTED / run["new"]
    return {
        "units": 1e9 / LANES * units(out + back, peak),
        "arithmetic": 1e9 / LANES * sum(phases),
        "memory": 1e9 * transfer,
    }


def units(count: counts.Count, peak: peaks.Peaks) -> float:
    """Seconds that the processor's units need for arithmetic, for `LANES` samples."""
    products = count.fused + count.products
    return max(products / peak.products, (products + count.sums) / max(peak.both, peak.products))


def measured(run: dict[str, Any], case: str) -> float:
    """Median, ns a body and sample."""
    return 1e9 * statistics.median(run["seconds"][case]) / run["n"]


# ---- tables and figure -------------------------------------------------------------------------------------------


def tables(results: dict[str, Any]) -> list[Table]:
    """Make the tables: instructions, the machine, how near."""
    columns = [Column("part", left=True)]
    columns += [Column(kind, "{:g}".format) for kind in ("fused", "products", "sums", "others")]
    parts = {**results["counts"]["rows bodies"]}
    for part in [name for name in parts if name in results["counts"]["rows"]]:
        parts[part] = results["counts"]["rows"][part]
    rows: list[list[Any]] = [[part, *count.values()] for part, count in parts.items()]
    for case in ("rows", "rows bodies"):
        total = sum((counts.Count(**count) for count in results["counts"][case].values()), counts.Count())
        rows.append([f"all, {CASES[case].label}", *total])
    out = [Table(f"instructions a body on {LANES} samples", columns, rows)]
    peak = results["peaks"]
    rows = [
        ["multiply-add, 10⁹ vectors/s", peak["products"] / 1e9],
        ["sums, 10⁹ vectors/s", peak["sums"] / 1e9],
        ["both, 10⁹ vectors/s", peak["both"] / 1e9],
        ["multiply-add, Gflop/s", 2 * LANES * peak["products"] / 1e9],
        ["multiply-add, ns until the next", 1e9 * peak["wait"]],
    ]
    for run in results["runs"]:
        where = f"n = {run['n']}"
        rows.append([f"{where}: three streams in, one out, GB/s", run["stream"] / 1e9])
        rows.append([f"{where}: new memory, GB/s", run["new"] / 1e9])
        kilobytes = f"{run['scratch bytes'] / 1e3:.0f} kB"
        rows.append([f"{where}: scratch of a thread, {kilobytes}, GB/s", run["scratch"] / 1e9])
    out.append(Table("one core, measured", [Column("what", left=True), Column("at most", "{:.3g}".format)], rows))
    columns = [Column("case", left=True), Column("n"), Column("measured", show_plain)]
    columns += [Column(name, "{:.2f}".format) for name in ("units alone", "arithmetic", "memory")]
    columns += [Column(name, "{:.0%}".format) for name in ("units in use", "of the bound")]
    columns.append(Column("limit", left=True))
    rows = []
    for case, look in CASES.items():
        for run in results["runs"]:
            bound, time = bounds(results, run, case), measured(run, case)
            limit = max(("arithmetic", "memory"), key=bound.__getitem__)
            least = [bound[name] for name in ("units", "arithmetic", "memory")]
            shares = [bound[name] / time for name in ("units", limit)]
            rows.append([look.label, run["n"], spread(run["seconds"], case, 1e9 / run["n"]), *least, *shares, limit])
    title = "ns a body and sample, one thread: measured, and the least for each limit"
    out.append(Table(title, columns, rows, keys=2))
    return out


@styled()
def figure(results: dict[str, Any]) -> Figure:
    """Draw the roofline, and time beside its bounds."""
    drawn = canvas(7.6, 3.5)
    left, right = drawn.subplots(1, 2)
    _roofline(left, results)
    _times(right, results)
    limits = [
        handle(Look("multiply-add units", INK, "")),
        handle(Look("the formulas' own mix", FAINT, ""), "--"),
        handle(Look("memory, largest n", FAINT, ""), (0, (1, 1.5))),
    ]
    bounds_shown = [
        handle(Look("arithmetic: with bodies, and torque alone", INK, ""), "--"),
        handle(Look("memory, torque alone", FAINT, ""), (0, (1, 1.5))),
    ]
    looks = [handle(look) for look in CASES.values()]
    legends(drawn, [("measured", looks), ("left: at most", limits), ("right: at least", bounds_shown)])
    return drawn


def _roofline(axes: Axes, results: dict[str, Any]) -> None:
    peak = 2 * LANES * results["peaks"]["products"]
    x = np.geomspace(0.5, 50, 100)
    axes.plot(x, np.full_like(x, peak), color=INK, linewidth=1.2)
    runs = results["runs"]
    axes.plot(x, np.minimum(x * runs[-1]["stream"], peak), color=FAINT, linestyle=(0, (1, 1.5)), linewidth=1.2)
    for case, look in CASES.items():
        work = sum(counts.Count(**count).operations for count in results["counts"][case].values())
        moved = IN_AND_OUT + (REPORTED if case.endswith("bodies") else 0)
        mix = 1e9 * work / bounds(results, runs[0], case)["units"]
        place = work / moved
        axes.plot([place / 1.5, place * 1.5], [mix, mix], color=FAINT, linestyle="--", linewidth=1.2)
        # The layouts lie beside each other, though their intensity is the same.
        beside = place * (0.93 if case.startswith("rows") else 1.07)
        speeds = [1e9 * work / measured(run, case) for run in runs]
        axes.plot([beside] * len(speeds), speeds, color=look.color, marker=look.marker, linestyle="none", markersize=5)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(1, 30)
    axes.set_ylim(peak / 50, peak * 1.5)
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_major_locator(_ticks([1, 2, 5, 10, 20]))
    axes.xaxis.set_major_formatter(plain)
    axes.yaxis.set_major_locator(_ticks([g for g in 1e9 * np.array([1, 2, 5, 10, 20, 50, 100, 200]) if g > peak / 50]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / 1e9:g}"))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_formatter(NullFormatter())
    axes.tick_params(which="minor", left=False, bottom=False)
    axes.set_xlabel("operations a byte of memory")
    axes.set_ylabel("Gflop/s")
    axes.set_title("roofline of one core; a mark for each n")
    axes.grid(True, which="major")


def _ticks(places: Any) -> Any:
    from matplotlib.ticker import FixedLocator

    return FixedLocator(list(places))


def _times(axes: Axes, results: dict[str, Any]) -> None:
    runs = results["runs"]
    n = np.array([run["n"] for run in runs])
    for case, look in CASES.items():
        curve(axes, n, np.array([measured(run, case) for run in runs]), look, gid=case)
    for case in ("columns", "columns bodies"):
        axes.plot(n, [bounds(results, run, case)["arithmetic"] for run in runs], color=INK, linestyle="--", linewidth=1)
    axes.plot(n, [bounds(results, run, "columns")["memory"] for run in runs], color=FAINT, linestyle=(0, (1, 1.5)))
    robots_axis(axes, n.tolist())
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(_ticks([0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(which="minor", left=False)
    axes.set_xlabel("number of bodies n")
    axes.set_title("ns a body and sample, one thread")


if __name__ == "__main__":
    main()
