"""The benchmark's tables: what was measured, modelled and extrapolated, each named so."""

from typing import Any

from rich import box
from rich.table import Table

from mp2a.exceptions import InputError

SIZES = {"batch": "samples in each message", "single": "one sample at a time"}
_OPPONENTS = ("relay", "relay, pipelined", "centre", "centre, tree", "pinocchio")


def messages(runs: list[dict[str, Any]]) -> Table:
    """Build the table of what is sent and how exact the results are, a row a run and method."""
    out = Table(title="messages for one sample, all robots together", box=box.SIMPLE, title_justify="left")
    for heading in ("n", "method", "rounds", "messages\nsent", "bytes\nsent", "messages\nby formula", "error"):
        out.add_column(heading, justify="left" if heading == "method" else "right")
    for run in _latest(runs):
        for name, facts in run["methods"].items():
            out.add_row(
                str(run["n"]),
                name,
                str(facts["rounds"]),
                str(facts["sent"]["messages"]),
                f"{facts['sent']['bytes']:,}".replace(",", " "),
                str(facts["messages"]),
                f"{facts['error']['relative']:.0e}",
            )
    return out


def times(runs: list[dict[str, Any]], size: str) -> Table:
    """Build the table of times a sample, a row a run.

    Parameters
    ----------
    runs
        Of a results file.
    size
        "batch" or "single".
    """
    latest = _latest(runs)
    methods = list(dict.fromkeys(name for run in latest for name in run["methods"]))
    prefix = f"{latest[-1]['samples']} " if size == "batch" else ""
    emulated = latest[-1]["emulated"]
    where = f", emulated network of {1e3 * emulated[0]:g} ms and {emulated[1] / 1e6:g} Mbit/s" if emulated else ""
    title = f"time a sample, {prefix}{SIZES[size]}{where}"
    out = Table(title=title, box=box.SIMPLE, title_justify="left")
    out.add_column("n", justify="right")
    for name in (*methods, *_OPPONENTS):
        out.add_column(f"{name.replace(', ', chr(10))}\nmeasured", justify="right")
    for run in latest:
        walls = [run["measured"].get(name, {}).get(size, {}).get("wall") for name in (*methods, *_OPPONENTS)]
        out.add_row(_count(run), *(_time(wall) for wall in walls))
    return out


def beyond(runs: list[dict[str, Any]], size: str) -> Table:
    """Build the table of what was not measured: times a sample, extrapolated and modelled, a row a run."""
    latest = _latest(runs)
    names = list(dict.fromkeys(name for run in latest for name in run["extrapolated"]))
    out = Table(title=f"not measured: time a sample, {SIZES[size]}", box=box.SIMPLE, title_justify="left")
    out.add_column("n", justify="right")
    for name in names:
        out.add_column(f"{name}\nextrapolated*", justify="right")
    labels = {"kogge-stone": "eq. 13", "kogge-stone, table I": "eq. 13, Table I", "serial": "relay's messages"}
    for label in labels.values():
        out.add_column(f"{label}\nmodelled", justify="right")
    for run in latest:
        alone = [run["extrapolated"].get(name, {}).get(size) for name in names]
        modelled = [run["modelled"][label][size] for label in labels]
        out.add_row(_count(run), *(_time(seconds) for seconds in (*alone, *modelled)))
    return out


def notes(runs: list[dict[str, Any]]) -> list[str]:
    """Say what the tables' signs mean, and what is missing and why."""
    out = [
        "Times are medians. * processor time a machine with a core a robot would need, its network not counted: the "
        "largest of a rank; for the relay that and all hops one after another.",
    ]
    if any(run["oversubscribed"] for run in runs):
        cores = runs[-1]["cores"]
        out.append(f"† oversubscribed: more ranks than the {cores} cores, so wall time is all robots' work on {cores}.")
    out += sorted({run["missing"] for run in runs if run["missing"]})
    against = {facts["error"]["against"] for run in runs for facts in run["methods"].values()}
    out.append(f"Error: largest difference from {' or '.join(sorted(against))} over the largest torque.")
    return out


def _latest(runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    if not runs:
        raise InputError("results: got no run, expected at least one")
    return sorted({run["n"]: run for run in runs}.values(), key=lambda run: int(run["n"]))


def _count(run: dict[str, Any]) -> str:
    return f"{run['n']}{'†' if run['oversubscribed'] else ''}"


def _time(seconds: float | None) -> str:
    """Seconds with a unit that leaves one to three digits before the point."""
    if seconds is None:
        return "-"
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "µs")):
        if seconds * factor >= 1:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
