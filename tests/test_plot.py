"""Pictures: what their curves hold is what the files hold, and every situation gives a file worth opening."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.text import Text
from numpy.testing import assert_allclose

from mp2a.cli import main
from mp2a.cost_model import amdahl, karp_flatt
from mp2a.exceptions import InputError, OutputError
from mp2a.plot import latency_figure, save_figure, scaling_figure, speedup_figure, time_figure, timeline_figure
from mp2a.plot.measurements import GRAINS, contenders, runs, series
from mp2a.plot.speedup import PARALLEL_PARTS, speedups
from mp2a.plot.style import spread
from mp2a.plot.timeline import time_shares, trace_messages, trace_spans

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
            "MPI_Scan": cell(2e-6 * crowd, 2e-6 + 1e-6 * n * crowd),
            "MPI_Scan, doubling": cell(3e-6 * crowd, 2e-6 + 1e-6 * rounds * crowd),
            "mp2a.rnea": cell(0.006e-6 * n, 9e-6 + 0.1e-6 * n),
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
            "modelled": None if "modelled" in without or n == 1 else modelled,
            "extrapolated": extrapolated,
            "machine": {"processor": "made up", "cores": cores, "kernels": "compiled"},
            "date": "2026-11-22 10:00:00+0000",
        }
        if "extrapolated" in without:
            del run["extrapolated"]
        out.append(run)
    results = {"format": 2, "runs": out}
    return json.loads(json.dumps(results))


def make_scaling(counts=(1, 2, 4), kinds=("bodies", "bodies_per_rank"), bodies=1000):
    """Results of chains in blocks; half of what a rank does is done by all others as well."""
    out = []
    for kind in kinds:
        for n in counts:
            work = 1e-3 * (1 if kind == "bodies" else n)
            walls = {"sweep": work * (0.5 + 0.5 / n), "compact": 1.3 * work, "mp2a.rnea": 0.8 * work}
            measured = {name: {"single": {"wall": wall, "walls": [wall]}} for name, wall in walls.items()}
            about = {"n": n, "samples": 1, "emulated": None, "oversubscribed": n > 2, "cores": 2, kind: bodies}
            machine = {"processor": "made up", "cores": 2, "kernels": "compiled"}
            out.append(about | {"measured": measured, "machine": machine, "date": "2026-11-22 10:00:00+0000"})
    return {"format": 2, "runs": out}


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
            x, y = panel[name].get_data()
            if len(counts) == 1:  # a row
                assert list(x) == pytest.approx(list(held.values()))
            else:
                assert dict(zip(x, y, strict=True)) == pytest.approx(held)


@pytest.mark.parametrize("period", [0.001, 0.05])
def test_real_time_is_the_trajectory_at_the_control_period(period):
    for panel in lines(time_figure(make_results((2, 8)), period)):
        assert_allclose(panel["real time"].get_ydata(), 2000 * period)
    for panel in lines(time_figure(make_results((8,)), period)):
        assert_allclose(panel["real time"].get_xdata(), 2000 * period)


def test_last_run_of_an_n_counts_and_only_of_its_network_and_samples():
    results = make_results((4, 8))
    again, emulated = make_results((4,), seed=1)["runs"][0], make_results((8,), seed=2)["runs"][0]
    emulated["emulated"] = [0.005, 54e6]
    longer = make_results((16,), samples=3000)["runs"][0]
    results["runs"] = [emulated, longer, *results["runs"], again]
    assert runs(results) == [again, results["runs"][3]]


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
    assert len(trace_spans(trace)) == sum(e["ph"] == "X" for e in trace["traceEvents"])
    assert len(trace_messages(trace)) == sum(e["ph"] == "s" for e in trace["traceEvents"])
    assert all(m.sent <= m.arrived for m in trace_messages(trace))
    assert sum(time_shares(trace_spans(trace)).values()) == pytest.approx(1)
    axes = timeline_figure(trace).axes[0]
    bars = sum(len(c.get_paths()) for c in axes.collections)
    assert bars == len(trace_spans(trace))
    assert len(axes.patches) == (len(trace_messages(trace)) if n <= 32 else 0)


@pytest.mark.parametrize("suffix", MAGIC)
def test_files_are_pictures(tmp_path, suffix):
    folder = tmp_path / "new" / "folder"
    for figure in (time_figure(make_results()), speedup_figure(make_results()), timeline_figure(make_trace(8))):
        written = save_figure(figure, folder / f"picture{suffix}")
        assert written.read_bytes().startswith(MAGIC[suffix])
        assert written.stat().st_size > 5000


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda p: time_figure({"runs": []}), "results: .*expected"),
        (lambda p: time_figure([]), "results: got list"),
        (lambda p: save_figure(time_figure(make_results((4,))), p / "a.bmp"), "path: got 'a.bmp', expected"),
        (lambda p: time_figure(make_results((4,)), period=0), "period: got 0"),
        (lambda p: speedup_figure(make_results((4,)), against="magic"), "against: got 'magic', expected"),
        (lambda p: timeline_figure({}), "trace: .*expected"),
        (lambda p: timeline_figure({"traceEvents": []}), "trace: got no spans"),
        (lambda p: latency_figure(make_results((4,))), "results: got no run over an emulated network"),
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
        "from mp2a.plot import timeline_figure\nfrom test_plot import make_trace\n"
        "timeline_figure(make_trace(3))\nassert matplotlib.rcParams['font.size'] == 17\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], cwd="tests", check=True, timeout=120)


# ---- a reader can tell what is what ------------------------------------------------------------------------------


def make_latencies(latencies=(0.005,), counts=(4, 8), cores=2):
    """Results over emulated networks, one sample at a time."""
    out = []
    for latency in latencies:
        for run in make_results(counts, cores, samples=1)["runs"]:
            rounds = int(np.ceil(np.log2(run["n"])))
            fewest = {"kogge-stone": 3 * rounds, "compact": 2 * rounds, "sweep": rounds}
            run["measured"] = {who: cell for who, cell in run["measured"].items() if cell}
            for who, cell in run["measured"].items():
                cell["single"]["wall"] = latency * fewest.get(who, run["n"]) * 1.1 if who != "pinocchio" else 1e-6
                del cell["batch"]
            run |= {"emulated": [latency, 54e6], "methods": {who: {"rounds": k} for who, k in fewest.items()}}
            out.append(run)
    return {"format": 2, "runs": out}


def texts(figure):
    """All that is written in a figure where readers look for it: legends, titles, labels, numbers; and its box."""
    figure.draw_without_rendering()
    found = [text for legend in figure.legends for text in (legend.get_title(), *legend.get_texts())]
    found += figure.texts
    for axes in figure.axes:
        found += [axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label, *axes.texts]
        for axis in (axes.xaxis, axes.yaxis):
            found += [label for label in axis.get_majorticklabels() if within(axis, label)]
    shown = [text for text in found if text.get_text().strip() and text.get_visible()]
    return [(text.get_text(), Text.get_window_extent(text)) for text in shown]  # without the lines of annotations


def within(axis, label):
    """Whether a tick's label is within the limits of its axis."""
    low, high = sorted(axis.get_view_interval())
    return low <= label.get_position()[axis.axis_name == "y"] <= high


def assert_legible(figure):
    """Nothing is cut off, and no two texts overlap."""
    written = texts(figure)
    for text, box in written:
        assert box.x0 > -1 and box.y0 > -1, text
        assert box.x1 < figure.bbox.width + 1 and box.y1 < figure.bbox.height + 1, text
    for k, (text, box) in enumerate(written):
        for other, beside in written[:k]:
            wide = min(box.x1, beside.x1) - max(box.x0, beside.x0)
            tall = min(box.y1, beside.y1) - max(box.y0, beside.y0)
            assert wide < 1 or tall < 2, (text, other)


FIGURES = {
    "time of one n": lambda: time_figure(make_results((8,))),
    "time of the paper's n": lambda: time_figure(make_results((512,))),
    "time of four n": lambda: time_figure(make_results((1, 2, 4, 8))),
    "time": lambda: time_figure(make_results()),
    "speedup of one n": lambda: speedup_figure(make_results((8,))),
    "speedup of four n": lambda: speedup_figure(make_results((1, 2, 4, 8))),
    "speedup": lambda: speedup_figure(make_results()),
    "one latency, one n": lambda: latency_figure(make_latencies(counts=(8,))),
    "one latency": lambda: latency_figure(make_latencies()),
    "latencies": lambda: latency_figure(make_latencies((0.001, 0.005, 0.02), (8, 16, 512))),
    "latencies of one n": lambda: latency_figure(make_latencies((0.001, 0.005, 0.02), (8,))),
    "timeline": lambda: timeline_figure(make_trace(8)),
    "scaling": lambda: scaling_figure(make_scaling()),
    "strong scaling": lambda: scaling_figure(make_scaling((1, 2), ["bodies"], 100_000)),
}


@pytest.mark.parametrize("name", FIGURES)
def test_nothing_is_cut_off_or_overprinted(name):
    assert_legible(FIGURES[name]())


@pytest.mark.parametrize("counts", [(1, 2, 4, 8), (3, 5, 24), EVERY_N])
def test_the_axis_of_robots_ends_where_the_data_end(counts):
    for figure in (time_figure(make_results(counts)), speedup_figure(make_results(counts))):
        for axes in figure.axes:
            low, high = axes.get_xlim()
            assert counts[0] / 1.4 < low < counts[0] and counts[-1] < high < counts[-1] * 1.4
            ticks = [float(tick) for tick in axes.get_xticks()]
            assert set(ticks) <= set(counts) and counts[-1] in ticks
            assert ("paper" in {str(line.get_gid()).split()[0] for line in axes.lines}) == (512 in counts)


def test_scaling_curves_are_the_results_beside_the_ideal():
    results = make_scaling()
    strong, weak = scaling_figure(results).axes
    for axes, runs_of, ideal in (
        (strong, results["runs"][:3], [1, 1 / 2, 1 / 4]),
        (weak, results["runs"][3:], [1, 1, 1]),
    ):
        drawn = {line.get_gid(): line for line in axes.lines if line.get_gid()}
        for name in ("sweep", "compact", "mp2a.rnea"):
            walls = [run["measured"][name]["single"]["wall"] for run in runs_of]
            assert_allclose(drawn[name].get_ydata(), walls)
        assert_allclose(drawn["ideal"].get_ydata(), 1e-3 * np.array(ideal))
    for figure in (time_figure, speedup_figure):
        with pytest.raises(InputError, match="which mp2a plot scaling draws"):
            figure(results)
    assert [run["n"] for run in runs({"runs": make_results((2, 8))["runs"] + results["runs"]})] == [2, 8]
    for file in (make_results(), {"runs": []}):
        with pytest.raises(InputError, match="expected some of mp2a bench --bodies"):
            scaling_figure(file)


def test_one_number_of_robots_gives_a_row_for_each_curve_with_its_value():
    results = make_results((8,))
    left, right = time_figure(results).axes
    for axes, grain in ((left, "batch"), (right, "single")):
        wall = results["runs"][0]["measured"]["sweep"][grain]["wall"] * 2000
        [row] = [line.get_ydata()[0] for line in axes.lines if line.get_gid() == "measured sweep"]
        [number] = [text for text in axes.texts if text.xy == (pytest.approx(wall), row)]
        value, _, unit = number.get_text().partition(" ")
        assert float(value) * {"s": 1, "ms": 1e-3, "µs": 1e-6}[unit] == pytest.approx(wall, rel=0.005)
    rows = dict(zip(left.get_yticks(), [label.get_text() for label in left.get_yticklabels()], strict=True))
    assert rows[row] == "sweep"
    assert {"measured, wall clock", "modelled, eq. 13"} <= set(rows.values())


@pytest.mark.parametrize("figure", [time_figure, speedup_figure])
def test_pictures_say_where_the_numbers_come_from(figure):
    for counts in ((8,), (4, 8)):
        written = [text for text, _ in texts(figure(make_results(counts)))]
        assert "measured on made up, 2 cores; 2026-11-22" in written
        assert any("measured, wall clock" in text or ", measured: S" in text for text in written)
        assert any("extrapolated" in text for text in written)
    slow = make_results((4, 8))
    slow["runs"][0] |= {"date": "2026-11-20 10:00:00+0000"}
    slow["runs"][0]["machine"] |= {"kernels": "numpy (no compiler)"}
    expected = (
        "measured on made up, 2 cores, kernels: numpy (no compiler) and on made up, 2 cores; 2026-11-20 to 2026-11-22"
    )
    assert expected in [text for text, _ in texts(figure(slow))]


def test_a_timeline_says_which_processor_it_is_of():
    trace = make_trace(3)
    trace["mp2a"]["machine"] = {"processor": "made up", "cores": 2}
    assert "measured on made up, 2 cores" in [text for text, _ in texts(timeline_figure(trace))]


def test_networks_of_one_latency_are_told_apart():
    results = make_latencies()
    results["runs"] += [run | {"emulated": [0.005, 6e6]} for run in results["runs"]]
    assert [axes.get_title() for axes in latency_figure(results).axes] == ["5 ms, 6 Mbit/s", "5 ms, 54 Mbit/s"]


def test_what_latency_alone_takes_has_the_colour_of_its_method():
    [axes] = latency_figure(make_latencies()).axes
    drawn = {line.get_gid(): line for line in axes.lines}
    for who, rounds in (("kogge-stone", 3), ("compact", 2), ("sweep", 1)):
        assert_allclose(drawn[f"floor {who}"].get_ydata(), [2 * rounds * 0.005, 3 * rounds * 0.005])
        assert drawn[f"floor {who}"].get_color() == drawn[who].get_color()


# ---- files -------------------------------------------------------------------------------------------------------


@pytest.fixture
def results_file(tmp_path):
    path = tmp_path / "bench.json"
    path.write_text(json.dumps(make_results((4,))))
    return path


def test_a_picture_is_named_after_what_it_shows(results_file, capsys):
    other = results_file.with_name("other.json")
    other.write_bytes(results_file.read_bytes())
    for file in (results_file, other):
        assert main(["plot", "time", str(file)]) == 0
        assert capsys.readouterr().out.strip() == str(file.with_name(f"{file.stem}-time.png"))
    assert len(list(results_file.parent.glob("*.png"))) == 2


def test_a_full_disk_leaves_the_old_picture(results_file, monkeypatch, capsys):
    out = results_file.with_name("bench-time.png")
    out.write_text("old")
    monkeypatch.setattr("mp2a.plot.style.Figure.savefig", no_space)
    assert main(["plot", "time", str(results_file)]) == 2
    assert "bench-time.png: cannot be written (No space left on device)" in capsys.readouterr().err
    assert sorted(path.name for path in results_file.parent.iterdir()) == ["bench-time.png", "bench.json"]
    assert out.read_text() == "old"


def no_space(*arguments, **options):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_no_device_link_or_pipe_becomes_a_file(tmp_path):
    figure = timeline_figure(make_trace(2))
    (tmp_path / "null.png").symlink_to("/dev/null")
    (tmp_path / "link.png").symlink_to(tmp_path / "real.png")
    os.mkfifo(tmp_path / "pipe.png")
    reader = subprocess.Popen(["wc", "-c", tmp_path / "pipe.png"], stdout=subprocess.PIPE, text=True)
    for name in ("null", "link", "pipe"):
        save_figure(figure, tmp_path / f"{name}.png")
    assert int(reader.communicate(timeout=60)[0].split()[0]) > 5000
    assert (tmp_path / "null.png").resolve() == Path("/dev/null") and not Path("/dev/null").is_file()
    assert (tmp_path / "link.png").is_symlink() and (tmp_path / "real.png").stat().st_size > 5000
    assert (tmp_path / "pipe.png").is_fifo()
    (tmp_path / "full.png").symlink_to("/dev/full")
    with pytest.raises(OutputError, match=r"full\.png: cannot be written \(No space left on device\)"):
        save_figure(figure, tmp_path / "full.png")


def test_the_device_of_nothing_is_refused_by_name(results_file, capsys):
    assert main(["plot", "time", str(results_file), "--out", "/dev/null"]) == 2
    assert "path: got 'null', expected a name that ends in .png, .svg, .pdf" in capsys.readouterr().err
    assert not Path("/dev/null").is_file()
