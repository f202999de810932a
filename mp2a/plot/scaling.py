"""Strong and weak scaling of long chains in blocks: the time of a sample over the number of ranks."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from mp2a.bench.contenders import ALONE
from mp2a.bench.scaling import Scaling, scalings
from mp2a.exceptions import InputError
from mp2a.plot.looks import FAINT, Look, look
from mp2a.plot.measurements import hollow_note, origin, plural
from mp2a.plot.panels import Curve, draw_lines
from mp2a.plot.style import canvas, handle, legends, log_axis, styled


@styled()
def scaling_figure(results: Mapping[str, Any]) -> Figure:
    """Draw the time of one sample over the number of ranks, a panel for strong and one for weak scaling.

    Parameters
    ----------
    results
        A results file of ``mp2a bench`` with ``--bodies`` or ``--bodies-per-rank``, parsed.

    Returns
    -------
    Figure
        A curve carries its contender's name as gid, and "ideal" what the best method's time with the fewest ranks
        would ideally come to.

    Raises
    ------
    InputError
        If no run was of a chain in blocks.
    """
    found = scalings(results.get("runs", []))
    if not found:
        raise InputError("results: got no run of a chain in blocks, expected some of mp2a bench --bodies")
    figure = canvas(4.8 * len(found) if len(found) > 1 else 7.2, 3.9)
    drawn = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
    groups: list[tuple[str, list[Artist]]] = []
    for axes, scaling in zip(drawn, found, strict=True):
        sizes = [run["n"] for run in scaling.runs]
        draw_lines(axes, _curves(scaling), sizes)
        axes.plot(sizes, _ideal(scaling, sizes), color=FAINT, linestyle="-.", linewidth=1.2, zorder=1, gid="ideal")
        axes.set_title(scaling.title)
        axes.set_xlabel("ranks")
        groups.append((f"{scaling.title},\nefficiency with {plural(sizes[-1], 'rank')}", _efficiencies(scaling)))
    for axes in drawn:
        log_axis(axes.yaxis, "s", axes.get_ylim())
    drawn[0].set_ylabel("time of one sample")
    runs = [run for scaling in found for run in scaling.runs]
    alone = [handle(look(name), "--") for name in ALONE if any(scaling.times(name) for scaling in found)]
    ideal = handle(Look("ideal, from the best with the fewest ranks", FAINT, ""), "-.", linewidth=1.2)
    legends(figure, [*groups, ("for comparison", [*alone, ideal, *hollow_note(runs)])], origin("measured", runs))
    return figure


def _curves(scaling: Scaling) -> list[Curve]:
    hollow = {run["n"]: bool(run.get("oversubscribed")) for run in scaling.runs}
    out = []
    for name in (*scaling.methods, *ALONE):
        times = scaling.times(name)
        shared = np.array([hollow[n] and name not in ALONE for n in times])
        n, seconds = np.array(list(times)), np.array(list(times.values()))
        if times:
            out.append(Curve(name, "measured", look(name), "--" if name in ALONE else "-", n, seconds, shared))
    return out


def _ideal(scaling: Scaling, sizes: list[int]) -> list[float]:
    """Return what the best time with the fewest ranks would come to."""
    first = min(scaling.times(name)[sizes[0]] for name in scaling.methods)
    return [first if scaling.weak else first * sizes[0] / n for n in sizes]


def _efficiencies(scaling: Scaling) -> list[Artist]:
    """Return entries of a legend that tell the efficiency of each method with the most ranks."""
    last = scaling.runs[-1]["n"]
    return [
        handle(look(name)._replace(label=f"{name}: {scaling.efficiency(name)[last]:.0%}"), "-")
        for name in scaling.methods
    ]
