"""The curves that a results file of ``mp2a bench`` holds; in all of this module ``results`` is such a file, parsed."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist

from mp2a.bench.contenders import ALONE
from mp2a.exceptions import InputError
from mp2a.network import EmulatedNetwork
from mp2a.plot.looks import INK, Look, in_order
from mp2a.plot.style import handle

GRAINS = ("batch", "single")
"""Whether all samples travel in each message, or one at a time."""
SOURCES = ("measured", "modelled", "extrapolated")
"""Where times come from; measured ones are wall clock."""
PAPER_ROBOTS = 512
PAPER_SAMPLES = 2000


class Series(NamedTuple):
    """One curve of the results: seconds per sample over the number of robots."""

    n: np.ndarray
    seconds: np.ndarray
    oversubscribed: np.ndarray


def runs(results: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the runs by rising number of robots, of several for one number the last.

    Only those of one robot a rank are among them, with as many samples as the last of these and over the same network.

    Raises
    ------
    InputError
        For results without runs, or a run without a sensible number of robots or samples.
    """
    everything = results.get("runs") if isinstance(results, Mapping) else None
    if not isinstance(everything, list) or not everything:
        kind = "a file" if isinstance(results, Mapping) else type(results).__name__
        raise InputError(f"results: got {kind} without runs, expected a results file with at least one run")
    for run in everything:
        for key, what in (("n", "robots"), ("samples", "samples")):
            number = run.get(key) if isinstance(run, Mapping) else None
            if not isinstance(number, int) or number < 1:
                raise InputError(f"results: got a run with {key} = {number!r}, expected at least 1 of its {what}")
    formations = [run for run in everything if not (run.get("bodies") or run.get("bodies_per_rank"))]
    if not formations:
        raise InputError("results: got runs of chains in blocks alone, which mp2a plot scaling draws")
    last = formations[-1]
    alike = [run for run in formations if all(run.get(key) == last.get(key) for key in ("emulated", "samples"))]
    return [run for _, run in sorted({run["n"]: run for run in alike}.items())]


def series(results: Mapping[str, Any], source: str, contender: str, grain: str) -> Series:
    """Return one curve, of the runs that hold a time for it.

    Parameters
    ----------
    results
        The file.
    source
        One of `SOURCES`.
    contender
        Whose times.
    grain
        One of `GRAINS`.
    """
    rows = []
    for run in runs(results):
        cell = ((run.get(source) or {}).get(contender) or {}).get(grain)
        seconds = cell.get("wall") if isinstance(cell, Mapping) else cell
        if seconds is None:
            continue
        if not isinstance(seconds, int | float) or not 0 < seconds < np.inf:
            where = f"{source} {contender}, {grain}, n = {run['n']}"
            raise InputError(f"results: got {seconds!r} for {where}, expected seconds above 0")
        shared = source == "measured" and contender not in ALONE and bool(run.get("oversubscribed"))
        rows.append((run["n"], seconds, shared))
    n, times, shares_cores = zip(*rows, strict=True) if rows else ((), (), ())
    return Series(np.array(n, dtype=int), np.array(times, dtype=float), np.array(shares_cores, dtype=bool))


def contenders(results: Mapping[str, Any], source: str) -> list[str]:
    """Return the names of who has at least one time from a source, in the order of legends."""
    held = {name for run in runs(results) for name, cell in (run.get(source) or {}).items() if cell}
    return [name for name in in_order(held) if any(len(series(results, source, name, grain).n) for grain in GRAINS)]


def sample_count(results: Mapping[str, Any]) -> int:
    """Return how many samples the trajectory has."""
    return int(runs(results)[-1]["samples"])


def plural(count: int, noun: str) -> str:
    """Return a number and its noun, with an s behind it where there is not just one."""
    return f"{count} {noun}{'s' * (count != 1)}"


def grain_title(results: Mapping[str, Any], grain: str) -> str:
    """Return what a panel is called by the way samples travel: "2000 samples in each message", for instance."""
    emulated = runs(results)[-1].get("emulated")
    network = f",\nemulated network of {EmulatedNetwork(*emulated)}" if emulated else ""
    if grain == "single":
        return f"one sample at a time{network}"
    return f"{plural(sample_count(results), 'sample')} in each message{network}"


def origin(what: str, sources: Iterable[Mapping[str, Any]]) -> str:
    """Return the note below a picture that says on what machines its numbers come to be, and when.

    Parameters
    ----------
    what
        How they come to be there: "measured", for instance.
    sources
        What has a ``machine`` and may have a ``date``: the runs of a results file, for instance.
    """
    machines, days = [], set()
    for source in sources:
        if machine := source.get("machine"):
            kernels = machine.get("kernels", "compiled")
            slow = "" if kernels == "compiled" else f", kernels: {kernels}"
            machines.append(f"{machine['processor']}, {plural(machine['cores'], 'core')}{slow}")
        days |= {str(source["date"])[:10]} if source.get("date") else set()
    if not machines:
        return ""
    when = f"; {' to '.join(dict.fromkeys((min(days), max(days))))}" if days else ""
    return f"{what} on {' and on '.join(dict.fromkeys(machines))}{when}"


def hollow_note(shown: Iterable[Mapping[str, Any]]) -> list[Artist]:
    """Return the entry of a legend that explains hollow markers; none where no run that is shown had too few cores."""
    crowded = [run for run in shown if run.get("oversubscribed")]
    if not crowded:
        return []
    cores = sorted({run["cores"] for run in crowded if "cores" in run})
    few = f"the {' or '.join(map(str, cores))} core{'s' * (cores != [1])}" if cores else "cores"
    return [handle(Look(f"hollow: more ranks than {few}", INK, "o"), "none", hollow=True, markeredgewidth=1.2)]
