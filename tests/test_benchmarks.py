"""The benchmark scripts run, and what they count and compare is right; how fast anything is, no test says."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import relative_error

import mp2a
from mp2a import Model, kernels
from mp2a.bench.costs import ComputeCosts
from mp2a.bench.simulated import CONTENDERS
from mp2a.methods import METHODS

RECURRENCES = ("velocity", "acceleration", "motion", "force", "sweep")
SCRIPTS = Path(__file__).parents[1] / "benchmarks"

pytestmark = pytest.mark.skipif(not kernels.status().compiled, reason="no compiled kernels here")


@pytest.fixture
def scripts(monkeypatch):
    """Folder of the scripts, from which they import each other."""
    monkeypatch.syspath_prepend(SCRIPTS)


def run(script, out, *arguments):
    """Run a script; what it printed and wrote."""
    command = [
        sys.executable,
        str(SCRIPTS / script),
        "--repeats",
        "2",
        "--out",
        str(out),
        "--format",
        "markdown",
        *arguments,
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout, json.loads(out.read_text())


def tables(text):
    """Rows of cells of all Markdown tables in a text."""
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]


def test_aba(tmp_path):
    printed, written = run(
        "aba.py", tmp_path / "aba.json", "--n", "2,3", "--samples", "20", "--one", "2", "--long", "9"
    )
    assert {row[0] for row in tables(printed)} > {"2", "3", "9"}
    assert [len(run["seconds"]) for run in written["batch"]] == [6, 6]


def test_batch(tmp_path):
    printed, written = run("batch.py", tmp_path / "batch.json", "--n", "2,3", "--samples", "20", "--joints", "--others")
    assert {row[0] for row in tables(printed)} > {"2", "3", "revolute", "free", "revolute, tree"}
    for found in written["runs"]:
        assert len(found["seconds"]) == 13
        assert all(len(times) == 2 and min(times) > 0 for times in found["seconds"].values())
        assert all(error <= (1e-4 if "float32" in name else 1e-13) for name, error in found["errors"].items())


def test_some_contenders_only(tmp_path):
    printed, written = run("batch.py", tmp_path / "batch.json", "--n", "3", "--contenders", "columns,rows")
    assert list(written["runs"][0]["seconds"]) == ["rows", "columns"]
    assert "pinocchio" not in printed


def test_unknown_contender(tmp_path):
    command = [sys.executable, str(SCRIPTS / "batch.py"), "--contenders", "rows,wheels"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "wheels" in done.stderr
    assert "Traceback" not in done.stderr


def test_long(tmp_path):
    printed, written = run("long.py", tmp_path / "long.json", "--n", "4,9000")
    assert [row[0] for row in tables(printed)[2:]] == ["4", "9000"]
    assert set(written["seconds"]) == {"1 4", "pinocchio 4", "1 9000", "2 9000"}
    assert (tmp_path / "long.png").stat().st_size > 10_000


def test_single(tmp_path):
    printed, written = run("single.py", tmp_path / "single.json", "--n", "2,3")
    assert {row[0] for row in tables(printed)} == {"model", "---", "2 joints", "3 joints"}
    assert all(len(found["seconds"]) == 7 for found in written["runs"])


def test_placements(tmp_path):
    printed, written = run("placements.py", tmp_path / "placements.json", "--n", "2,3", "--samples", "20")
    assert {"2", "3"} < {row[0] for row in tables(printed)}
    assert all(len(found["seconds"]) == 6 for found in written["runs"])


def test_busy(tmp_path):
    _, written = run("busy.py", tmp_path / "busy.json", "--n", "2", "--samples", "20", "--neighbours", "0", "1")
    assert [found["neighbours"] for found in written["runs"]] == [0, 1]
    assert all(len(turns) == 2 for found in written["runs"] for turns in found["seconds"].values())


def test_roofline(tmp_path):
    _, written = run("roofline.py", tmp_path / "roofline.json", "--n", "2,4", "--samples", "50")
    assert all(set(found["seconds"]) == set(written["counts"]) for found in written["runs"])
    # A layout is a matter of shuffles and not of arithmetic.
    for detail in ("", " bodies"):
        rows, columns = (dict(written["counts"][name + detail]) for name in ("rows", "columns"))
        del rows["transposition"]
        assert rows == columns
    assert (tmp_path / "roofline.png").stat().st_size > 10_000


def test_kernels(tmp_path):
    printed, written = run("kernels.py", tmp_path / "kernels.json")
    assert len(tables(printed)) == 2 + len(written["runs"])
    assert all(min(run["seconds"]["compiled"]) > 0 for run in written["runs"])


def test_rounds(tmp_path):
    printed, written = run("rounds.py", tmp_path / "rounds.json")
    assert [row[0] for row in tables(printed)[2:]] == list(METHODS)
    assert all({"ours", "interpreted", "bare, new"} < set(run["seconds"]) for run in written["runs"])


def test_mpi_scan(tmp_path):
    printed, written = run(
        "mpi_scan.py", tmp_path / "mpi_scan.json", "--ranks", "2", "--samples", "3", "--seconds", "0.5"
    )
    [measured] = written["runs"]
    heading, _, *rows = tables(printed)
    assert heading[2:-1] == list(measured["measured"])
    assert [row[:2] for row in rows] == [["2", "1"], ["2", "3"]]
    scans = [name for name in measured["measured"] if name.startswith("MPI_Scan")]
    assert all(("×" in row[-1]) == bool(scans) for row in rows)


def test_latency(tmp_path):
    printed, written = run(
        "latency.py", tmp_path / "latency.json", "--ranks", "2", "--latencies", "1", "--seconds", "1"
    )
    assert tables(printed)[2][:3] == ["1 ms", "54", "2"]
    assert [run["emulated"] for run in written["runs"]] == [[1e-3, 54e6]]


@pytest.mark.skipif(shutil.which("smpirun") is None, reason="smpirun of SimGrid is not installed")
def test_simulate(tmp_path):
    out, costs = tmp_path / "simulated.json", tmp_path / "costs.json"
    alike = ComputeCosts(*2 * [dict.fromkeys(RECURRENCES, 1e-6)], 1e-6)._asdict()
    costs.write_text(json.dumps({"1": {name: 1e-6 if name == "gather-scatter" else alike for name in CONTENDERS}}))
    command = [sys.executable, str(SCRIPTS / "simulate.py"), "--n", "8", "--samples", "1", "--networks", "radio"]
    command += ["--costs", str(costs), "--out", str(out), "--format", "markdown"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert [row[:3] for row in tables(done.stdout)[2:]] == [["slow radio mesh", "1", "8"]]
    assert out.with_suffix(".png").stat().st_size > 10_000


def test_instructions_are_counted(scripts):
    import llvmlite.binding as llvm

    if not llvm.get_host_cpu_features().get("fma"):
        pytest.skip("this processor has other instructions")
    from counts import Count, chains, formula

    from mp2a.kernels import algebra

    assert formula(lambda a, b, c: a * b + c, 1, 1, 1) == Count(fused=1)
    assert formula(lambda a, b: a * b, 1, 1) == Count(products=1)
    assert formula(lambda a, b: a + b, 1, 1) == Count(sums=1)
    assert formula(algebra.cross, 3, 3) == Count(fused=3, products=3)
    assert formula(algebra.apply, 9, 3) == Count(fused=6, products=3)
    assert all(0 < links < 30 for links in chains())


def test_ratios_are_those_of_neighbours(scripts):
    from measure import Contender, ratio, take_turns

    assert ratio({"slow": [2.0, 30.0, 8.0], "fast": [1.0, 10.0, 2.0]}, "slow", "fast").median == 3.0
    called = {"one": 0, "two": 0}

    def count(name):
        called[name] += 1

    times = take_turns({name: Contender(lambda name=name: count(name), 4) for name in called}, 3)
    assert all(len(found) == 3 for found in times.values())
    assert min(called.values()) > 3


def test_other_libraries_get_the_same_chain(scripts, tmp_path):
    from others import urdf

    model = Model.random(7, seed=3, branching=2)
    (tmp_path / "chain.urdf").write_text(urdf(model))
    read = Model.from_urdf(tmp_path / "chain.urdf")
    state = model.random_state(5)
    order = np.argsort(read.names)
    q, v, a = (x[:, [int(name.removeprefix("joint")) for name in read.names]] for x in state)
    assert relative_error(mp2a.rnea(read, q, v, a)[:, order], mp2a.rnea(model, *state)) < 1e-12
