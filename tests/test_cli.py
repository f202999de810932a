"""The command line: every subcommand runs, and what is wrong is said without a traceback."""

import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mp2a import cli, launch
from mp2a.bench import results
from mp2a.bench.contenders import LABELS
from mp2a.bench.machine import kernels_in_use


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
        left_out = {name for name in LABELS if any(line.startswith(name) for line in run["missing"])}
        assert run["measured"].keys() | left_out == set(LABELS)
        for sizes in run["measured"].values():
            for size in ("batch", "single"):
                assert sizes[size]["wall"] > 0
        assert run["started_s"] > 0
        assert run["memory"]["proportional_total"] > 0
    for word in ("measured", "modelled", "extrapolated", "kogge-stone", "take turns on", str(path)):
        assert word in printed
        assert {"host", "processor", "cores", "packages"} <= run["machine"].keys()
        assert run["machine"]["kernels"] == kernels_in_use()
        assert run["date"]


def test_bench_tables_fit_and_hold_no_codes(bench):
    _, printed, _ = bench
    assert max(map(len, printed.splitlines())) <= 80
    assert "\x1b" not in printed


def test_bench_measures_again_unless_it_is_to_resume(bench, tmp_path):
    path, printed, options = bench
    path = shutil.copy(path, tmp_path / "bench.json")
    options = [*options[:-1], path]
    assert "Not measured now" not in printed
    before = path.read_bytes()
    printed = mp2a(*options, "--resume").stdout
    assert path.read_bytes() == before
    run = results.load(path)["runs"][0]
    where = f"Not measured now: n = 1 is from {path}, measured {run['date']} on {run['machine']['host']}"
    assert where.split() == printed[printed.index("Not measured") :].split()[: len(where.split())]
    other = results.load(path)
    for run in other["runs"]:
        run["machine"]["processor"] = "another"
    results.write_json(path, other)
    options[options.index("1,3")] = "1"
    assert "Not measured now" not in mp2a(*options, "--resume").stdout
    assert "Not measured now" not in mp2a(*options).stdout
    assert [run["n"] for run in results.load(path)["runs"]] == [1, 3, 1, 1]


@pytest.mark.parametrize("style", ["csv", "json", "markdown"])
def test_bench_in_other_formats(bench, style):
    path, _, options = bench
    printed = mp2a(*options, "--resume", "--format", style).stdout
    runs = results.load(path)["runs"]
    wall = runs[0]["measured"]["sweep"]["single"]["wall"]
    if style == "json":
        rows = json.loads(printed)["tables"][1]["rows"]
        [row] = [row for row in rows if (row["contender"], row["samples a message"]) == ("sweep", 1)]
        assert row["n = 1, s"] == wall
    elif style == "csv":
        measured = printed.split("\n\n")[1].splitlines()
        assert measured[0].startswith("# measured")
        rows = list(csv.DictReader(measured[1:]))
        assert len(rows) == 2 * len(runs[0]["measured"])
        assert float(rows[2]["n = 1, s"]) == wall
    else:
        assert printed.count("| --- |") + printed.count("| ---: |") >= 3


def test_bench_compares_two_files(bench, tmp_path):
    path, _, _ = bench
    later = results.load(path)
    [first, second] = later["runs"]
    for sizes in first["measured"].values():
        for times in sizes.values():
            times["walls"] = [2 * wall for wall in times["walls"]]
    second["n"] = 4
    first["machine"]["processor"] = "another"
    results.write_json(tmp_path / "later.json", later)
    printed = mp2a("bench", "--compare", path, tmp_path / "later.json").stdout
    assert max(map(len, printed.splitlines())) <= 80
    assert "NOT the same processor" in printed
    assert "Only in A: n = 3" in printed
    assert "Only in B: n = 4" in printed
    tables = json.loads(mp2a("bench", "--compare", path, tmp_path / "later.json", "--format", "json").stdout)["tables"]
    assert [row["contender"] for row in tables[0]["rows"]] == [name for name in LABELS if name in first["measured"]]
    for row in tables[0]["rows"]:
        low, middle, high = (
            row[f"B / A, one sample at a time{what}"] for what in (", lower quartile", "", ", upper quartile")
        )
        assert low <= middle <= high
        assert low <= 2 <= high
    printed = mp2a("bench", "--compare", path, path).stdout
    assert "NOT" not in printed
    assert "same kind of processor" in printed
    second["n"] = 5
    results.write_json(tmp_path / "later.json", later | {"runs": [second]})
    nothing = mp2a("bench", "--compare", path, tmp_path / "later.json", expect=2).stderr
    assert "without a run of the same n and settings" in nothing


def test_what_was_measured_is_printed_where_it_cannot_be_kept(tmp_path):
    done = mp2a("bench", "--ranks", 1, "--samples", 1, "--repeats", 1, "--out", "/dev/full", expect=2)
    assert done.stderr == "mp2a: error: /dev/full: cannot be written (No space left on device)\n"
    (tmp_path / "saved.json").write_text(done.stdout)
    assert [run["n"] for run in results.load(tmp_path / "saved.json")["runs"]] == [1]
    done = mp2a("trace", "--ranks", 1, "--out", "/dev/full", expect=2)
    assert "No space left on device" in done.stderr
    assert json.loads(done.stdout)["mp2a"]["n"] == 1


def test_where_nothing_can_be_kept_nothing_is_measured(tmp_path):
    (tmp_path / "file").write_text("")
    inside = tmp_path / "file" / "bench.json"
    for command in ("bench", "trace"):
        done = mp2a(command, "--ranks", 1, "--out", inside, expect=2)
        assert done.stderr == f"mp2a: error: {inside}: cannot be written (Not a directory: {inside.parent})\n"
        assert not done.stdout


def test_a_device_stays_a_device():
    before = Path("/dev/null").stat()
    mp2a("bench", "--ranks", 1, "--samples", 1, "--repeats", 1, "--out", "/dev/null")
    assert Path("/dev/null").stat()[:3] == before[:3]


def test_processes_that_append_to_one_file_lose_nothing(tmp_path):
    path = tmp_path / "bench.json"
    code = """import sys
from mp2a.bench import results
for k in range(100):
    results.append(sys.argv[1], {"n": k + 1, "by": sys.argv[2]})"""
    processes = [subprocess.Popen([sys.executable, "-c", code, str(path), str(k)]) for k in range(3)]
    assert [process.wait(120) for process in processes] == [0, 0, 0]
    runs = results.load(path)["runs"]
    assert len(runs) == 300
    assert all([run["n"] for run in runs if run["by"] == str(k)] == list(range(1, 101)) for k in range(3))
    assert [path.name for path in tmp_path.iterdir()] == ["bench.json"]


@pytest.mark.parametrize("picture", ["time", "speedup"])
def test_plots_of_a_bench(bench, picture):
    path, _, _ = bench
    out = path.with_name(f"{path.stem}-{picture}.png")
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


def test_bench_of_a_chain_in_blocks(tmp_path):
    path = tmp_path / "scaling.json"
    short = ["--repeats", 1, "--seconds", 1, "--methods", "sweep", "--out", path]
    printed = mp2a("bench", "--ranks", "1,2", "--bodies", 7, *short).stdout
    assert "strong scaling, 7 bodies: measured" in printed
    assert "pipeline is left out: it has one body a rank" in printed
    mp2a("bench", "--ranks", 2, "--bodies-per-rank", 3, "--samples", 4, "--baselines", "mp2a.rnea", *short)
    *strong, weak = results.load(path)["runs"]
    assert [(run["n"], run["bodies"], run["samples"]) for run in strong] == [(1, 7, 1), (2, 7, 1)]
    assert (weak["bodies_per_rank"], weak["samples"], weak["missing"]) == (3, 4, [])
    assert weak["measured"].keys() == {"sweep", "mp2a.rnea"}
    for run in (*strong, weak):
        assert run["methods"]["sweep"]["error"]["relative"] < 1e-12
        assert run["methods"]["sweep"]["sent"]["messages"] == run["methods"]["sweep"]["messages"]
    mp2a("plot", "scaling", path)
    assert (tmp_path / "scaling-scaling.png").stat().st_size > 5000


def test_bench_under_mpirun(tmp_path):
    path = tmp_path / "bench.json"
    program = [sys.executable, "-m", "mp2a", "bench", "--samples", "5", "--repeats", "1", "--out", str(path)]
    done = launch.run(2, program, timeout=120, stdout=subprocess.PIPE, text=True)
    assert done.returncode == 0
    assert done.stdout.count("Kept in") == 1
    assert results.load(path)["runs"][0]["n"] == 2
    done = launch.run(2, [*program, "--ranks", "2"], timeout=120, stderr=subprocess.PIPE, text=True)
    assert done.returncode != 0
    assert done.stderr.count("mp2a: error: --ranks: given under mpirun") == 1


def test_a_full_disk_under_mpirun(tmp_path):
    program = [sys.executable, "-m", "mp2a", "bench", "--samples", "1", "--repeats", "1", "--out"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    done = launch.run(2, [*program, "/dev/full"], timeout=120, **pipes)
    assert done.returncode != 0
    assert done.stderr.count("mp2a: error: /dev/full: cannot be written (No space left on device)") == 1
    assert "Traceback" not in done.stderr
    (tmp_path / "saved.json").write_text(done.stdout)
    assert results.load(tmp_path / "saved.json")["runs"][0]["n"] == 2
    done = launch.run(2, [*program, str(tmp_path)], timeout=120, **pipes)
    assert done.returncode != 0
    assert done.stderr.count(f"mp2a: error: --out: {tmp_path}: cannot be written (Is a directory)") == 1
    assert "Traceback" not in done.stderr


def test_trace_and_its_timeline(tmp_path):
    path = tmp_path / "trace.json"
    printed = mp2a("trace", "--ranks", 2, "--samples", 3, "--method", "sweep", "--out", path).stdout
    assert "load balance" in printed
    about = json.loads(path.read_text())["mp2a"]
    assert about.pop("machine")["cores"] >= 1
    assert about == {"n": 2, "samples": 3, "method": "sweep"}
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


@pytest.mark.parametrize("arguments", [("cost", "--n", "8,512"), ("schedule", "--n", 40)])
def test_tables_fit_and_come_in_other_formats(arguments):
    printed = mp2a(*arguments).stdout
    assert max(map(len, printed.splitlines())) <= 80
    assert "\x1b" not in printed
    assert "| --- |" in mp2a(*arguments, "--format", "markdown").stdout
    written = json.loads(mp2a(*arguments, "--format", "json").stdout)["tables"]
    lines = mp2a(*arguments, "--format", "csv").stdout.splitlines()
    rows = list(csv.DictReader(lines[1 : 1 + 1 + len(written[0]["rows"])]))
    assert rows == [{name: str(value) for name, value in row.items()} for row in written[0]["rows"]]


def test_a_schedule_as_csv_has_a_line_a_message():
    lines = mp2a("schedule", "--n", 5, "--method", "pipeline", "--format", "csv").stdout.splitlines()
    assert lines[1:] == [
        "recurrence,round,kind,from,to",
        *(f"motion,{k},motion,{k},{k + 1}" for k in range(1, 5)),
        *(f"force,{k},force,{6 - k},{5 - k}" for k in range(1, 5)),
    ]


@pytest.mark.parametrize("command", [(), *((name,) for name in cli.COMMANDS)])
def test_help_has_examples(command):
    printed = mp2a(*command, "--help").stdout
    assert "usage: mp2a" in printed
    assert f"examples:\n  mp2a {' '.join(command)}" in printed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bench", "--ranks", "0"], "got '0', expected a whole number"),
        (["bench", "--ranks", "two"], "got 'two'"),
        (["bench", "--ranks", "2", "--methods", "magic"], "got 'magic', expected one of"),
        (["bench", "--compare", "nothing.json", "none.json"], "nothing.json cannot be read"),
        (["bench", "--compare", "a.json", "b.json", "--ranks", "2"], "--compare: given with --ranks"),
        (["bench", "--baselines", "pipeline,magic"], "--baselines: got magic, expected some of MPI_Scan,pipeline"),
        (["bench", "--ranks", "2,8", "--bodies", "7"], "--bodies: got 7, expected at least the 8 of --ranks"),
        (["bench", "--bodies", "7", "--bodies-per-rank", "7"], "not allowed with argument"),
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
    assert "other.json is no file of results" in mp2a("bench", "--ranks", 1, "--out", path, expect=2).stderr
    assert path.read_text() == "[1, 2]"


def test_an_interruption_keeps_what_was_measured(tmp_path, monkeypatch, capsys):
    from mp2a.bench import campaign

    path, measured = tmp_path / "bench.json", iter([{"n": 1}, KeyboardInterrupt()])

    def run(n, settings, say):
        result = next(measured)
        if isinstance(result, BaseException):
            raise result
        return result

    monkeypatch.setattr(campaign, "_measure", run)
    assert cli.main(["bench", "--ranks", "1,2", "--out", str(path)]) == 130
    assert "kept" in capsys.readouterr().err
    assert results.load(path)["runs"] == [{"n": 1}]
