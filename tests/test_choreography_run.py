"""Leaders, robots and the whole: controllers against their equations, listings to their end."""

import collections
import copy
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mp2a.exceptions import InputError
from mp2a.formation.choreography import follower, leader
from mp2a.formation.choreography.program import CIRCLE, MOVE, compile_program
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.choreography.scenario import Group, Move, Scenario, Shape
from mp2a.formation.constants import TARGET_AHEAD, TARGET_TOLERANCE, TICK, WAYPOINT_TOLERANCE
from mp2a.formation.robot_models import HUSKY, ROBOTS, TRADR, RobotModel
from mp2a.se2 import compose, drive, wrap
from mp2a.simulator.ideal import obey
from mp2a.simulator.scenario_run import run

LISTINGS = {
    path.stem: path.read_text() for path in (Path(__file__).parents[1] / "examples" / "scenarios").glob("*.txt")
}
COORDINATE = st.floats(-5, 5)
NOT_ZERO = COORDINATE.filter(lambda x: abs(x) > 1e-6)


def dance(text, robots=HUSKY, **options):
    return Choreography(parse(text), robots, **options)


def leaders_of(text, seconds, max_speed=1.0):
    """Leaders of a scenario at every tick."""
    program = compile_program(parse(text))
    state = leader.start(program, None)
    out = []
    for tick in range(round(seconds / TICK)):
        state = leader.advance(program, state, tick * TICK, max_speed)
        out.append(state.leaders)
    return program, out


# ---- poses -----------------------------------------------------------------------------------------------------


@given(st.floats(-1, 1), st.floats(-3, 3))
def test_an_arc_is_what_small_steps_come_to(speed, turn):
    whole = compose((1.0, 2.0, 0.5), drive(np.array([speed, turn]), 1.0))
    pose = np.array([1.0, 2.0, 0.5])
    for _ in range(1000):
        pose = compose(pose, drive(np.array([speed, turn]), 1e-3))
    np.testing.assert_allclose(pose, whole, atol=1e-9)


# ---- virtual leader --------------------------------------------------------------------------------------------


@given(COORDINATE, NOT_ZERO, st.floats(0.2, 2))
def test_waypoint_controller_is_equation_4_1(x, y, v_max):
    alpha = np.arccos(x / np.hypot(x, y))
    linear = min(max(1.5 * x, 0.1), 0.7 * v_max)
    angular = np.clip(2 * np.sign(y) * alpha, -np.pi / 2, np.pi / 2)
    np.testing.assert_allclose(leader.waypoint_twist(np.array([x, y]), v_max), [linear, angular], atol=1e-6)


def test_rounding_does_not_choose_the_side_of_a_waypoint_straight_behind():
    for y in (0.0, 1e-12, -1e-12):
        assert leader.waypoint_twist(np.array([-1.0, y]), 1.0).tolist() == [0.1, np.pi / 2]


@given(st.floats(-10, 10).filter(lambda r: abs(r) > 0.1), st.floats(0.01, 1), st.floats(0.2, 2))
def test_arc_controller_is_equation_4_3(radius, rate, off):
    linear, angular = leader.arc_twist(np.array(radius), np.array(rate), np.array(abs(radius) * off))
    assert linear == pytest.approx(rate * abs(radius))
    wanted = np.sign(radius) * rate * (1 - 5 * (abs(radius) - abs(radius) * off))
    assert angular == pytest.approx(np.clip(wanted, -np.pi / 2, np.pi / 2))
    turn = leader.arc_twist(np.array(radius), np.array(rate), np.array(abs(radius)))
    assert turn[0] == pytest.approx(turn[1] * radius)  # eq. 4.2 on the arc itself


@given(st.floats(-10, 10), st.floats(0.01, 10), st.floats(0.1, 2))
def test_turn_rate_of_an_arc_is_halved_no_oftener_than_needed(radius, rate, v_max):
    kept = float(leader.arc_rate(np.array(radius), np.array(rate), v_max))
    assert kept * abs(radius) <= 0.7 * v_max * (1 + 1e-8)
    assert np.log2(rate / kept) == round(np.log2(rate / kept))
    if kept < rate:
        assert 2 * kept * abs(radius) > 0.7 * v_max * (1 - 1e-8)


@given(st.lists(st.tuples(st.floats(0.5, 4), st.floats(-180, 180)), min_size=1, max_size=4))
@settings(max_examples=20, deadline=None)
def test_leader_passes_every_waypoint_within_its_tolerance(moves):
    text = "robots R1\nrow R1 0 0\n" + "\n".join(f"move {x} {angle}" for x, angle in moves)
    _, states = leaders_of(text, 60)
    path = np.array([state.pose[0, :2] for state in states])
    waypoint, after = np.zeros(3), 0
    for x, angle in moves:
        waypoint = compose(waypoint, (0.0, 0.0, np.deg2rad(angle)))
        waypoint = compose(waypoint, (x, 0.0, 0.0))
        near = np.hypot(*(path[after:] - waypoint[:2]).T) <= WAYPOINT_TOLERANCE
        assert near.any()
        after += int(np.argmax(near))
    twists = np.array([state.twist[0] for state in states])
    assert twists[:, 0].max() <= 0.7
    assert (np.abs(twists[:, 1]) <= np.pi / 2).all()
    moving = twists[:, 0] != 0
    assert (twists[moving, 0] >= 0.1).all()
    assert not moving[-1]


@pytest.mark.parametrize("radius", [3.0, -2.0])
def test_leader_drives_an_arc_from_its_beginning_to_its_end(radius):
    _, states = leaders_of(f"robots R1\nrow R1 0 0\ncircle {radius} 270 0.2", 60)
    path = np.array([state.pose[0] for state in states])
    np.testing.assert_allclose(np.hypot(path[:, 0], path[:, 1] - radius), abs(radius), atol=1e-9)
    end = np.array([-abs(radius), radius])
    assert np.hypot(*(path[-1, :2] - end)) <= 0.2 * abs(radius) * TICK
    assert wrap(path[-1, 2] - np.sign(radius) * 1.5 * np.pi) == pytest.approx(0, abs=0.2 * TICK)


def test_robots_of_a_new_formation_are_to_be_where_they_were():
    text = "robots A B C D\nsquare A,B;C,D 1.2 1;1\nmove 3 0\ncolumn A;C 1.2 0\ncolumn B;D 1.2 0\nnewVL\nmove 1 0"
    program, states = leaders_of(text, 8)
    spots = [compose(s.pose, np.column_stack((s.slot, np.zeros(4)))) for s in states]
    split = next(k for k, s in enumerate(states) if (s.slot[:, 1] == 0).all())
    np.testing.assert_allclose(spots[split], spots[split - 1], atol=1e-12)
    assert states[split].pose[0, 1] - states[split].pose[1, 1] == pytest.approx(1.0)
    stands = sum(s.stands.all() for s in states[:split])
    assert stands * TICK == pytest.approx(1.0)
    assert program.members[0].tolist() == [0, 2]


def test_formations_that_join_wait_for_each_other():
    text = (
        "robots A B\ngroups\na A\nb B\nstart\nrow A,B 0 2\nrow A 0 0\nrow B 0 0\nnewVL\nmove 2 0 a\nmove 5 0 b\n"
        "row A,B 0 2\nnewVL\nmove 2 0"
    ).replace("row A,B 0 2\nrow A 0 0", "row A,B 0 2\nmove 1 0\nrow A 0 0")
    _, states = leaders_of(text, 30)
    joined = next(k for k, s in enumerate(states) if k > 60 and (s.pose[0] == s.pose[1]).all())
    assert (np.array([s.pose[0] for s in states[joined:]]) == np.array([s.pose[1] for s in states[joined:]])).all()
    before = states[joined - 1].pose
    assert states[joined].pose[0, 0] == pytest.approx(before[:, 0].max())
    assert states[joined].pose[0, 1] == pytest.approx(before[:, 1].mean(), abs=1e-9)


# ---- robots ----------------------------------------------------------------------------------------------------


@given(st.lists(st.tuples(NOT_ZERO, NOT_ZERO, st.floats(-0.3, 2), NOT_ZERO, NOT_ZERO), min_size=1, max_size=5))
def test_robot_controller_is_equation_4_4(rows):
    x, y, excess, fx, fy = np.array(rows).T
    alpha = np.arctan2(np.abs(y), np.abs(x))
    linear = np.sign(x) * 0.7 * 0.5 * np.abs(1 + 3 * excess)
    # cos α₂ for the printed sgn(Fx), without its jump where an obstacle is abeam
    away = np.arctan2(fy, fx)
    angular = 3 * np.sign(x * y) * alpha - 2 * np.cos(away) * away * np.hypot(fx, fy)
    still = np.zeros(len(x), dtype=bool)
    got = follower.commands(np.column_stack((x, y)), excess, still, np.column_stack((fx, fy))[:, None], 0.5)
    np.testing.assert_allclose(got, np.column_stack((linear, angular)), atol=1e-9)


def test_a_robot_too_close_stands_and_one_in_place_stands_with_its_leader():
    target, none = np.array([[1.0, 0.0]] * 4), np.zeros((4, 2))
    stands = np.array([False, False, True, True])
    excess = np.array([-0.5, -2.0, 0.0, 0.1])
    got = follower.commands(target, excess, stands, none, 1.0)[:, 0]
    np.testing.assert_allclose(got, [0.0, 0.0, 0.0, 0.7 * 0.3], atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
@settings(max_examples=20, deadline=None)
def test_queues_do_what_deques_do(seed, n):
    rng = np.random.default_rng(seed)
    queues, deques = follower.empty(n, capacity=8), [collections.deque() for _ in range(n)]
    place = np.column_stack((-rng.uniform(0.5, 3, n), rng.uniform(-1, 1, n)))
    pose = rng.normal(size=(n, 3))
    robots = compose(pose, np.column_stack((place, np.zeros(n))))
    for _ in range(120):
        pose = compose(pose, drive(np.column_stack((rng.uniform(0.1, 0.7, n), rng.normal(0, 1, n))), TICK))
        robots = compose(robots, drive(np.column_stack((rng.uniform(0, 1, n), rng.normal(0, 1, n))), TICK))
        zero = np.zeros(n)
        state = leader.Leaders(pose, np.ones((n, 2)), zero.astype(int), place)
        queues = follower.enqueue(queues, state.points)
        queues, target, excess = follower.targets(queues, state, robots)
        for i, queue in enumerate(deques):
            own = compose(pose[i], (0.0, place[i, 1], 0.0))[:2]
            queue.append(own)
            gap = np.hypot(*(own - robots[i, :2]))
            assert excess[i] == pytest.approx(gap + place[i, 0])
            reached = [k for k, p in enumerate(queue) if np.hypot(*(p - robots[i, :2])) < TARGET_TOLERANCE]
            for _ in range(1 + max((k for k in reached if k < TARGET_AHEAD), default=-1)):
                queue.popleft()
            if gap > 2 * -place[i, 0]:
                queue.clear()
            assert queues.lengths[i] == len(queue)
            np.testing.assert_allclose(target[i], queue[0] if queue else own, atol=1e-12)


# ---- the whole -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", LISTINGS)
@pytest.mark.parametrize("model", ROBOTS)
def test_listings_run_to_their_end(name, model):
    show = dance(LISTINGS[name], ROBOTS[model])
    done = run(show, 200)
    assert done.done
    assert not show.state.errors.failed.any()
    limits = [ROBOTS[model].max_speed, ROBOTS[model].max_turn_rate]
    assert (np.abs(done.commands) <= limits).all()
    # Every robot is as far from its leader as it should be; behind a corner, rows may be closer (section 4.1).
    assert (done.gap_errors[-1] < 0.05).all()
    assert (done.gap_errors[-1] > -1 / 3).all()
    first = show.state.leaders.slot[:, 0] == -0.5
    np.testing.assert_allclose(done.poses[-1, first, :2], show.slot_poses()[first, :2], atol=1 / 3)
    for robot in show.robots:
        mine = [event for event in show.events if event.robot == robot]
        assert [event.what for event in mine] == ["began", "ended"] * (len(mine) // 2)
        assert [a.time for a in mine[1:-1:2]] == [b.time for b in mine[2::2]]
        numbers = [event.number for event in mine[::2]]
        assert numbers == sorted(set(numbers))
        program = show.program.instruction[show.robots.index(robot)]
        assert numbers == program[program >= 0].tolist()


def test_first_scenario_keeps_its_distance_as_in_the_thesis():
    done = run(dance(LISTINGS["listing_7_1"], TRADR))
    apart = np.hypot(*(done.poses[:, 0, :2] - done.poses[:, 1, :2]).T)
    assert np.abs(apart - 1.2).max() < 0.16  # what the thesis saw in its 2-D simulation, section 7.2.1
    assert apart[-1] == pytest.approx(1.2, abs=0.02)
    assert (done.commands[:, :, 0] >= 0).all()


def test_order_of_two_groups_does_not_matter():
    one, two = (run(dance(LISTINGS[name])) for name in ("listing_6_1", "listing_6_2"))
    assert (one.poses == two.poses).all()


def test_leaders_do_not_depend_on_where_robots_are():
    rng = np.random.default_rng(0)
    shows = [dance(LISTINGS["listing_7_2"]) for _ in range(2)]
    for tick in range(100):
        for show in shows:
            show.step(tick * TICK, rng.normal(size=(2, 3)), np.zeros((2, 2)), None)
        assert (shows[0].state.leaders.pose == shows[1].state.leaders.pose).all()


def test_leaders_keep_ticks_however_the_caller_does():
    rng = np.random.default_rng(1)
    regular, other = dance(LISTINGS["listing_7_1"]), dance(LISTINGS["listing_7_1"])
    still = np.zeros((2, 3)), np.zeros((2, 2)), None
    regular.step(5.0, *still)
    for t in np.sort(rng.uniform(0, 5, 60)):
        other.step(t, *still)
    other.step(5.0, *still)
    assert (regular.state.leaders.pose == other.state.leaders.pose).all()
    assert regular.events == other.events


def test_each_robot_alone_does_what_it_does_among_all():
    together = dance(LISTINGS["listing_6_3"])
    done = run(together, 15)
    alone = dance(LISTINGS["listing_6_3"])
    for tick in range(len(done.time)):
        poses = np.full((4, 3), np.nan)
        poses[2] = done.poses[tick, 2]
        commands = alone.step(done.time[tick], poses, np.zeros((4, 2)), None)
        np.testing.assert_array_equal(commands[2], done.commands[tick, 2])
    assert (commands[[0, 1, 3]] == 0).all()


def test_a_state_can_be_kept_and_gone_on_from():
    show = dance(LISTINGS["listing_7_1"])
    poses = show.slot_poses()
    for tick in range(30):
        show.step(tick * TICK, poses, np.zeros((2, 2)), None)
    again = dance(LISTINGS["listing_7_1"])
    again.state = pickle.loads(pickle.dumps(copy.deepcopy(show.state)))
    for tick in range(30, 60):
        a, b = (one.step(tick * TICK, poses, np.zeros((2, 2)), None) for one in (show, again))
        assert (a == b).all()


def test_leader_starts_in_front_of_robots_that_stand_somewhere():
    where = np.array([4.0, -2.0, 2.5])
    origin = dance(LISTINGS["listing_7_1"]).slot_poses()
    show = dance(LISTINGS["listing_7_1"], poses=compose(where, origin))
    np.testing.assert_allclose(show.slot_poses(), compose(where, origin), atol=1e-12)
    done, same = run(show), run(dance(LISTINGS["listing_7_1"]))
    np.testing.assert_allclose(done.poses[:, :, :2], compose(where, same.poses)[:, :, :2], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": -0.2}, "t: got -0.2 s after 0.1 s, expected time to run on"),
        ({"t": 61.0}, "t: got 61.0 s"),
        ({"t": float("nan")}, "t: got nan s"),
        ({"poses": np.zeros((2, 2))}, r"poses: got shape \(2, 2\), expected \(2, 3\)"),
        ({"twists": np.zeros(2)}, r"twists: got shape \(2,\), expected \(2, 2\)"),
        ({"points": [np.zeros((3, 2))]}, "points: got 1 entries, expected 2"),
        ({"points": [np.zeros((3, 3)), None]}, r"points\[0\]: got shape \(3, 3\), expected \(n, 2\)"),
        ({"points": ["x", None]}, r"points\[0\]: got str"),
    ],
)
def test_wrong_arguments_of_a_step(change, message):
    show = dance(LISTINGS["listing_7_1"])
    given = {"t": 0.1, "poses": show.slot_poses(), "twists": np.zeros((2, 2)), "points": None}
    show.step(**given)
    with pytest.raises(InputError, match=message):
        show.step(**given | change)


def test_wrong_robots():
    for robots, message in (
        ({"R1": HUSKY}, "none for R2"),
        ({"R1": HUSKY, "R2": HUSKY, "R3": HUSKY}, "unknown robot R3"),
    ):
        with pytest.raises(InputError, match=message):
            dance(LISTINGS["listing_7_1"], robots)
    with pytest.raises(InputError, match=r"here: got \[2\], expected numbers of robots, from 0 to 1"):
        dance(LISTINGS["listing_7_1"], here=[2])
    with pytest.raises(InputError, match="max_speed: got -1"):
        dance(LISTINGS["listing_7_1"], max_speed=-1)
    with pytest.raises(InputError, match="width: got 0 for robot X, expected a positive number"):
        RobotModel("X", 1, 0, 1, 1, 1, 1)


@pytest.mark.parametrize(
    ("scenario", "message"),
    [
        ("robots R1", "scenario: got str, expected a Scenario"),
        (Scenario((), (), ()), "expected a Scenario with at least one robot"),
        (Scenario(("A",), (), ()), "got no place for robot A at first"),
        (Scenario(("A",), (), (Move(1.0, 0.0),)), "got no place for robot A at first"),
        (Scenario(("A",), (Group("g", ("B",)),), ()), "got robot 'B' in g"),
        (Scenario(("A",), (), (Shape("row", (("B",),), (), ((),)),)), "got robot 'B' in row"),
        (Scenario(("A",), (), (Shape("row", (("A",),), (), ((),)), Move(1.0, 0.0, "g"))), "got group 'g'"),
    ],
)
def test_scenarios_that_are_not_from_a_text(scenario, message):
    with pytest.raises(InputError, match=message):
        Choreography(scenario, HUSKY)


def test_running_a_scenario_needs_no_parser():
    code = (
        "import sys, numpy as np\n"
        "from mp2a.formation.choreography import runner, scenario as s\n"
        "from mp2a.formation.robot_models import HUSKY\n"
        "plan = s.Scenario(('A',), (), (s.Shape('row', (('A',),), (), ((),)), s.Move(1.0, 0.0)))\n"
        "show = runner.Choreography(plan, HUSKY)\n"
        "print(show.step(0, show.slot_poses(), np.zeros((1, 2)), None)[0, 0])\n"
        "assert not {'lark', 'matplotlib', 'argparse', 'pinocchio', 'scipy', 'rich'} & set(sys.modules), sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "0.7\n"


# ---- ideal robots ----------------------------------------------------------------------------------------------


@given(st.tuples(st.floats(-1, 1), st.floats(-2, 2)), st.tuples(COORDINATE, COORDINATE), st.floats(0.01, 1))
def test_ideal_robots_keep_their_limits_and_else_do_as_told(twist, command, dt):
    one = dance("robots R1\nrow R1 0 0").fleet
    pose, reached = obey(one, np.zeros((1, 3)), np.array([twist]), np.array([command]), dt)
    most, change = np.array([1.0, 2.0]), np.array([3.0, 6.0]) * dt
    assert (np.abs(reached) <= most + 1e-12).all()
    assert (np.abs(reached - twist) <= change + 1e-12).all()
    wanted = np.clip(command, -most, most)
    near = np.abs(wanted - twist) <= change
    np.testing.assert_allclose(reached[0, near], wanted[near], atol=1e-12)
    assert (np.sign(reached[0] - twist) * np.sign(wanted - twist) >= 0).all()
    np.testing.assert_allclose(pose[0], drive(reached, dt)[0], atol=1e-12)


def test_programs_hold_numbers_in_si_units():
    program = compile_program(parse("robots R1\nrow R1 0 0\nmove 2 -90\ncircle -3 180 0.1"))
    assert program.kind[0, 1:3].tolist() == [MOVE, CIRCLE]
    np.testing.assert_allclose(program.values[0, 1:3], [[2, -np.pi / 2, 0], [-3, np.pi, 0.1]])
