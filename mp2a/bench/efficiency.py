"""Where the time of a traced call goes: the factors of parallel efficiency that POP defines.

Performance Optimisation and Productivity, a centre of excellence for HPC (https://pop-coe.eu, "standard metrics for
performance analysis"), writes parallel efficiency as a product. With C_r the time that rank r computes, T the time from
the first rank's beginning to the last one's end, and T_0 what T would be if messages took no time:

    load balance  mean(C) / max(C)      serialisation  max(C) / T_0      transfer  T_0 / T

Serialisation is waiting that no network can spare, for who has not sent yet. T_0 comes from the trace: every rank
computes as long as it did, and an exchange ends once all who send to it have come to theirs.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, NamedTuple

from mp2a.exceptions import InputError
from mp2a.tables import Column, Table, show_seconds

NOTE = (
    "Factors as POP defines them (https://pop-coe.eu). Computing is wall time outside exchanges, which Python does "
    "while they are traced, up to the last round; where ranks share cores, waits for a core are in it."
)
"""What to know of the figures of a trace."""

_Exchange = tuple[int, str, int]
"""Rank, recurrence and round."""


class Efficiency(NamedTuple):
    """Times of a traced call in s, and the factors that follow from them."""

    computing: tuple[float, ...]
    """C of each rank."""
    seconds: float
    """T."""
    without_network: float
    """T_0."""

    @property
    def load_balance(self) -> float:
        """Mean over largest time of computing."""
        return sum(self.computing) / len(self.computing) / max(self.computing)

    @property
    def serialisation(self) -> float:
        """Largest time of computing over what the call would take without a network."""
        return max(self.computing) / self.without_network

    @property
    def transfer(self) -> float:
        """What the call would take without a network over what it took."""
        return self.without_network / self.seconds

    @property
    def communication(self) -> float:
        """Serialisation and transfer together."""
        return self.serialisation * self.transfer

    @property
    def parallel(self) -> float:
        """All three together: the part of all ranks' time in which they compute."""
        return self.load_balance * self.communication


def efficiency(trace: Mapping[str, Any]) -> Efficiency:
    """Work out the factors of a trace.

    Parameters
    ----------
    trace
        What `mp2a.bench.timeline.trace_call` returned, or a file of it, parsed.

    Raises
    ------
    InputError
        If it has no spans.
    """
    spans = defaultdict(list)
    senders = defaultdict(list)
    ends = {event["id"]: event["tid"] for event in trace["traceEvents"] if event["ph"] == "f"}
    for event in trace["traceEvents"]:
        if event["ph"] == "X":
            spans[event["tid"]].append(event)
        elif event["ph"] == "s":
            name, number = event["name"], event["args"]["round"]
            senders[ends[event["id"]], name, number].append((event["tid"], name, number))
    if not spans:
        raise InputError("trace: got no spans (events with ph = X), expected at least one")
    computing = [sum(span["dur"] for span in own if span["cat"] == "compute") for own in spans.values()]
    last = max(span["ts"] + span["dur"] for own in spans.values() for span in own)
    first = min(span["ts"] for own in spans.values() for span in own)
    ideal = _without_network(spans, senders) - first
    return Efficiency(tuple(1e-6 * time for time in computing), 1e-6 * (last - first), 1e-6 * ideal)


def efficiency_table(found: Efficiency) -> Table:
    """Make a table of the factors, products before what they are made of."""
    rows = [
        ["parallel efficiency", found.parallel],
        ["  load balance", found.load_balance],
        ["  communication efficiency", found.communication],
        ["    serialisation efficiency", found.serialisation],
        ["    transfer efficiency", found.transfer],
    ]
    title = f"factors of a call of {show_seconds(found.seconds)}"
    return Table(title, [Column("factor", left=True), Column("part", lambda part: f"{part:.1%}")], rows)


def _without_network(
    spans: Mapping[int, list[Mapping[str, Any]]], senders: Mapping[_Exchange, Iterable[_Exchange]]
) -> float:
    """When the last rank would end, in µs, if every message came as soon as it was sent."""
    place = {
        (rank, span["args"]["recurrence"], span["args"]["round"]): k
        for rank, own in spans.items()
        for k, span in enumerate(own)
        if span["cat"] == "exchange"
    }

    @cache
    def end(rank: int, k: int) -> float:
        """When a rank would be done with its first spans up to one."""
        if k < 0:
            return float(spans[rank][0]["ts"])
        span = spans[rank][k]
        before = end(rank, k - 1)
        if span["cat"] == "compute":
            return before + float(span["dur"])
        own = rank, span["args"]["recurrence"], span["args"]["round"]
        return max([before, *(end(sender[0], place[sender] - 1) for sender in senders.get(own, ()))])

    return max(end(rank, len(own) - 1) for rank, own in spans.items())
