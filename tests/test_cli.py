"""The command line: every subcommand runs, and what is wrong is said without a traceback."""

import json
import subprocess
import sys

import pytest

from mp2a import cli, launch
from mp2a.bench import results


def mp2a(*arguments, expect=0):
    """Run the command in a process of its own, as users do."""
    program = [sys.executable, "-m", "mp2a", *map(str, arguments)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == expect, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A short real benchmark of 1 and 3 robots, and what it printed."""
    path = tmp_path_factory.mktemp("bench") / "deep" / "bench.json"
    options = ["bench", "--ranks", "1,3", "--samples", 20, "--repeats", 2, "--seconds", 1, "--out", path]
    return path, mp2a(*options).stdout, options


def test_bench_keeps_and_prints_what_it_measured(bench):
    path, printed, _ = bench
    runs = results.load(path)["runs"]
    assert [run["n"] for run in runs] == [1, 3]
    for run in runs:
        for facts in run["methods"].values():
            assert facts["sent"]["messages"] == facts["messages"]
            assert facts["sent"]["bytes"] == facts["bytes"]
            assert facts["error"]["relative"] < 1e-12
            assert facts["error"]["against"] == "pinocchio"
        for contender in ("kogge-stone", "compact", "sweep", "pipeline", "gather-scatter", "pinocchio"):
            for size in ("batch", "single"):
                assert run["measured"][contender][size]["wall"] > 0
        assert run["started_s"] > 0
        assert run["memory"]["proportional_total"] > 0
    for word in ("measured", "modelled", "extrapolated", "kogge-stone", "oversubscribed", str(path)):
        assert word in printed
    assert {"processor", "cores", "packages", "date"} <= results.load(path)["machine"].keys()


def test_bench_goes_on_where_it_was(bench):
    path, _, options = bench
    before = path.read_bytes()
    assert "kept in" in mp2a(*options).stdout
    assert path.read_bytes() == before


@pytest.mark.parametrize("picture", ["time", "speedup"])
def test_plots_of_a_bench(bench, picture):
    path, _, _ = bench
    out = path.with_name(f"{picture}.png")
    assert mp2a("plot", picture, path).stdout.strip() == str(out)
    assert out.stat().st_size > 5000


def test_bench_over_an_emulated_network(tmp_path):
    path = tmp_path / "bench.json"
    short = ["--samples", 1, "--repeats", 1, "--seconds", 1]
    mp2a("bench", "--ranks", 2, *short, "--network", "20ms,54Mbit", "--out", path)
    run = results.load(path)["runs"][0]
    assert run["emulated"] == [0.02, 54e6]
    walls = {name: times["single"]["wall"] for name, times in run["measured"].items()}
    # No call is over before its messages can have come. Two outward scans of kogge-stone overlap between two robots.
    assert walls["sweep"] >= 0.02
    assert walls["compact"] >= 0.04
    assert walls["kogge-stone"] >= 0.04
    assert walls["pipeline"] >= 0.04
    assert walls["gather-scatter"] >= 0.04


def test_bench_under_mpirun(tmp_path):
    path = tmp_path / "bench.json"
    program = [sys.executable, "-m", "mp2a", "bench", "--samples", "5", "--repeats", "1", "--out", str(path)]
    done = launch.run(2, program, timeout=120, stdout=subprocess.PIPE, text=True)
    assert done.returncode == 0
    assert done.stdout.count("kept in") == 1
    assert results.load(path)["runs"][0]["n"] == 2
    done = launch.run(2, [*program, "--ranks", "2"], timeout=120, stderr=subprocess.PIPE, text=True)
    assert done.returncode != 0
    assert done.stderr.count("mp2a: error: --ranks: given under mpirun") == 1


def test_trace_and_its_timeline(tmp_path):
    path = tmp_path / "trace.json"
    mp2a("trace", "--ranks", 2, "--samples", 3, "--method", "sweep", "--out", path)
    assert json.loads(path.read_text())["mp2a"] == {"n": 2, "samples": 3, "method": "sweep"}
    mp2a("plot", "timeline", path, "--out", tmp_path / "timeline.svg")
    assert (tmp_path / "timeline.svg").exists()


def test_cost_prints_both_counts():
    printed = mp2a("cost", "--n", "8,512").stdout
    assert "table I" in printed
    assert "modelled" in printed
    assert "464100" in printed


@pytest.mark.parametrize("method", ["kogge-stone", "compact", "sweep", "pipeline"])
def test_schedule_is_printed(method):
    assert "1→2" in mp2a("schedule", "--n", 4, "--method", method).stdout


@pytest.mark.parametrize("command", [(), ("bench",), ("plot",), ("cost",), ("schedule",), ("trace",)])
def test_help_has_examples(command):
    printed = mp2a(*command, "--help").stdout
    assert "usage: mp2a" in printed
    assert not command or "examples:" in printed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bench", "--ranks", "0"], "got '0', expected a whole number"),
        (["bench", "--ranks", "two"], "got 'two'"),
        (["bench", "--ranks", "2", "--methods", "magic"], "got 'magic', expected one of"),
        (["bench", "--network", "fast"], "expected latency and bandwidth"),
        (["bench", "--latency", "-1"], "expected a positive number"),
        (["plot", "time", "nothing.json"], "nothing.json cannot be read"),
        (["plot", "timeline", "nothing.json"], "nothing.json cannot be read"),
        (["schedule", "--method", "magic"], "got 'magic', expected one of"),
        (["trace", "--ranks", "2", "--method", "magic"], "got 'magic', expected one of"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, arguments, message):
    where = ["--out", tmp_path / "x.json"] if arguments[0] in ("bench", "trace") else []
    assert message in mp2a(*arguments, *where, expect=2).stderr


def test_a_results_file_of_another_kind_is_refused_before_measuring(tmp_path):
    path = tmp_path / "other.json"
    path.write_text("[1, 2]")
    assert "no results file" in mp2a("bench", "--ranks", 1, "--out", path, expect=2).stderr
    assert path.read_text() == "[1, 2]"


def test_an_interruption_keeps_what_was_measured(tmp_path, monkeypatch, capsys):
    from mp2a.bench import sweep

    path, measured = tmp_path / "bench.json", iter([{"n": 1}, KeyboardInterrupt()])

    def run(n, settings, say):
        result = next(measured)
        if isinstance(result, BaseException):
            raise result
        return result

    monkeypatch.setattr(sweep, "_run", run)
    assert cli.main(["bench", "--ranks", "1,2", "--out", str(path)]) == 130
    assert "kept" in capsys.readouterr().err
    assert results.load(path)["runs"] == [{"n": 1}]
