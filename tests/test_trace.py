"""Traces: the factors of efficiency obey their laws, and an OTF2 archive holds what the trace holds."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pytest import approx

from mp2a import cli, dependencies
from mp2a.bench.efficiency import efficiency
from mp2a.bench.otf2_writer import write_otf2
from mp2a.bench.timeline import RankTiming, trace_events
from mp2a.exceptions import DependencyError, OutputError
from mp2a.methods import METHODS
from mp2a.transport.trace import RoundTiming

METHOD = METHODS["kogge-stone"]


def make_trace(n, work, latency=0, late=0):
    """A trace of ranks that compute for ``work(rank, k)`` ns before their k-th exchange; a rank alone, once."""
    schedule = METHOD.schedule(n)
    clock = [rank * late for rank in range(n)]
    began, rounds = list(clock), [[] for _ in range(n)]
    for k, round_ in enumerate(schedule.rounds):
        posted = [clock[rank] + work(rank, k) for rank in range(n)]
        clock = list(posted)
        for _, source, target in round_.transfers:
            for s, t in zip(source, target, strict=True):
                clock[t] = max(clock[t], posted[s] + latency)
        for rank in range(n):
            rounds[rank].append(RoundTiming(round_.recurrence, round_.index, posted[rank], clock[rank]))
    ranks = [RankTiming(began[r], rounds[r], clock[r] + work(r, 0)) for r in range(n)]
    about = {"n": n, "samples": 3, "method": "kogge-stone"}
    return {"traceEvents": trace_events(schedule, METHOD.doubles, ranks, 3), "mp2a": about}


@given(st.integers(1, 20), st.integers(0, 100), st.integers(0, 10_000), st.integers(0, 1000))
def test_factors_make_up_the_part_of_time_in_which_ranks_compute(n, seed, latency, late):
    amounts = np.random.default_rng(seed).integers(1, 1000, (n, 40)).tolist()
    found = efficiency(make_trace(n, lambda rank, k: amounts[rank][k], latency, late))
    factors = found.load_balance, found.serialisation, found.transfer
    assert all(0 < factor <= 1 + 1e-12 for factor in factors)
    assert np.prod(factors) == approx(found.parallel)
    assert found.parallel == approx(np.mean(found.computing) / found.seconds)
    assert found.communication == approx(found.serialisation * found.transfer)
    if latency == 0:
        assert found.transfer == approx(1)


@given(st.integers(2, 20), st.integers(1, 10_000))
def test_each_factor_tells_its_own_loss(n, latency):
    even = efficiency(make_trace(n, lambda rank, k: 100))
    assert (even.load_balance, even.serialisation, even.transfer) == approx((1, 1, 1))
    slow = efficiency(make_trace(n, lambda rank, k: 100, latency))
    assert (slow.load_balance, slow.serialisation) == approx((1, 1))
    assert slow.transfer == approx(even.seconds / slow.seconds)
    assert slow.transfer < 1
    lopsided = efficiency(make_trace(n, lambda rank, k: 200 if rank == 0 else 100))
    assert lopsided.load_balance == approx((n + 1) / (2 * n))
    assert lopsided.transfer == approx(1)


@pytest.mark.parametrize("n", [1, 2, 7])
def test_an_archive_holds_the_spans_and_messages(tmp_path, n):
    otf2 = pytest.importorskip("otf2")
    trace = make_trace(n, lambda rank, k: 50 + 7 * rank + k, latency=30)
    write_otf2(trace, tmp_path / "archive")
    write_otf2(trace, tmp_path / "archive")  # one takes the place of another
    with otf2.reader.open(str(tmp_path / "archive" / "traces.otf2")) as archive:
        events = [(location.name, event) for location, event in archive.events]
        names = [location.name for location in archive.definitions.locations]
    assert names == [f"robot {rank + 1}" for rank in range(n)]
    spans = [event for event in trace["traceEvents"] if event["ph"] == "X"]
    for kind, moment in (("Enter", lambda span: span["ts"]), ("Leave", lambda span: span["ts"] + span["dur"])):
        held = Counter((name, e.region.name, e.time) for name, e in events if type(e).__name__ == kind)
        assert held == Counter((names[s["tid"]], s["name"], round(1e3 * moment(s))) for s in spans)
    messages = [event for event in trace["traceEvents"] if event["ph"] == "s"]
    targets = {event["id"]: event["tid"] for event in trace["traceEvents"] if event["ph"] == "f"}
    ends = [(names[m["tid"]], names[targets[m["id"]]], m["args"]["bytes"]) for m in messages]
    sent = [(name, names[e.receiver], e.msg_length) for name, e in events if type(e).__name__ == "MpiSend"]
    came = [(names[e.sender], name, e.msg_length) for name, e in events if type(e).__name__ == "MpiRecv"]
    assert Counter(sent) == Counter(came) == Counter(ends)
    assert [path.name for path in tmp_path.iterdir()] == ["archive"]


def test_what_is_no_archive_is_left_alone(tmp_path):
    pytest.importorskip("otf2")
    (tmp_path / "file").write_text("mine")
    for there in (tmp_path, tmp_path / "file"):
        with pytest.raises(OutputError, match="it is there and no OTF2 archive"):
            write_otf2(make_trace(2, lambda rank, k: 1), there)
    assert (tmp_path / "file").read_text() == "mine"


def test_without_otf2_it_is_said_before_anything_is_traced(monkeypatch, capsys, tmp_path):
    def missing(module):
        raise ModuleNotFoundError(f"No module named {module!r}", name="otf2")

    monkeypatch.setattr(dependencies, "import_module", missing)
    with pytest.raises(DependencyError, match=r"pip install 'mp2a\[otf2\]'"):
        write_otf2(make_trace(2, lambda rank, k: 1), tmp_path / "archive")
    assert cli.main(["trace", "--ranks", "2", "--format", "otf2", "--out", str(tmp_path / "archive")]) == 2
    assert "mp2a[otf2]" in capsys.readouterr().err
