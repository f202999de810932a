"""A trace has every round of every rank, and no message comes before it was sent."""

from itertools import pairwise

from _formation import COMM, RANK, SIZE, Checks

from mp2a.bench.timeline import clock_offset, trace_call
from mp2a.schedule import kogge_stone

check = Checks()
check(clock_offset(COMM) == 0)  # one machine, one clock
trace = trace_call(samples=5, seed=0, method="kogge-stone")
check((trace is None) == (RANK != 0))
if trace is not None:
    schedule = kogge_stone(SIZE)
    events = trace["traceEvents"]
    exchanges = [e for e in events if e.get("cat") == "exchange"]
    check(len(exchanges) == SIZE * len(schedule.rounds))
    check(all(e["dur"] >= 0 and e["ts"] >= 0 for e in events if e["ph"] == "X"))
    sent = {e["id"]: e for e in events if e["ph"] == "s"}
    came = {e["id"]: e for e in events if e["ph"] == "f"}
    check(sent.keys() == came.keys())
    check(len(sent) == sum(len(source) for r in schedule.rounds for _, source, _ in r.transfers))
    for key, message in sent.items():
        check(message["ts"] <= came[key]["ts"])
        check(message["args"]["bytes"] in (8 * 6 * 5, 8 * 42 * 5))
    for rank in range(SIZE):
        spans = sorted((e["ts"], e["ts"] + e["dur"]) for e in events if e["ph"] == "X" and e["tid"] == rank)
        check(all(before[1] <= after[0] + 1e-6 for before, after in pairwise(spans)))
check.done()
