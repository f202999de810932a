"""A real run, traced: what each rank did and which message flew when, in the format of Perfetto's viewer.

The Chrome trace event format, which https://ui.perfetto.dev opens: complete events (``X``) for spans, flow events
(``s``, ``f``) for messages, metadata (``M``) for names.
"""

import time
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from mp2a.bench.machine import describe_machine
from mp2a.bench.timing import barrier
from mp2a.distributed import DistributedModel
from mp2a.methods import METHODS
from mp2a.model import Model
from mp2a.mpi import MPI
from mp2a.schedule import Schedule
from mp2a.transport.trace import RoundTiming

_WARM_UP = 5
_ALIGN = 20


class RankTiming(NamedTuple):
    """One call of one rank; times are rank 0's monotonic clock, in ns."""

    began: int
    rounds: list[RoundTiming]
    """In order."""
    ended: int
    """When the call was over. What lies behind the last round, own torque, sends that end and ranks that agree, cannot
    be told apart and is left out of a trace."""


def trace_call(samples: int, seed: int, method: str) -> dict[str, Any] | None:
    """Trace one call on the world communicator; collective. The trace on rank 0, None elsewhere."""
    comm = MPI.COMM_WORLD
    model = Model.random(comm.Get_size(), seed)
    state = model.random_state(samples, seed, body=comm.Get_rank())
    with DistributedModel(comm, model, method, trace=True) as formation:
        assert formation.trace is not None
        for _ in range(_WARM_UP):
            formation.rnea(*state)
        offset = clock_offset(comm)
        barrier(comm)
        formation.trace.events.clear()
        began = time.monotonic_ns()
        formation.rnea(*state)
        ended = time.monotonic_ns()
        rounds = [e._replace(posted=e.posted - offset, done=e.done - offset) for e in formation.trace.events]
        ranks = comm.gather(RankTiming(began - offset, rounds, ended - offset))
        if ranks is None:
            return None
        return {
            "traceEvents": trace_events(formation.schedule, METHODS[formation.method].doubles, ranks, samples),
            "displayTimeUnit": "ns",
            "mp2a": {
                "n": len(model),
                "samples": samples,
                "method": formation.method,
                "machine": describe_machine(),
            },
        }


def clock_offset(comm: MPI.Intracomm) -> int:
    """How far this rank's monotonic clock is ahead of rank 0's, in ns; collective.

    Ranks of one machine share the clock. A rank on another asks rank 0 for the time and takes the answer of the
    shortest round trip as of its middle (Cristian 1989).
    """
    host = comm.bcast(MPI.Get_processor_name())
    elsewhere = comm.allgather(host != MPI.Get_processor_name())
    offset = 0
    for rank in np.flatnonzero(elsewhere):
        if comm.Get_rank() == rank:
            offset = _ask_time(comm)
        elif comm.Get_rank() == 0:
            _tell_time(comm, int(rank))
    return offset


def trace_events(
    schedule: Schedule, doubles: Mapping[str, int], ranks: list[RankTiming], samples: int
) -> list[dict[str, Any]]:
    """Spans and messages of a traced call; the first moment is 0, times are in µs.

    Parameters
    ----------
    schedule
        What the ranks followed.
    doubles
        Numbers a sample in each kind of message.
    ranks
        What each rank was at.
    samples
        Samples in each message.
    """
    origin = min(rank.began for rank in ranks)
    out: list[dict[str, Any]] = [{"ph": "M", "pid": 0, "name": "process_name", "args": {"name": "formation"}}]
    for number, rank in enumerate(ranks):
        about = {"name": f"robot {number + 1}"}
        out.append({"ph": "M", "pid": 0, "tid": number, "name": "thread_name", "args": about})
        out += _spans(number, rank, origin)
    return out + _messages(schedule, doubles, [rank.rounds for rank in ranks], samples, origin)


def _spans(number: int, rank: RankTiming, origin: int) -> list[dict[str, Any]]:
    """Compute and exchange in turn, from the beginning of the call to its last round."""
    if not rank.rounds:
        return [_span(number, "alone", "compute", RoundTiming("alone", 0, 0, 0), rank.began, rank.ended, origin)]
    first = rank.rounds[0]
    out = [_span(number, f"{first.recurrence}: leaf", "compute", first, rank.began, first.posted, origin)]
    for event, after in zip(rank.rounds, [*rank.rounds[1:], None], strict=True):
        name = f"{event.recurrence} round {event.round}"
        out.append(_span(number, f"{name}: exchange", "exchange", event, event.posted, event.done, origin))
        if after is not None:
            label = f"{name}: join" if after.recurrence == event.recurrence else f"{after.recurrence}: leaf"
            out.append(_span(number, label, "compute", after, event.done, after.posted, origin))
    return out


def _span(rank: int, name: str, category: str, event: RoundTiming, start: int, end: int, origin: int) -> dict[str, Any]:
    return {
        **{"ph": "X", "pid": 0, "tid": rank, "name": name, "cat": category},
        **{"ts": (start - origin) / 1e3, "dur": (end - start) / 1e3},
        "args": {"recurrence": event.recurrence, "round": event.round},
    }


def _messages(
    schedule: Schedule, doubles: Mapping[str, int], ranks: list[list[RoundTiming]], samples: int, origin: int
) -> list[dict[str, Any]]:
    moments = [{(e.recurrence, e.round): e for e in events} for events in ranks]
    out: list[dict[str, Any]] = []
    for round_ in schedule.rounds:
        key = round_.recurrence, round_.index
        for kind, source, target in round_.transfers:
            for s, t in zip(source.tolist(), target.tolist(), strict=True):
                about = {"pid": 0, "id": len(out) // 2, "name": round_.recurrence, "cat": "message"}
                args = {"kind": kind, "bytes": 8 * doubles[kind] * samples, "round": round_.index}
                left, came = (moments[s][key].posted - origin) / 1e3, (moments[t][key].done - origin) / 1e3
                out.append({**about, "ph": "s", "tid": s, "ts": left, "args": args})
                out.append({**about, "ph": "f", "bp": "e", "tid": t, "ts": came, "args": args})
    return out


def _ask_time(comm: MPI.Intracomm) -> int:
    best = (1 << 62, 0)
    for _ in range(_ALIGN):
        asked = time.monotonic_ns()
        theirs = comm.sendrecv(None, 0, source=0)
        answered = time.monotonic_ns()
        best = min(best, (answered - asked, (asked + answered) // 2 - theirs))
    return best[1]


def _tell_time(comm: MPI.Intracomm, rank: int) -> None:
    for _ in range(_ALIGN):
        comm.recv(source=rank)
        comm.send(time.monotonic_ns(), rank)
