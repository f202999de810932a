"""The benchmark's table: what was measured, modelled and extrapolated, each named so."""

from typing import Any

from rich import box
from rich.table import Table

from mp2a.exceptions import InputError

SIZES = {"batch": "samples together", "single": "one sample at a time"}


def table(runs: list[dict[str, Any]], size: str) -> Table:
    """Build the table of some runs, a row a run.

    Parameters
    ----------
    runs
        Of a results file.
    size
        "batch" or "single".
    """
    if not runs:
        raise InputError("results: got no run, expected at least one")
    latest = list({run["n"]: run for run in runs}.values())
    latest.sort(key=lambda run: run["n"])
    method = latest[-1]["method"]
    title = f"{latest[-1]['samples']} {SIZES[size]}" if size == "batch" else SIZES[size]
    out = Table(title=f"{title}: time a sample", box=box.SIMPLE, title_justify="left")
    out.add_column("n", justify="right")
    for heading in ("rounds", "messages", "bytes", f"{method}\nmeasured", "largest cpu\nof a rank\nextrapolated*"):
        out.add_column(heading, justify="right")
    for name in ("relay", "relay,\npipelined", "centre", "pinocchio"):
        out.add_column(f"{name}\nmeasured", justify="right")
    out.add_column("eq. 13\nmodelled", justify="right")
    out.add_column("error", justify="right")
    for run in latest:
        measured = run["measured"]
        walls = [
            _time(measured.get(name, {}).get(size, {}).get("wall"))
            for name in (method, "relay", "relay, pipelined", "centre", "pinocchio")
        ]
        out.add_row(
            f"{run['n']}{'†' if run['oversubscribed'] else ''}",
            str(run["schedule"]["rounds"]),
            str(run["sent"]["messages"]),
            f"{run['sent']['bytes']:,}".replace(",", " "),
            walls[0],
            _time(run["extrapolated"][method][size]),
            *walls[1:],
            _time(run["modelled"]["kogge-stone"][size]),
            f"{run['error']['relative']:.0e}",
        )
    return out


def notes(runs: list[dict[str, Any]]) -> list[str]:
    """Say what the tables' signs mean, and what is missing and why."""
    out = [
        "Messages and bytes are those really sent for one sample by all robots together. Times are medians.",
        "* largest processor time of a rank: what a machine with a core a robot would need, its network not counted.",
    ]
    if any(run["oversubscribed"] for run in runs):
        cores = runs[-1]["cores"]
        out.append(f"† oversubscribed: more ranks than the {cores} cores, so wall time is all robots' work on {cores}.")
    out += sorted({run["missing"] for run in runs if run["missing"]})
    against = {run["error"]["against"] for run in runs}
    out.append(f"Error: largest difference from {' or '.join(sorted(against))} over the largest torque.")
    return out


def _time(seconds: float | None) -> str:
    """Seconds with a unit that leaves one to three digits before the point."""
    if seconds is None:
        return "-"
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "µs")):
        if seconds * factor >= 1:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
