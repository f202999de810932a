"""What a check finds: on paper, in a run, from the command line; and that it survives anything."""

import itertools
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from mp2a.exceptions import InputError
from mp2a.formation.robot_models import HUSKY, TRADR
from mp2a.simulator.check import check, demo
from mp2a.simulator.clearance import close_pairs
from mp2a.simulator.world import rectangles

SCENARIOS = Path(__file__).parents[1] / "examples" / "scenarios"
LISTINGS = {path.stem: path.read_text() for path in SCENARIOS.glob("*.txt")}


def kinds(findings, serious=True):
    return {finding.kind for finding in findings if finding.serious == serious}


# ---- rectangles ------------------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_pairs_and_times_are_found_as_one_looks_for_them(seed):
    rng = np.random.default_rng(seed)
    poses = np.cumsum(rng.normal(0, 0.3, (40, 4, 3)), axis=0)
    sizes = rng.uniform(0.3, 1, (4, 2))
    found = close_pairs(poses, sizes, 0.1, 0)
    ticks = {(c.first, c.second, tick) for c in found for tick in range(c.begin, c.end + 1)}
    bodies = [shapely.polygons(rectangles(poses[:, i], *np.tile(sizes[i], (40, 1)).T)) for i in range(4)]
    for i, j in itertools.combinations(range(4), 2):
        gaps = shapely.distance(bodies[i], bodies[j])
        assert {tick for a, b, tick in ticks if (a, b) == (i, j)} == set(np.flatnonzero(gaps < 0.1))
        for close in found:
            if (close.first, close.second) == (i, j):
                assert close.gap == gaps[close.begin : close.end + 1].min()


def test_times_of_a_pair_that_are_close_together_are_one():
    x = np.full(30, 5.0)
    x[[3, 4, 7, 15, 19, 20]] = 0.5
    poses = np.zeros((30, 2, 3))
    poses[:, 1, 0] = x
    for pause, spans in (
        (0, [(k, k) for k in (3, 4, 7, 15, 19, 20)]),
        (3, [(3, 7), (15, 15), (19, 20)]),
        (4, [(3, 7), (15, 20)]),
    ):
        assert [(c.begin, c.end) for c in close_pairs(poses, np.ones((2, 2)), 0.1, pause)] == spans


# ---- findings --------------------------------------------------------------------------------------------------


def test_demo_has_nothing_to_be_said_against_it():
    assert check(demo(), HUSKY).findings == []


@pytest.mark.parametrize("name", ["listing_7_1", "listing_7_2", "listing_7_3"])
@pytest.mark.parametrize("model", [HUSKY, TRADR])
def test_test_scenarios_of_the_thesis_have_no_mistake(name, model):
    assert check(LISTINGS[name], model).findings == []


def test_correct_scenario_of_the_thesis_fits_the_smaller_robot_alone():
    small, large = (check(LISTINGS["listing_6_3"], model).findings for model in (TRADR, HUSKY))
    assert kinds(small) == set()
    assert kinds(small, serious=False) == {"spacing"}
    assert kinds(large) == {"collision"}
    first = next(finding for finding in large if finding.kind == "collision")
    assert first.robots == ("R1", "R3")
    assert first.time[0] < first.time[1]
    assert "(line 9)" in first.message


@pytest.mark.parametrize(
    ("text", "kind", "robots", "line", "words"),
    [
        ("robots A B\nrow A,B 0 0.7\nmove 1 0", "spacing", ("A", "B"), 2, "0.03 m between their bodies, expected"),
        ("robots A B\nrow A,B 0 0.5\nmove 1 0", "spacing", ("A", "B"), 2, "their bodies overlap"),
        ("robots A B\ncolumn A;B 1 0\nmove 1 0", "spacing", ("A", "B"), 2, "0.01 m between their bodies"),
        ("robots A B\nrow A 0 0\nrow B 0 0\nmove 1 0", "spacing", ("B", "A"), 3, "their bodies overlap"),
        ("robots A B\nrow A,B 0 3\ncircle 1.5 90 0.1", "radius", ("A",), 3, "radius 1.5 m, expected more than the 1.5"),
        ("robots A B\nrow A,B 0 8\ncircle -5 90 0.14", "speed", ("A",), 3, "A would have to drive 1.26 m/s"),
    ],
)
def test_what_shows_on_paper(text, kind, robots, line, words):
    found = [finding for finding in check(text, HUSKY).findings if finding.kind == kind and finding.time is None]
    assert all(finding.serious for finding in found)
    assert [(finding.robots, finding.line) for finding in found] == [(robots, line)]
    assert words in found[0].message


def test_each_pair_of_formations_with_one_leader_is_looked_at_once():
    found = check("robots A B C\nrow A 0 0\nrow B 0 0\nrow C 0 0", HUSKY).findings
    pairs = [(set(finding.robots), finding.line) for finding in found if finding.kind == "spacing"]
    assert pairs == [({"A", "B"}, 3), ({"B", "C"}, 4), ({"A", "C"}, 4)]


def test_a_turn_rate_that_has_to_be_halved_is_a_note():
    (note,) = check("robots A\nrow A 0 0\ncircle 2 90 0.5", HUSKY).findings
    assert (note.serious, note.kind, note.line) == (False, "speed", 3)
    assert "it will turn at 0.25 rad/s" in note.message


def test_more_speed_than_the_slowest_robot_has_is_a_mistake():
    robots = {"R1": HUSKY, "R2": TRADR}
    text = "robots R1 R2\nrow R1,R2 0 1.2\nmove 20 0"
    assert check(text, robots).findings == []
    on_paper, in_the_run = check(text, robots, max_speed=1.0).findings
    assert on_paper.robots == in_the_run.robots == ("R2",)
    assert on_paper.kind == in_the_run.kind == "speed"
    assert "expected at most the 0.5 m/s of R2" in on_paper.message
    assert "R2 falls" in in_the_run.message
    assert on_paper.serious
    assert in_the_run.serious
    assert in_the_run.time[0] < 10


def test_a_robot_that_catches_up_again_is_a_note():
    text = "robots A B\nrow A,B 0 1.2\nmove 2 0\ncolumn A;B 3 0\nmove 2 0\nrow A,B 0 1.2\nmove 20 0"
    for end, serious in (("move 20 0", False), ("move 2 0", True)):
        found = [
            finding for finding in check(text.replace("move 20 0", end), TRADR).findings if finding.kind == "speed"
        ]
        assert [(finding.serious, finding.robots) for finding in found] == [(serious, ("B",))]


def test_paths_that_cross_are_found_with_time_and_place():
    text = (
        "robots A B\ngroups\na A\nb B\nstart\nrow A,B 0 3\nmove 2 0\nrow A 0 0\nrow B 0 0\nnewVL\n"
        "move 4 -45 a\nmove 4 45 b\n"
    )
    (finding,) = check(text, HUSKY).findings
    assert (finding.kind, finding.robots, finding.serious) == ("collision", ("A", "B"), True)
    assert "A and B collide" in finding.message
    assert abs(finding.place[1]) < 0.2  # they meet in the middle
    assert 2 < finding.place[0] < 4


def test_a_scenario_that_takes_too_long_is_said_to():
    (finding,) = check("robots A\nrow A 0 0\nmove 100 0", HUSKY, longest=5).findings
    assert (finding.kind, finding.serious) == ("time", True)
    assert finding.time == (0.0, pytest.approx(5.0))


def test_wrong_text_is_not_run():
    result = check("robots A\nmove 1 0", HUSKY)
    assert result.run is None
    assert [finding.line for finding in result.findings] == [1, 2]


@pytest.mark.parametrize(
    ("option", "message"), [({"margin": -1}, "margin: got -1"), ({"longest": 0}, "longest: got 0")]
)
def test_wrong_options(option, message):
    with pytest.raises(InputError, match=message):
        check(demo(), HUSKY, **option)


# ---- anything --------------------------------------------------------------------------------------------------


@st.composite
def mutated(draw):
    """A listing with a few letters, words or lines lost, doubled or swapped."""
    text = draw(st.sampled_from(sorted(LISTINGS.values())))
    rng = random.Random(draw(st.integers(0, 2**32 - 1)))
    for _ in range(draw(st.integers(1, 4))):
        cut = rng.choice(["\n", " ", ""])
        parts = text.split(cut) if cut else list(text)
        k, j = rng.randrange(len(parts)), rng.randrange(len(parts))
        change = rng.choice(["lose", "double", "swap", "number", "letter"])
        if change == "lose":
            parts.pop(k)
        elif change == "double":
            parts.insert(j, parts[k])
        elif change == "swap":
            parts[k], parts[j] = parts[j], parts[k]
        else:
            parts[k] = str(rng.choice([0, -1, 1e-9, 0.31, 45, 1e4])) if change == "number" else rng.choice(";,#é\t-.R1")
        text = cut.join(parts) or "#"
    return text


@given(mutated(), st.sampled_from([HUSKY, TRADR]))
@settings(max_examples=120, deadline=None)
def test_a_changed_listing_is_a_run_or_findings(text, model):
    result = check(text, model, longest=4)
    if result.run is None:
        assert kinds(result.findings) <= {"syntax", "scenario"}
        assert kinds(result.findings)
    else:
        assert np.isfinite(result.run.poses).all()
        assert (np.abs(result.run.commands[..., 0]) <= model.max_speed).all()
        assert result.run.done or any(finding.kind == "time" for finding in result.findings)
    assert all(str(finding) for finding in result.findings)


# ---- command line ----------------------------------------------------------------------------------------------


def mp2a(*arguments):
    program = [sys.executable, "-m", "mp2a", "check", *map(str, arguments)]
    done = subprocess.run(program, capture_output=True, text=True, timeout=100, check=False)
    assert "Traceback" not in done.stderr
    return done


def test_command_prints_the_timeline_and_what_it_found(tmp_path):
    done = mp2a(SCENARIOS / "listing_6_3.txt", "--robots", "tradr")
    assert done.returncode == 0
    assert "circle -3 270 0.1" in done.stdout
    assert "0 mistakes, 6 notes" in done.stdout
    done = mp2a(SCENARIOS / "listing_7_4.txt", "--robots", "R1=husky,R2=tradr", "--margin", "0.2")
    assert done.returncode == 1
    assert "R1 and R2 come closer than 0.2 m" in done.stdout
    wrong = tmp_path / "wrong.txt"
    wrong.write_text("robots R1\nrow R1 0 0\nmove [b]2[/b]\nmove 1\n")
    done = mp2a(wrong)
    assert done.returncode == 1
    assert "line 3, column 6: got '[b]2[/b]', expected a number" in done.stdout
    assert "line 4, column 7" in done.stdout


def test_command_simulates_in_a_world(tmp_path):
    room = SCENARIOS.parent / "worlds" / "thesis.toml"
    done = mp2a(SCENARIOS / "listing_7_1.txt", "--world", room)
    assert done.returncode == 0, done.stdout
    assert "s with simulated robots; 0 mistakes" in done.stdout
    narrow = tmp_path / "narrow.toml"
    narrow.write_text("[[wall]]\npoints = [[-2, -1.0], [8, -1.0]]")
    done = mp2a(SCENARIOS / "listing_7_1.txt", "--world", narrow)
    assert done.returncode == 1
    assert "m of a wall or an obstacle (line" in done.stdout
    done = mp2a(SCENARIOS / "listing_7_1.txt", "--world", tmp_path / "none.toml")
    assert done.returncode == 2
    assert "cannot be read as a world file" in done.stderr


def test_command_prints_a_demo_that_it_has_nothing_against(tmp_path):
    done = mp2a("--demo")
    assert (done.returncode, done.stdout) == (0, demo())
    path = tmp_path / "demo.txt"
    path.write_text(done.stdout)
    assert mp2a(path).returncode == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "FILE: got none"),
        (["nowhere.txt"], "nowhere.txt: cannot be read as a scenario"),
        (
            [SCENARIOS / "listing_7_1.txt", "--robots", "tank"],
            "--robots: got model 'tank', expected one of husky, tradr",
        ),
        ([SCENARIOS / "listing_7_1.txt", "--robots", "R1=husky"], "robots: got none for R2"),
        ([SCENARIOS / "listing_7_1.txt", "--max-speed", "0"], "argument --max-speed: got '0'"),
    ],
)
def test_command_says_what_is_wrong(arguments, message):
    done = mp2a(*arguments)
    assert done.returncode == 2
    assert message in done.stderr
