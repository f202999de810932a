"""Pictures: what their curves hold is what the files hold, and every situation gives a file worth opening."""

import json
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from mp2a import plot
from mp2a.cost_model import amdahl, karp_flatt
from mp2a.exceptions import InputError
from mp2a.plot.speedup import PARALLEL_PARTS, speedup_figure, speedups
from mp2a.plot.style import spread
from mp2a.plot.time import GRAINS, contenders, runs, series, time_figure
from mp2a.plot.timeline import messages, shares, spans, timeline_figure

MAGIC = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}
EVERY_N = (1, 2, 3, 4, 8, 16, 32, 64, 128, 256, 512)


def make_results(counts=EVERY_N, cores=2, without=(), samples=2000, seed=0):
    """Results as a machine with few cores gives them: times rise as ranks share cores."""
    rng = np.random.default_rng(seed)

    def noisy(seconds):
        return float(seconds * rng.lognormal(0, 0.08))

    def cell(batch, single):
        walls = [noisy(batch), noisy(single)]
        return {g: {"wall": w, "cpu": 0.8 * w} for g, w in zip(GRAINS, walls, strict=True)}

    out = []
    for n in counts:
        rounds, crowd = int(np.ceil(np.log2(n))), max(1, n / cores)
        measured = {
            "kogge-stone": cell((2e-6 + 1.5e-6 * rounds) * crowd, (40e-6 + 50e-6 * rounds) * crowd),
            "pipeline": cell(3e-6 * n * (1 + 0.5 * (n > cores)), 60e-6 * n * (1 + 0.5 * (n > cores))),
            "compact": cell((3e-6 + 2e-6 * rounds) * crowd, (50e-6 + 45e-6 * rounds) * crowd),
            "sweep": cell((5e-6 + 4e-6 * rounds) * crowd, (60e-6 + 90e-6 * rounds) * crowd),
            "pipeline, blocks": cell(2e-6 * n, 61e-6 * n * (1 + 0.5 * (n > cores))),
            "gather-scatter, tree": cell(1e-6 + 0.9e-6 * n, 50e-6 + 6e-6 * n),
            "gather-scatter": cell(1e-6 + 0.9e-6 * n, 30e-6 + 6e-6 * n),
            "pinocchio": cell(0.11e-6 * n + 0.4e-6, 0.12e-6 * n + 0.6e-6) if n < 512 else None,
        }
        modelled = {
            "kogge-stone": {"batch": 1.5e-6 + 1.2e-6 * rounds, "single": 30e-6 + 45e-6 * rounds},
            "serial": {"batch": 0.11e-6 * n, "single": 0.12e-6 * n},
        }
        extrapolated = {
            "kogge-stone": {"batch": noisy(2e-6 + 1.5e-6 * rounds), "single": noisy(40e-6 + 50e-6 * rounds)},
            "pipeline": {"batch": noisy(3e-6 * n), "single": noisy(60e-6 * n)},
        }
        run = {
            "n": n,
            "samples": samples,
            "oversubscribed": n > cores,
            "cores": cores,
            "measured": {k: v for k, v in measured.items() if k not in without},
            "modelled": None
            if "modelled" in without
            else modelled
            if n > 1
            else {"serial": {"batch": 0.0, "single": 0.0}},
            "extrapolated": extrapolated,
        }
        if "extrapolated" in without:
            del run["extrapolated"]
        out.append(run)
    results = {"format": 1, "machine": {"cores": cores, "processor": "made up"}, "runs": out}
    return json.loads(json.dumps(results))


def make_trace(n, samples=2000, seed=0, method="kogge-stone"):
    """A trace of three scans as ranks with a core each would leave it; times in µs."""
    rng = np.random.default_rng(seed)
    events = [
        {"ph": "M", "name": "thread_name", "pid": 0, "tid": i, "args": {"name": f"robot {i + 1}"}} for i in range(n)
    ]
    clock = 5e6 + rng.uniform(0, 60, n)
    for recurrence, leaf, work in (("velocity", 900, 300), ("acceleration", 350, 250), ("force", 300, 250)):
        sign = -1 if recurrence == "force" else 1

        def span(i, start, length, name, cat, recurrence=recurrence):
            args = {"recurrence": recurrence}
            events.append(
                {"ph": "X", "pid": 0, "tid": i, "ts": start, "dur": length, "name": name, "cat": cat, "args": args}
            )

        for i in range(n):
            length = leaf * rng.lognormal(0, 0.1)
            span(i, clock[i], length, f"{recurrence} leaf", "compute")
            clock[i] += length
        for e in range(1, int(np.ceil(np.log2(n))) + 1):
            step, sent, done = 2 ** (e - 1), clock.copy(), clock.copy()
            for i in range(n):
                place = i if sign > 0 else n - 1 - i
                to = i + sign * step
                if not 0 <= to < n:
                    continue
                k, arrival = len(events), sent[i] + 80 * rng.lognormal(0, 0.5)
                kind = "vector" if place < step else "matrix+vector"
                args = {"kind": kind, "bytes": samples * (48 if kind == "vector" else 336), "round": e}
                same = {"id": k, "pid": 0, "name": recurrence, "cat": "message"}
                events.append({"ph": "s", "tid": i, "ts": sent[i], "args": args, **same})
                arrival = max(arrival, sent[to] + 5)
                events.append({"ph": "f", "bp": "e", "tid": to, "ts": arrival, **same})
                done[to] = arrival
            for i in range(n):
                if done[i] > sent[i]:
                    span(i, sent[i], done[i] - sent[i], f"{recurrence} round {e}", "exchange")
                    length = work * rng.lognormal(0, 0.15)
                    span(i, done[i], length, f"{recurrence} round {e}", "compute")
                    clock[i] = done[i] + length
    told = {"n": n, "samples": samples, "method": method}
    return json.loads(json.dumps({"traceEvents": events, "mp2a": told, "displayTimeUnit": "ns"}))


def lines(figure):
    """All named lines of a figure's panels."""
    return [{line.get_gid(): line for line in axes.lines if line.get_gid()} for axes in figure.axes[:2]]


@pytest.mark.parametrize(
    "without", [(), ("gather-scatter", "pinocchio"), ("modelled", "extrapolated"), ("sweep", "compact")]
)
@pytest.mark.parametrize("counts", [(8,), EVERY_N], ids=["one n", "every n"])
def test_time_curves_are_the_results(counts, without):
    results = make_results(counts, without=without)
    for grain, panel in zip(GRAINS, lines(time_figure(results)), strict=True):
        drawn = {name for name in panel if name.split()[0] in ("measured", "modelled", "extrapolated")}
        assert drawn == {
            f"{s} {who}" for s in ("measured", "modelled", "extrapolated") for who in contenders(results, s)
        }
        for name in drawn:
            source, _, who = name.partition(" ")
            held = {}
            for run in results["runs"]:
                cell = ((run.get(source) or {}).get(who) or {}).get(grain)
                if cell:
                    held[run["n"]] = 2000 * (cell["wall"] if source == "measured" else cell)
            assert dict(zip(panel[name].get_xdata(), panel[name].get_ydata(), strict=True)) == pytest.approx(held)


@pytest.mark.parametrize("period", [0.001, 0.05])
def test_real_time_is_the_trajectory_at_the_control_period(period):
    for panel in lines(time_figure(make_results((2, 8)), period)):
        assert_allclose(panel["real time"].get_ydata(), 2000 * period)


def test_last_run_of_an_n_counts_and_only_over_its_network():
    results = make_results((4, 8))
    again, emulated = make_results((4,), seed=1)["runs"][0], make_results((8,), seed=2)["runs"][0]
    emulated["emulated"] = [0.005, 54e6]
    results["runs"] = [emulated, *results["runs"], again]
    assert runs(results) == [again, results["runs"][2]]


@given(st.floats(0.01, 0.999), st.integers(2, 1000))
def test_karp_and_flatt_undo_amdahl(part, n):
    assert float(karp_flatt(amdahl(n, part), n)) == pytest.approx(part, abs=1e-9)


def test_speedup_is_the_quotient_of_times():
    results = make_results()
    for source in ("measured", "extrapolated"):
        ours = series(results, source, "kogge-stone", "single")
        found = speedups(results, "pipeline", "single", source)
        theirs = series(results, source, "pipeline", "single")
        assert_allclose(found.speedup * ours.seconds, theirs.seconds)
    for run in results["runs"]:
        run["measured"]["pipeline"] = run["measured"]["kogge-stone"]
    assert_allclose(speedups(results, "pipeline", "batch").speedup, 1)


@pytest.mark.parametrize("against", ["pipeline", "gather-scatter", "pinocchio"])
def test_speedup_curves_are_the_quotients(against):
    results = make_results(without=("compact",))
    for grain, panel in zip(GRAINS, lines(speedup_figure(results, against)), strict=True):
        for method in ("kogge-stone", "sweep"):
            found = speedups(results, against, grain, "measured", method)
            assert_allclose(panel[f"measured {method}"].get_ydata(), found.speedup)
        for part in PARALLEL_PARTS:
            law = panel[f"amdahl {part}"]
            assert_allclose(law.get_ydata(), amdahl(law.get_xdata(), part))
        assert panel["paper"].get_ydata() == [42.1]


@pytest.mark.parametrize("n", [3, 8, 40])
def test_timeline_shows_every_span_and_message(n):
    trace = make_trace(n)
    assert len(spans(trace)) == sum(e["ph"] == "X" for e in trace["traceEvents"])
    assert len(messages(trace)) == sum(e["ph"] == "s" for e in trace["traceEvents"])
    assert all(m.sent <= m.arrived for m in messages(trace))
    assert sum(shares(spans(trace)).values()) == pytest.approx(1)
    axes = timeline_figure(trace).axes[0]
    bars = sum(len(c.get_paths()) for c in axes.collections)
    assert bars == len(spans(trace))
    assert len(axes.patches) == (len(messages(trace)) if n <= 32 else 0)


@pytest.mark.parametrize("suffix", MAGIC)
def test_files_are_pictures(tmp_path, suffix):
    folder = tmp_path / "new" / "folder"
    for draw, data in ((plot.time, make_results()), (plot.speedup, make_results()), (plot.timeline, make_trace(8))):
        written = draw(data, folder / f"{draw.__name__}{suffix}")
        assert written.read_bytes().startswith(MAGIC[suffix])
        assert written.stat().st_size > 5000


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p: plot.time({"runs": []}, p / "a.png"), "results: .*expected"),
        (lambda p: plot.time([], p / "a.png"), "results: got list"),
        (lambda p: plot.time(make_results((4,)), p / "a.bmp"), "path: got 'a.bmp', expected"),
        (lambda p: plot.time(make_results((4,)), p / "a.png", period=0), "period: got 0"),
        (lambda p: plot.speedup(make_results((4,)), p / "a.png", against="magic"), "against: got 'magic', expected"),
        (lambda p: plot.timeline({}, p / "a.png"), "trace: .*expected"),
        (lambda p: plot.timeline({"traceEvents": []}, p / "a.png"), "trace: got no spans"),
    ],
)
def test_wrong_input_is_named(tmp_path, call, message):
    with pytest.raises(InputError, match=message):
        call(tmp_path)
    assert not list(tmp_path.iterdir())


@given(st.lists(st.floats(0, 100), max_size=12), st.floats(0.1, 20))
def test_labels_are_kept_apart_in_their_order(places, gap):
    moved = spread(places, gap)
    order = np.argsort(places, kind="stable")
    assert (np.diff(moved[order]) >= gap * (1 - 1e-9)).all()
    if len(places):
        assert np.mean(moved) == pytest.approx(np.mean(places), abs=1e-6 + gap * len(places))


def test_the_users_own_pyplot_is_left_alone():
    code = (
        "import sys, matplotlib\nmatplotlib.rcParams['font.size'] = 17\n"
        "import mp2a.plot\nfrom test_plot import make_trace\nfrom mp2a.plot.timeline import timeline_figure\n"
        "timeline_figure(make_trace(3))\nassert matplotlib.rcParams['font.size'] == 17\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], cwd="tests", check=True, timeout=120)
