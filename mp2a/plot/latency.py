"""Who is fastest where messages take time: one sample over emulated networks of several latencies."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mp2a.bench.contenders import MPI_SCAN, MPI_SCAN_DOUBLING, ONE_PROCESS, PINOCCHIO, PIPELINE_BLOCKS
from mp2a.exceptions import InputError
from mp2a.methods import METHODS
from mp2a.network import EmulatedNetwork
from mp2a.plot.looks import LOOKS, look
from mp2a.plot.measurements import hollow_note, origin, plural
from mp2a.plot.panels import Curve, draw_lines, draw_rows, in_seconds, legend_groups, rows_height, rows_of
from mp2a.plot.style import canvas, legends, log_axis, styled

_OTHERS = ("kogge-stone, table I", "serial", MPI_SCAN, MPI_SCAN_DOUBLING, ONE_PROCESS, PINOCCHIO, PIPELINE_BLOCKS)
CONTENDERS = tuple(name for name in LOOKS if name not in _OTHERS)
"""Those whose messages take time, one sample after another."""

_MEASURED = "measured, wall clock"
_FLOOR = "latency × rounds, if none overlap"


def emulated(results: Mapping[str, Any]) -> dict[EmulatedNetwork, list[Mapping[str, Any]]]:
    """Return the runs over each emulated network, by rising n; of several runs of one n the last.

    Raises
    ------
    InputError
        If there is no such run.
    """
    networks: dict[EmulatedNetwork, dict[int, Mapping[str, Any]]] = {}
    for run in results.get("runs", []):
        if run.get("emulated"):
            networks.setdefault(EmulatedNetwork(*map(float, run["emulated"])), {})[int(run["n"])] = run
    if not networks:
        raise InputError("results: got no run over an emulated network, expected some of mp2a bench --network")
    return {network: [runs[n] for n in sorted(runs)] for network, runs in sorted(networks.items())}


@styled()
def latency_figure(results: Mapping[str, Any]) -> Figure:
    """Draw the time of one sample over the number of robots, a panel for each emulated network.

    Parameters
    ----------
    results
        A results file of ``mp2a bench``, parsed. If its runs over emulated networks are all of one number of robots,
        every contender is a row.

    Returns
    -------
    Figure
        A curve carries its contender's name as gid, and "floor sweep" for instance what latency alone would
        take.

    Raises
    ------
    InputError
        If no run was over an emulated network.
    """
    networks = emulated(results)
    shown = [run for runs in networks.values() for run in runs]
    sizes = sorted({run["n"] for run in shown})
    panels = {
        network: _curves(runs) + _floors(network, runs, "|" if len(sizes) == 1 else "")
        for network, runs in networks.items()
    }
    everything = [line for curves in panels.values() for line in curves]
    what = "emulated network: measured over messages that arrive late"
    if len(sizes) == 1:
        rows = rows_of(everything)
        figure = canvas(max(2.4 * len(panels) + 1.8, 7.2), rows_height(rows) + 1.0)
        what, groups = f"{plural(sizes[0], 'robot')}, {what}", []
    else:
        figure = canvas(max(2.4 * len(panels) + 0.8, 7.2), 3.6)
        groups = legend_groups(everything)
    drawn = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, (network, curves) in zip(drawn, panels.items(), strict=True):
        if len(sizes) == 1:
            draw_rows(axes, curves, rows, "s")
            axes.set_xlabel("time of one sample")
        else:
            draw_lines(axes, curves, sizes)
        axes.set_title(str(network))
    if len(sizes) > 1:
        for axes in drawn:
            log_axis(axes.yaxis, "s", axes.get_ylim())
        drawn[0].set_ylabel("time of one sample")
    figure.suptitle(what)
    legends(figure, [*groups, ("for comparison", hollow_note(shown))], origin("measured", shown))
    return figure


def _curves(runs: list[Mapping[str, Any]]) -> list[Curve]:
    out = []
    for who in CONTENDERS:
        cells = [(run, run["measured"][who]["single"]["wall"]) for run in runs if who in run["measured"]]
        if cells:
            n, hollow = np.array([(run["n"], bool(run.get("oversubscribed"))) for run, _ in cells]).T
            wall = np.array([seconds for _, seconds in cells], dtype=float)
            out.append(Curve(who, _MEASURED, look(who), "-", n, wall, hollow.astype(bool), in_seconds(wall)))
    return out


def _floors(network: EmulatedNetwork, runs: list[Mapping[str, Any]], marker: str) -> list[Curve]:
    """Return what the rounds of our methods would take one after another if nothing but latency took time."""
    out = []
    for who in METHODS:
        rounds = [(run["n"], run["methods"][who]["rounds"]) for run in runs if who in run["methods"] and run["n"] > 1]
        if rounds:
            n, count = np.array(rounds).T
            seconds, shape = count * network.latency, look(who)._replace(marker=marker)
            filled = np.zeros(len(n), dtype=bool)
            out.append(Curve(f"floor {who}", _FLOOR, shape, (0, (1, 1.5)), n, seconds, filled, in_seconds(seconds)))
    return out
