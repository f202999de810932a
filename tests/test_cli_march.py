"""``mp2a march``: the same recording from one process and from ranks; what is wrong is said."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mp2a import InputError, OutputError, launch
from mp2a.formation.record import load_record, save_record
from mp2a.simulator import EventKind, load_recording

EXAMPLES = Path(__file__).parents[1] / "examples"
LISTING, ROOM = EXAMPLES / "scenarios" / "listing_7_1.txt", EXAMPLES / "worlds" / "thesis.toml"
BY_DYNAMICS = ["--path", "0,0 6,0 6,4", "--radius", "2", "--obstacle", "4,0.2,0.3", "--seconds", "8"]
DANCED = [LISTING, "--world", ROOM, "--seconds", "6"]


def mp2a(*arguments, expect=0):
    program = [sys.executable, "-m", "mp2a", "march", *map(str, arguments)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == expect, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done


def on_ranks(ranks, *arguments):
    program = [sys.executable, "-m", "mp2a", "march", *map(str, arguments)]
    return launch.run(ranks, program, timeout=120, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


@pytest.mark.parametrize(
    ("ranks", "arguments"),
    [
        (2, DANCED),
        (2, BY_DYNAMICS),
        (3, BY_DYNAMICS),
        (5, [*BY_DYNAMICS, "--shape", "triangle", "--method", "compact"]),
    ],
)
def test_one_process_and_ranks_record_the_same(tmp_path, ranks, arguments):
    dynamics = arguments is not DANCED
    alone = mp2a(
        *arguments, *(["--n", ranks] if dynamics else []), "--write", "npz", "--out", tmp_path / "one", expect=3
    )
    done = on_ranks(ranks, *arguments, "--write", "npz", "--out", tmp_path / "ranks")
    assert done.returncode == 3, done.stdout  # for time was up
    said = [line for line in done.stdout.splitlines() if "did not arrive" in line]
    assert said == [line for line in alone.stdout.splitlines() if "did not arrive" in line]
    assert len(said) == ranks and all("time was up" in line for line in said)
    one, many = (load_recording(tmp_path / f"{name}.npz") for name in ("one", "ranks"))
    assert one.poses.shape[1] == ranks
    assert np.abs(one.twists[..., 0]).max() > 0.5
    for name in ("times", "poses", "twists", "commands", "stamps", "counts", "points", "leaders"):
        np.testing.assert_allclose(getattr(one, name), getattr(many, name), rtol=1e-6, atol=1e-9, err_msg=name)
    assert [event.text(one.roles) for event in one.events] == [event.text(many.roles) for event in many.events]
    if dynamics:
        (ours, about), (theirs, _) = (load_record(tmp_path / f"{name}-scan.npz") for name in ("one", "ranks"))
        assert about["n"] == ranks
        assert np.abs(ours.push).max() > 10
        for name, x, y in zip(ours._fields, ours, theirs, strict=True):
            np.testing.assert_allclose(x, y, rtol=1e-9, atol=1e-9, err_msg=name)


def test_everything_is_written_and_told(tmp_path):
    printed = mp2a(*DANCED, "--out", tmp_path / "deep" / "dance", expect=3).stdout
    assert "2 robots, 6.0 s, simulated" in printed
    for ending in (".npz", ".mcap", ".png", "-speeds.png", ".gif"):
        file = tmp_path / "deep" / f"dance{ending}"
        assert file.stat().st_size > 1000
        assert str(file) in printed
    recording = load_recording(tmp_path / "deep" / "dance.npz")
    assert recording.world.name.startswith("room of the thesis")
    # The second robot's leader began half a metre ahead in its lane and is to stay so far ahead.
    np.testing.assert_allclose(recording.leaders[0, 1], [0.0, -0.6, 0.5], atol=1e-12)


def test_a_march_settles_when_no_time_is_given(tmp_path):
    mp2a("--n", 4, "--shape", "triangle", "--path", "0,0 3,0", "--out", tmp_path / "x", "--write", "npz", "--quiet")
    recording = load_recording(tmp_path / "x.npz")
    assert np.abs(recording.twists[-1]).max() < 1e-3
    assert np.allclose(recording.poses[-1, 0], [3, 0, 0], atol=0.01)


def test_a_choreography_begins_where_it_is_told_to(tmp_path):
    mp2a(LISTING, "--start", "1,2,90", "--seconds", 1, "--out", tmp_path / "x", "--write", "npz", "--quiet", expect=3)
    recording = load_recording(tmp_path / "x.npz")
    np.testing.assert_allclose(recording.poses[0], [[0.4, 1.5, np.pi / 2], [1.6, 1.5, np.pi / 2]], atol=1e-12)
    assert (recording.poses[-1, :, 1] > 1.7).all()


# ---- who arrived -----------------------------------------------------------------------------------------------


def test_robots_that_touch_and_do_not_arrive_are_named_and_the_status_says_so(tmp_path):
    """The thesis' scenario 6.1 with HUSKYs that slip: two touch, and two end elsewhere."""
    scenario = EXAMPLES / "scenarios" / "listing_6_1.txt"
    done = mp2a(scenario, "--out", tmp_path / "x", "--write", "npz", expect=3)
    recording = load_recording(tmp_path / "x.npz")
    met = [event for event in recording.events if event.kind is EventKind.COLLISION]
    assert met
    for event in met:
        other = "a wall or an obstacle" if event.other is None else recording.roles[event.other]
        role = recording.roles[event.robot]
        said = next(x for x in done.stdout.splitlines() if x.startswith(f"{role} ") and "from its place" in x)
        assert other in said.partition("touched ")[2]
    assert "did not arrive" in done.stdout


@pytest.mark.parametrize("ranks", [None, 3])
def test_a_wall_across_the_path_is_what_blocks_whom(tmp_path, ranks):
    (tmp_path / "wall.toml").write_text("[[box]]\ncentre = [7, 0]\nsize = [0.2, 30]\n")
    arguments = ["--world", tmp_path / "wall.toml", "--path", "0,0 12,0", "--out", tmp_path / "x", "--write", "npz"]
    if ranks is None:
        printed = mp2a("--n", 3, *arguments, expect=3).stdout
    else:
        done = on_ranks(ranks, *arguments)
        assert done.returncode == 3, done.stdout
        printed = done.stdout
    lines = [line for line in printed.splitlines() if "did not arrive" in line]
    assert [line[:2] for line in lines] == ["R1", "R2", "R3"]
    assert "blocked by a wall or an obstacle" in lines[0]
    poses = load_recording(tmp_path / "x.npz").poses[-1]
    off = float(lines[0].split(", ")[1].split(" m ")[0])
    assert off == pytest.approx(np.hypot(12 - poses[0, 0], poses[0, 1]), abs=0.5)


def test_robots_that_arrive_are_a_success(tmp_path):
    printed = mp2a(LISTING, "--world", ROOM, "--out", tmp_path / "x", "--write", "npz").stdout
    assert "did not arrive" not in printed and "touched R" not in printed


def test_quiet_says_what_went_wrong_and_no_more(tmp_path):
    done = mp2a(*DANCED, "--out", tmp_path / "x", "--write", "npz", "--quiet", expect=3)
    assert done.stdout == ""
    assert [line.split(",")[0] for line in done.stderr.splitlines()] == [
        f"mp2a: {role} did not arrive" for role in ("R1", "R2")
    ]


# ---- disks -----------------------------------------------------------------------------------------------------


def test_a_full_disk_is_told_and_the_summary_is_printed_all_the_same(tmp_path):
    (tmp_path / "x.npz").symlink_to("/dev/full")
    done = mp2a("--n", 1, "--path", "0,0 1,0", "--out", tmp_path / "x", "--write", "npz,mcap", expect=2)
    assert "x.npz: cannot be written (No space left on device)" in done.stderr
    assert "1 robots" in done.stdout and "yes" in done.stdout
    assert str(tmp_path / "x.mcap") in done.stdout  # what could be written is there
    assert (tmp_path / "x.mcap").stat().st_size > 1000
    assert (tmp_path / "x-scan.npz").stat().st_size > 1000


def test_a_full_disk_is_told_on_all_ranks(tmp_path):
    (tmp_path / "x.npz").symlink_to("/dev/full")
    done = on_ranks(2, "--path", "0,0 1,0", "--out", tmp_path / "x", "--write", "npz")
    assert done.returncode == 2, done.stdout
    assert "No space left on device" in done.stdout
    assert "2 robots" in done.stdout


def test_help_has_examples():
    printed = mp2a("--help").stdout
    assert "examples:" in printed
    assert "mp2a run -n 8 mp2a march" in printed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--shape", "heart"], "shape: got 'heart', expected one of line"),
        (["--shape", "box", "--n", "4"], "got 4 for the shape 'box'"),
        (["--path", "0,0"], "points: got 1"),
        (["--path", "0,0 a,1"], "got 'a,1', expected 2 numbers"),
        (["--obstacle", "1,2"], "got '1,2', expected 3 numbers"),
        (["--obstacle", "1,2,-3"], "radius: got -3.0"),
        (["--obstacle", "0,0,1"], "robot 1 touches a wall or an obstacle at the start"),
        (["--spacing", "0.5"], "robot 1 touches robot 2 at the start"),
        (["--method", "magic"], "method: got 'magic'"),
        (["--speed", "0"], "got '0', expected a number from 0.001 to 100 m/s"),
        (["--shape", "row", "--method", "kogge-stone"], "got a tree"),
        (["--robots", "R1=husky"], "expected one model for all"),
        (["--robots", "tradr", "--speed", "0.7"], "--speed: got 0.7, expected at most 0.5 m/s of a TRADR"),
        (["--robots", "bicycle"], "--robots: got model 'bicycle'"),
        (["--write", "npz,film"], "--write: got 'film', expected one of npz"),
        (["--max-speed", "1"], "--max-speed: got 1.0 without a FILE"),
        ([LISTING, "--shape", "row"], "--shape: got row with a FILE"),
        ([LISTING, "--robots", "R1=husky"], "got none for R2"),
        ([LISTING, "--world", LISTING], "cannot be read as TOML"),
        ([LISTING, "--start", "0,0"], "got '0,0', expected 3 numbers"),
        ([ROOM], "line 6"),
        (["--out", "/dev/null/x/y"], "--out: /dev/null/x/y.npz: cannot be written (Not a directory"),
        (["no such file"], "cannot be read as a scenario: it is not there, expected text"),
        ([EXAMPLES], "cannot be read as a scenario: it is a folder"),
        (["--out", "/dev/null"], "--out: got /dev/null, a device"),
        (["--seconds", "1e-300"], "got '1e-300', expected a number from 0.1 to 100000 s"),
        (["--seconds", "inf"], "got 'inf', expected a number from 0.1 to 100000 s"),
        (["--path", "0,0 1e300,1"], "got '1e300,1', expected numbers of at most 100000"),
        (["--path", "0,0 nan,1"], "got 'nan,1', expected numbers of at most 100000"),
        (["--path", "0,0 1e5,1", "--speed", "0.001"], "until: got"),
        (["--obstacle", "1,2,1e300"], "got '1,2,1e300', expected numbers of at most 100000"),
        (["--spacing", "1e300"], "got '1e300', expected a number from 0.001 to 100000 m"),
        (["--radius", "1e-300"], "got '1e-300', expected a number from 0.001 to 100000 m"),
        (["--speed", "1e300"], "got '1e300', expected a number from 0.001 to 100 m/s"),
        (["--n", "1000000000"], "--n: got 1000000000, expected at most 10000"),
        ([LISTING, "--max-speed", "1e300"], "got '1e300', expected a number from 0.001 to 100 m/s"),
        ([LISTING, "--start", "1e300,0,0"], "got '1e300,0,0', expected numbers of at most 100000"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, arguments, message):
    assert message in mp2a("--write", "npz", "--out", tmp_path / "x", *arguments, expect=2).stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--path", "0,0 0,0"], "twice in sequence"),
        (["--n", "4"], "--n: got 4 on 3 ranks"),
        ([LISTING], "FILE: got 2 robots for 3 ranks"),
        (["--spacing", "0.5"], "robot 1 touches robot 2 at the start"),
    ],
)
def test_a_mistake_ends_all_ranks(tmp_path, arguments, message):
    done = on_ranks(3, *arguments, "--out", tmp_path / "x")
    assert done.returncode == 2, done.stdout
    assert message in done.stdout
    assert "Traceback" not in done.stdout


def test_a_file_that_holds_no_march_is_refused(tmp_path):
    for name, text in (("a.json", "[1]"), ("b.npz", "x")):
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError, match="cannot be read as a march"):
            load_record(tmp_path / name)
    with pytest.raises(InputError, match="cannot be read"):
        load_record(tmp_path / "nothing.npz")
    mp2a("--n", 1, "--path", "0,0 1,0", "--out", tmp_path / "x", "--write", "npz", "--quiet")
    record, about = load_record(tmp_path / "x-scan.npz")
    save_record(tmp_path / "y.npz", record, about)
    again, _ = load_record(tmp_path / "y.npz")
    assert (again.pose == record.pose).all()
    np.savez(tmp_path / "y.npz", **(dict(np.load(tmp_path / "y.npz")) | {"format": 9}))
    with pytest.raises(InputError, match=r"cannot be read as a march: format 9, expected 2"):
        load_record(tmp_path / "y.npz")
    with pytest.raises(OutputError, match=r"a\.json"):
        save_record(tmp_path / "a.json" / "x.npz", record, about)


def test_robots_in_a_column_arrive_on_their_leaders_path_round_corners(tmp_path):
    """Where they are to be is on the path, not where a stiff formation would have them."""
    scenario = tmp_path / "column.txt"
    scenario.write_text("robots R1 R2 R3 R4\ncolumn R1;R2;R3;R4 2 0\nmove 3 0\nmove 3 -60\nmove 3 60")
    assert mp2a(scenario, "--out", tmp_path / "x", "--write", "npz").stdout.count(" yes ") == 4
