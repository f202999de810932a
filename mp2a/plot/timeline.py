"""The paper's figure 12: who computed, waited and sent what to whom, at the times it really happened."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, Patch

from mp2a.exceptions import InputError
from mp2a.plot.looks import FAINT, INK, Look, look
from mp2a.plot.measurements import origin, plural
from mp2a.plot.style import Dashes, canvas, handle, legends, styled

_COLORS = {
    "velocity": "#0072B2",
    "acceleration": "#E69F00",
    "motion": "#0072B2",
    "sweep": "#0072B2",
    "force": "#009E73",
}
_MOST_ROBOTS = 32  # with more, arrows and hatching would cover one another
_SHAFTS: dict[str, tuple[Dashes, str]] = {
    "matrix+vector": ("-", "matrix and vector"),
    "vector": ((0, (3.5, 2)), "vector alone"),
    "motion": ("-", "motion"),
    "force": ((0, (3.5, 2)), "force"),
}


class TraceSpan(NamedTuple):
    """What one robot was at for a while; times in µs."""

    robot: int
    start: float
    length: float
    recurrence: str
    category: str


class TraceMessage(NamedTuple):
    """One message, from when it was sent to when it was there; times in µs."""

    source: int
    sent: float
    target: int
    arrived: float
    kind: str


def trace_spans(trace: Mapping[str, Any]) -> list[TraceSpan]:
    """Return the spans of a trace file, parsed, in its order.

    Raises
    ------
    InputError
        If it holds none, or one without its times.
    """
    events = trace.get("traceEvents") if isinstance(trace, Mapping) else None
    if not isinstance(events, list):
        raise InputError(f"trace: got {type(trace).__name__} without traceEvents, expected a trace file")
    out = []
    for event in events:
        if event.get("ph") != "X":
            continue
        name = (event.get("args") or {}).get("recurrence") or str(event.get("name", "")).partition(" ")[0]
        try:
            at = (int(event["tid"]), float(event["ts"]), float(event["dur"]))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"trace: got the span {event!r}, expected one with tid, ts and dur") from error
        out.append(TraceSpan(*at, name, event.get("cat", "compute")))
    if not out:
        raise InputError("trace: got no spans (events with ph = X), expected at least one")
    return out


def trace_messages(trace: Mapping[str, Any]) -> list[TraceMessage]:
    """Return the messages of a trace file, parsed, in the order they were sent.

    Each is a start and an end of the same id; a start whose end the trace does not hold is left out.
    """
    events = trace["traceEvents"]
    ends = {event["id"]: event for event in events if event.get("ph") == "f"}
    out = []
    for start in events:
        if start.get("ph") == "s" and start["id"] in ends:
            end = ends[start["id"]]
            kind = (start.get("args") or {}).get("kind", "vector")
            out.append(TraceMessage(int(start["tid"]), float(start["ts"]), int(end["tid"]), float(end["ts"]), kind))
    return sorted(out, key=lambda message: message.sent)


def time_shares(spans: Iterable[TraceSpan]) -> dict[str, float]:
    """Return which part of the time of all robots each recurrence took, waiting included, the known ones first."""
    total: dict[str, float] = {}
    for span in spans:
        total[span.recurrence] = total.get(span.recurrence, 0.0) + span.length
    whole = sum(total.values()) or 1.0
    order = [name for name in _COLORS if name in total] + sorted(total.keys() - _COLORS.keys())
    return {name: total[name] / whole for name in order}


@styled()
def timeline_figure(trace: Mapping[str, Any]) -> Figure:
    """Draw what every robot did when, with the messages as arrows, as the paper's figure 12.

    Parameters
    ----------
    trace
        A trace file of ``mp2a trace``, parsed.

    Returns
    -------
    Figure
        A row for each robot, robot 1 on top.

    Raises
    ------
    InputError
        For a trace without spans.
    """
    spans, sent = trace_spans(trace), trace_messages(trace)
    about = trace.get("mp2a") or {}
    rows = max([int(about.get("n", 1)), *(span.robot + 1 for span in spans), *(m.target + 1 for m in sent)])
    few = rows <= _MOST_ROBOTS
    zero = min([*(span.start for span in spans), *(m.sent for m in sent)])
    end = max([*(span.start + span.length for span in spans), *(m.arrived for m in sent)])
    unit, name = (1e3, "ms") if end - zero >= 1e3 else (1.0, "µs")
    figure = canvas(9.6, 1.3 + (max(1.4, 0.42 * rows) if rows <= 10 else max(4.2, 0.21 * rows) if few else 5.2))
    axes = figure.subplots()
    for recurrence in time_shares(spans):
        _bars(axes, [s for s in spans if s.recurrence == recurrence], zero, unit, few)
    if few:
        for message in sent:
            _arrow(axes, message, zero, unit)
    axes.set_xlim(0, max((end - zero) / unit, 1e-9) * 1.005)
    axes.set_ylim(rows - 0.4, -0.6)
    step = 1 if rows <= 16 else 2 if few else 2 ** int(np.ceil(np.log2(rows / 16)))
    ticks = [0, *range(step - 1, rows, step)] if step > 1 else list(range(rows))
    axes.set_yticks(ticks, [str(tick + 1) for tick in ticks])
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(True, axis="x")
    axes.set_ylabel("robot")
    axes.set_xlabel(f"time since the first event ({name})")
    axes.set_title(_title(about, rows), loc="left")
    legends(figure, _legend(spans, sent, few), origin("measured", [about]))
    return figure


def _bars(axes: Axes, spans: list[TraceSpan], zero: float, unit: float, few: bool) -> None:
    color = _color(spans[0].recurrence)
    half = 0.32 if few else 0.5
    for waiting in (True, False):
        chosen = [s for s in spans if (s.category == "exchange") == waiting]
        corners = [
            [(a, y - half), (b, y - half), (b, y + half), (a, y + half)]
            for a, b, y in (((s.start - zero) / unit, (s.start + s.length - zero) / unit, s.robot) for s in chosen)
        ]
        axes.add_collection(
            PolyCollection(
                corners,
                facecolors=_light(color) if waiting else color,
                edgecolors=color,
                linewidths=0.4 if few else 0.0 if waiting else 0.2,
                hatch="////" if waiting and few else None,
                zorder=2 if waiting else 3,
                rasterized=not few,
                gid=f"{'exchange' if waiting else 'compute'} {spans[0].recurrence}",
            ),
            autolim=False,
        )


def _arrow(axes: Axes, message: TraceMessage, zero: float, unit: float) -> None:
    towards = 0.32 * np.sign(message.target - message.source)
    axes.add_patch(
        FancyArrowPatch(
            ((message.sent - zero) / unit, message.source + towards),
            ((message.arrived - zero) / unit, message.target - towards),
            arrowstyle="-|>,head_length=3.5,head_width=1.6",
            mutation_scale=1,
            shrinkA=0,
            shrinkB=0,
            color=INK,
            linewidth=0.7,
            linestyle=_SHAFTS.get(message.kind, _SHAFTS["vector"])[0],
            zorder=4,
        )
    )


def _legend(spans: list[TraceSpan], sent: list[TraceMessage], few: bool) -> list[tuple[str, list[Artist]]]:
    recurrences = [
        Patch(color=_color(name), label=f"{name}, {part:.0%} of the time") for name, part in time_shares(spans).items()
    ]
    pale: dict[str, Any] = {
        "facecolor": "#e3e3e3",
        "edgecolor": FAINT,
        "linewidth": 0.4,
        "hatch": "//////" if few else None,
    }
    shades = [Patch(color="#5a5a5a", label="computing"), Patch(label="exchange: sending and waiting", **pale)]
    kinds = [k for k in _SHAFTS if any(m.kind == k for m in sent)] if few else []
    tip: dict[str, Any] = {"linewidth": 0.8, "markersize": 3.5, "markevery": [1]}
    arrows = [handle(Look(_SHAFTS[k][1], INK, ">"), _SHAFTS[k][0], **tip) for k in kinds]
    return [("recurrence", [*recurrences]), ("shade", [*shades]), ("message", [*arrows])]


def _title(about: Mapping[str, Any], rows: int) -> str:
    count = about.get("samples")
    parts = [
        str(about.get("method", "")),
        plural(rows, "robot"),
        plural(count, "sample") if count else "",
        "real time stamps",
    ]
    return ", ".join(part for part in parts if part)


def _color(recurrence: str) -> str:
    return _COLORS.get(recurrence) or look(recurrence).color


def _light(color: str) -> tuple[float, ...]:
    return tuple(0.75 + 0.25 * c for c in to_rgb(color))
