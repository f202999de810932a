"""``mp2a march``: the same file from one process and from ranks; what is wrong is said."""

import subprocess
import sys

import numpy as np
import pytest

from mp2a import InputError, launch
from mp2a.formation.record import load, save

OPTIONS = ["--path", "0,0 6,0 6,4", "--radius", "2", "--obstacle", "4,0.2,0.3", "--seconds", "8"]


def mp2a(*arguments, expect=0):
    program = [sys.executable, "-m", "mp2a", "march", *map(str, arguments)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == expect, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done


def test_one_process_and_ranks_write_the_same_march(tmp_path):
    printed = mp2a(*OPTIONS, "--robots", 3, "--out", tmp_path / "deep" / "one.json").stdout
    assert "3 robots, line" in printed
    one, about = load(tmp_path / "deep" / "one.json")
    assert about["obstacles"] == [[4, 0.2, 0.3]]
    assert about["ran in"] == "one process"
    assert one.pose.shape == (80, 3, 3)
    assert np.abs(one.push).max() > 10
    out = tmp_path / "ranks.npz"
    program = [sys.executable, "-m", "mp2a", "march", *OPTIONS, "--out", str(out), "--quiet"]
    done = launch.run(3, program, timeout=120, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, done.stdout
    ranks, about = load(out)
    assert about["ran in"] == "3 ranks"
    for name, ours, theirs in zip(one._fields, one, ranks, strict=True):
        assert np.allclose(ours, theirs, rtol=1e-9, atol=1e-9), name


def test_a_march_settles_when_no_time_is_given(tmp_path):
    out = tmp_path / "march.npz"
    mp2a("--robots", 4, "--shape", "triangle", "--path", "0,0 3,0", "--out", out, "--quiet")
    record, _ = load(out)
    assert np.allclose(record.twist[-1], 0, atol=1e-6)
    assert np.allclose(record.pose[-1, 0], [3, 0, 0])


def test_help_has_examples():
    printed = mp2a("--help").stdout
    assert "examples:" in printed
    assert "mpirun -n 8 mp2a march" in printed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--shape", "heart"], "shape: got 'heart', expected one of line"),
        (["--shape", "box", "--robots", "4"], "got 4 for the shape 'box'"),
        (["--path", "0,0"], "points: got 1"),
        (["--path", "0,0 a,1"], "got 'a,1', expected 2 numbers"),
        (["--obstacle", "1,2"], "got '1,2', expected 3 numbers"),
        (["--obstacle", "1,2,-3"], "radius of -3"),
        (["--method", "magic"], "method: got 'magic'"),
        (["--speed", "0"], "got '0', expected a positive number"),
        (["--shape", "row", "--method", "kogge-stone"], "got a tree"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, arguments, message):
    assert message in mp2a(*arguments, "--out", tmp_path / "x.json", expect=2).stderr


def test_a_wrong_path_ends_all_ranks(tmp_path):
    program = [sys.executable, "-m", "mp2a", "march", "--path", "0,0 0,0", "--out", str(tmp_path / "x.json")]
    done = launch.run(3, program, timeout=60, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 2, done.stdout
    assert "twice in sequence" in done.stdout
    assert "Traceback" not in done.stdout


def test_a_file_that_holds_no_march_is_refused(tmp_path):
    for name, text in (("a.json", "[1]"), ("b.npz", "x"), ("c.json", '{"format": 9, "about": {}}')):
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError, match="cannot be read as a march"):
            load(tmp_path / name)
    with pytest.raises(InputError, match="cannot be read"):
        load(tmp_path / "nothing.json")
    record, about = load_some(tmp_path)
    with pytest.raises(InputError, match=r"out: .* cannot be written"):
        save(tmp_path / "a.json" / "x.json", record, about)


def load_some(tmp_path):
    out = tmp_path / "some.npz"
    mp2a("--robots", 1, "--path", "0,0 1,0", "--seconds", 1, "--out", out, "--quiet")
    return load(out)
