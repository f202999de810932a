"""Obstacles and failures: what points, silence and lost poses do to a robot."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely import affinity

from mp2a.exceptions import InputError
from mp2a.formation.choreography import follower, teammates
from mp2a.formation.choreography.force_field import avoidance, forces
from mp2a.formation.choreography.leader import Leaders
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.constants import (
    CELL,
    CELL_FORCE,
    STOP_DISTANCE,
    STOP_SIDE,
    TARGET_TOLERANCE,
    TICK,
    TURN_AHEAD,
    TURN_SIDE,
)
from mp2a.formation.robot_models import HUSKY, TRADR
from mp2a.formation.safety import from_cloud, stop_signals
from mp2a.formation.sensing import pack
from mp2a.simulator.ideal import obey

ONE = "robots R1\nrow R1 0 0\nmove 20 0"
TWO = (Path(__file__).parents[1] / "examples" / "scenarios" / "listing_7_1.txt").read_text()
CLEAR = np.empty((0, 2))
# Middles of cells, so that rounding decides nothing.
CELLS = st.tuples(st.integers(-18, 17), st.integers(-18, 17)).filter(
    lambda c: c not in {(0, 0), (-1, 0), (0, -1), (-1, -1)}
)
CLOUDS = st.lists(CELLS, min_size=1, max_size=20).map(lambda cells: (np.array(cells) + 0.5) * CELL)


def seen(*clouds, model=HUSKY):
    n = len(clouds)
    points, robot, _ = pack(clouds, n, finite=False)
    signals = stop_signals(points, robot, np.full(n, model.length), np.full(n, model.width))
    sides = forces(points, robot, np.full(n, model.width))
    return SimpleNamespace(sides=sides, force=sides.sum(axis=1), **signals._asdict())


def wall(x, y0=-1.0, y1=1.0):
    return np.column_stack((np.full(41, x), np.linspace(y0, y1, 41)))


# ---- force field and stop signals ------------------------------------------------------------------------------


@given(CLOUDS)
def test_force_is_mirrored_with_the_points(points):
    force = seen(points).force[0]
    np.testing.assert_allclose(seen(points * [1, -1]).force[0], force * [1, -1], atol=1e-12)
    np.testing.assert_allclose(seen(points * [-1, 1]).force[0], force * [-1, 1], atol=1e-12)


@given(CLOUDS, st.integers(1, 5))
def test_force_does_not_depend_on_the_number_of_rays_or_their_order(points, times):
    many = np.repeat(points, times, axis=0)[::-1] + np.linspace(-0.04, 0.04, times * len(points))[:, None]
    np.testing.assert_allclose(seen(many).force, seen(points).force, atol=1e-12)


@given(st.lists(CLOUDS, min_size=1, max_size=4))
def test_robots_together_see_what_each_sees_alone(clouds):
    together = seen(*clouds)
    for i, cloud in enumerate(clouds):
        alone = seen(cloud)
        np.testing.assert_allclose(together.force[i], alone.force[0], atol=1e-15)
        assert (together.front[i], together.rear[i]) == (alone.front[0], alone.rear[0])


@given(CELLS)
def test_force_pushes_away_from_a_point(cell):
    point = (np.array(cell) + 0.5) * CELL
    force = seen([point]).force[0]
    assert force @ point < 0
    assert abs(force[0] * point[1] - force[1] * point[0]) < 1e-12
    distance, bearing = np.hypot(*point), np.arctan2(point[1], point[0])
    assert np.hypot(*force) == pytest.approx(CELL_FORCE * np.cos(bearing) ** 4 / distance**2)


def test_a_neighbour_alongside_hardly_turns_a_robot():
    side = np.column_stack((np.linspace(-0.4, 0.6, 30), np.full(30, 0.865)))  # a HUSKY 1.2 m to the left, 0.1 m ahead
    assert abs(avoidance(seen(side).sides)[0]) < 0.1
    assert abs(avoidance(seen(side[:, ::-1] + [0.1, 0.0]).sides)[0]) > 1


def test_only_the_window_counts_and_nothing_that_is_not_finite():
    far = [[2.01, 0.0], [0.0, -2.01], [-9.0, 9.0], [np.nan, 0.5], [0.5, np.inf]]
    result = seen(far)
    assert (result.force == 0).all()
    assert not result.front.any()
    assert not result.rear.any()
    assert seen([[1.99, 0.0]]).force[0, 0] < 0


def test_floor_and_ceiling_of_a_cloud_are_not_in_the_way():
    cloud = [[1, 0, 0.05], [1, 0.1, 0.11], [1, 0.2, 1.49], [1, 0.3, 1.6], [1, 0.4, np.nan]]
    assert from_cloud(cloud).tolist() == [[1, 0.1], [1, 0.2]]
    with pytest.raises(InputError, match=r"cloud: got shape \(1, 2\), expected \(n, 3\)"):
        from_cloud([[1, 2]])


def test_a_wall_pushes_harder_the_nearer_it_is_and_is_noticed_from_afar():
    sizes = [np.hypot(*seen(wall(x, -0.25, 0.25)).force[0]) for x in (1.75, 1.45, 1.25, 1.05, 0.75)]
    assert sizes == sorted(sizes)
    # Half a metre of wall, a little to the left, 1 m ahead, against a target 30° to the left behind it (section 5.2).
    assert avoidance(seen(wall(1.05, -0.15, 0.35)).sides)[0] + 3 * np.deg2rad(30) < 0


@pytest.mark.parametrize(
    ("x", "y", "turn"), [(1, 0.3, -1), (1, -0.3, 1), (-1, 0.3, 1), (-1, -0.3, -1)]
)  # the nearer end of the robot swings away
def test_a_robot_turns_its_nearer_end_away(x, y, turn):
    assert np.sign(avoidance(seen([[x, y]]).sides)[0]) == turn


@pytest.mark.parametrize("model", [HUSKY, TRADR])
@pytest.mark.parametrize("side", [1, -1])
def test_stop_signals_are_55_cm_from_the_body(model, side):
    edge = model.length / 2 + STOP_DISTANCE
    beside = model.width / 2 + STOP_SIDE
    for x, y, stop in [(edge - 0.01, 0, True), (edge + 0.01, 0, False), (0.6, beside - 0.01, True),
                       (0.6, beside + 0.01, False), (0.6, -beside + 0.01, True)]:  # fmt: skip
        result = seen([[side * x, y]], model=model)
        assert (result.front[0], result.rear[0]) == ((stop, False) if side > 0 else (False, stop))


def turned_onto(point, model, side):
    """Whether the body, widened, meets a point in some part of the turn; by geometry of a library."""
    a, b = model.length / 2 + TURN_SIDE, model.width / 2 + TURN_SIDE
    body = shapely.box(-a, -b, a, b)
    angles = np.linspace(0, TURN_AHEAD, 200)
    return any(affinity.rotate(body, side * x, (0, 0), use_radians=True).contains(shapely.Point(point)) for x in angles)


@given(st.floats(-1, 1), st.floats(-1, 1), st.sampled_from([HUSKY, TRADR]))
def test_no_turn_brings_the_body_against_a_point(x, y, model):
    result = seen([[x, y]], model=model)
    if abs(x) < model.length / 2 + TURN_SIDE and abs(y) < model.width / 2 + TURN_SIDE:
        return  # close already: the next test
    for side, blocked in ((1, result.left[0]), (-1, result.right[0])):
        swept = turned_onto((x, y), model, side)
        # Where the angles that are looked at and those of the reference part is the edge of what is swept.
        edges = [turned_onto((x * k, y * k), model, side) for k in (0.96, 1.04)]
        assert blocked == swept or edges != [swept, swept]


@given(st.floats(-0.99, 0.99), st.sampled_from([1, -1]), st.sampled_from([HUSKY, TRADR]))
def test_a_robot_close_to_a_wall_may_turn_away_from_it(along, side, model):
    """A point beside the body keeps it from the turn that brings the body nearer, and from no other."""
    if abs(along) < 0.01:
        return
    result = seen([[along * model.length / 2, side * (model.width / 2 + 0.03)]], model=model)
    towards = side * along > 0
    assert (result.left[0], result.right[0]) == (towards, not towards)


@given(CLOUDS)
def test_turns_are_mirrored_with_the_points(points):
    one, other = seen(points), seen(points * [1, -1])
    assert (one.left[0], one.right[0]) == (other.right[0], other.left[0])
    far = points[np.hypot(*points.T) > np.hypot(HUSKY.length, HUSKY.width) / 2 + 2 * TURN_SIDE]
    assert not (seen(far).left[0] or seen(far).right[0])


@pytest.mark.parametrize("model", [HUSKY, TRADR])
@pytest.mark.parametrize("side", [1, -1])
def test_a_turn_is_looked_ahead_by_half_a_radian(model, side):
    """A point on the arc of the front corner, that much further round."""
    a, b = model.length / 2 + TURN_SIDE, model.width / 2 + TURN_SIDE
    for further, met in ((TURN_AHEAD - 0.01, True), (TURN_AHEAD + 0.12, False)):
        at = 0.93 * np.hypot(a, b) * np.exp(1j * side * (np.arctan2(b, a) + further))
        result = seen([[at.real, at.imag]], model=model)
        assert (result.left if side > 0 else result.right)[0] == met


@pytest.mark.parametrize("side", [1, -1])
def test_a_turn_that_would_touch_waits_and_the_robot_may_drive(side):
    show = Choreography(parse("robots R1\nrow R1 0 0\nmove 2 0\nmove 2 90"), HUSKY)
    show.step(0.0, show.slot_poses(), np.zeros((1, 2)), [CLEAR])
    off = np.array([[-0.5, -0.4, -0.3]]) * [1, side, side]  # its lane is beside it
    free = show.step(0.1, off, np.zeros((1, 2)), [CLEAR])
    assert side * free[0, 1] > 0
    beside = np.array([[0.45, side * 0.42]])
    held = show.step(0.2, off, np.zeros((1, 2)), [beside])
    assert held[0, 1] == 0
    assert held[0, 0] > 0


# ---- fellow robots ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["listing_6_3", "listing_7_1", "listing_7_2"])
def test_robots_are_where_they_are_expected(name):
    """Ideal robots that drive in formation; while they change places they may be anywhere between."""
    text = (Path(__file__).parents[1] / "examples" / "scenarios" / f"{name}.txt").read_text()
    show = Choreography(parse(text), TRADR)
    poses, twists, off = show.slot_poses(), np.zeros((len(show.robots), 2)), []
    for tick in range(700):
        commands = show.step(tick * TICK, poses, twists, None)
        fine = np.abs(show.state.gap_error) < 0.3
        away = np.hypot(*(show.state.expected[-1] - poses[:, :2]).T)
        off += away[fine].tolist()
        poses, twists = obey(show.fleet, poses, twists, commands, TICK)
    assert np.quantile(off, 0.95) < TARGET_TOLERANCE


def test_robots_are_expected_at_their_distance_and_never_go_back():
    """On a straight lane along x, with a point every 0.1 m."""
    queues = follower.empty(1, capacity=8)
    for k in range(101):
        place = np.array([[-2.0 if k < 60 else -3.0 if k < 80 else -0.5, 0.0]])
        told = Leaders(np.array([[k / 10, 0.0, 0.0]]), np.ones((1, 2)), np.zeros(1, dtype=np.intp), place)
        queues = follower.enqueue(queues, np.array([[k / 10, 0.0]]))
        queues, there = teammates.expected_places(
            queues._replace(head=np.array([queues.tail])), told
        )  # passed points too
        # The robot waits for a leader that is to be farther away.
        wanted = k / 10 - 2 if k < 60 else max(k / 10 - 3, 3.9) if k < 80 else k / 10 - 0.5
        assert there[0, 0] == pytest.approx(max(wanted, 0.0), abs=0.1)
    assert queues.points.shape[1] < 101


def test_a_robot_far_behind_is_expected_on_the_way_to_its_lane():
    """Its leader is round a corner before it has come to where the leader started."""
    show = Choreography(parse("robots R1 R2\ncolumn R1;R2 6 0\nmove 3 0\nmove 6 60"), HUSKY)
    poses, twists = show.slot_poses(), np.zeros((2, 2))
    for tick in range(100):
        commands = show.step(tick * TICK, poses, twists, None)
        assert np.hypot(*(show.state.expected[-1] - poses[:, :2]).T).max() < 0.35
        poses, twists = obey(show.fleet, poses, twists, commands, TICK)


def test_a_fellow_in_its_place_pushes_nobody_and_stops_all():
    text = "robots R1 R2\ncolumn R1;R2 1.2 0\nmove 20 0"
    rear = np.column_stack((np.full(21, 1.2 - HUSKY.length / 2), np.linspace(0.0, 0.3, 21)))  # of R1, seen by R2
    show = Choreography(parse(text), HUSKY)
    for tick in range(10):
        show.step(tick * TICK, show.slot_poses(), np.zeros((2, 2)), [CLEAR, rear])
    assert (show.state.force == 0).all()
    assert show.state.signals.front.tolist() == [False, True]
    # The same points without a fellow there push.
    alone = Choreography(parse("robots R2\nrow R2 0 0\nmove 20 0"), HUSKY)
    alone.step(0.0, alone.slot_poses(), np.zeros((1, 2)), [rear])
    assert np.hypot(*alone.state.force[0].sum(axis=0)) > 0.1
    # And so they do for a robot that is off its place, and something else near by always does.
    off = show.slot_poses()
    off[1, 1] += 2 * TARGET_TOLERANCE
    show.step(1.0, off, np.zeros((2, 2)), [CLEAR, rear])
    assert np.hypot(*show.state.force[1].sum(axis=0)) > 0.1
    other = np.array([[1.2, 1.2]])
    show.step(1.0, show.slot_poses(), np.zeros((2, 2)), [CLEAR, other])
    assert np.hypot(*show.state.force[1].sum(axis=0)) > 0


def test_points_of_a_moment_ago_are_still_the_fellow():
    """LIDAR data are 0.3 s old: a fellow that drives at 0.7 m/s has left where it was seen."""
    memory = np.array([[[0.0, 0.0], [x, 0.0]] for x in (2.0, 2.07, 2.14, 2.21, 2.28)])
    poses, sizes = np.array([[0.0, 0.0, 0.0], [np.nan] * 3]), np.array([0.6, 0.6])
    points = np.array([[2.0 - 0.85, 0.0], [2.28 + 0.85, 0.0], [2.0 - 0.95, 0.0], [2.1, 0.95]])
    whose = np.zeros(4, dtype=np.intp)
    assert teammates.obstacles_among(points, whose, poses, memory, sizes).tolist() == [False, False, True, True]
    assert teammates.obstacles_among(
        points, whose + 1, poses, memory, sizes
    ).all()  # lost: it does not know where it is


# ---- in the controller -----------------------------------------------------------------------------------------


def test_a_robot_stops_before_a_wall_and_goes_on_when_it_is_gone():
    show = Choreography(parse(ONE), HUSKY)
    poses, twists, stood = show.slot_poses(), np.zeros((1, 2)), []
    for tick in range(250):
        # Without a force sideways: a short wall right ahead at x = 3 m that is taken away after 15 s.
        points = wall(3.0 - poses[0, 0], -0.3, 0.3) if tick < 150 else CLEAR
        commands = show.step(tick * 0.1, poses, twists, [points])
        poses, twists = obey(show.fleet, poses, twists, commands, TICK)
        stood.append(commands[0, 0] == 0)
        assert show.blocked[0] == (stood[-1] and show.state.raw_command[0, 0] > 0)
        assert poses[0, 0] + HUSKY.length / 2 < 3.0 or tick >= 150
    assert all(stood[100:150])
    assert not any(stood[150:200])
    assert not show.state.errors.failed.any()
    assert poses[0, 0] > 3.0


def test_a_choreography_ends_though_a_robot_is_blocked():
    show = Choreography(parse("robots R1\nrow R1 0 0\nmove 0.5 0"), HUSKY)
    behind = show.slot_poses() - [0.3, 0.0, 0.0]
    for points, done in ((CLEAR, False), ([[0.9, 0.0]], True), (CLEAR, False)):
        for _ in range(20):
            show.step((show.state.tick + 1) * 0.1, behind, np.zeros((1, 2)), [points])
        assert show.ended.all()
        assert show.done == done


def test_a_blocked_robot_may_still_drive_the_other_way_and_turn():
    show = Choreography(parse(ONE), HUSKY)
    for x, forward in ((-0.9, True), (0.9, False)):
        commands = show.step(0.0, show.slot_poses(), np.zeros((1, 2)), [[[x, 0.0]]])
        assert (commands[0, 0] > 0) == forward
    assert commands[0, 1] != 0


def test_a_robot_that_was_blocked_stays_so_until_new_points_come():
    show = Choreography(parse(ONE), HUSKY)
    front = [[0.9, 0.0]]
    blocked = []
    for tick, points in enumerate((front, None, None, CLEAR, None)):
        show.step(tick * 0.1, show.slot_poses(), np.zeros((1, 2)), [points])
        blocked.append(bool(show.blocked[0]))
    assert blocked == [True, True, True, False, False]


def test_what_brought_a_robot_into_its_error_state_stays_so_whatever_else_fails_later():
    for first, cause in (("points", "its LIDAR was silent"), ("pose", "its pose was lost")):
        show = Choreography(parse(ONE), HUSKY)
        for tick in range(20):
            fails = ("points", "pose") if tick >= 10 else (first,) if tick >= 3 else ()
            poses = show.slot_poses() * (np.nan if "pose" in fails else 1.0)
            show.step(tick * 0.1, poses, np.zeros((1, 2)), [None if "points" in fails else CLEAR])
            assert show.state.errors.cause(0) in ("", cause)
        assert show.state.errors.failed[0]


def test_a_robot_that_lost_its_pose_for_a_moment_has_its_path_still():
    shows = [Choreography(parse(ONE), HUSKY, poses=[[50.0, 0.0, 0.0]]) for _ in range(2)]
    for tick in range(8):
        poses = shows[0].slot_poses() - [0.3, 0.0, 0.0]
        shows[0].step(tick * 0.1, poses, np.zeros((1, 2)), None)
        shows[1].step(tick * 0.1, poses if tick != 6 else poses * np.nan, np.zeros((1, 2)), None)
        one, other = (show.state.queues.lengths[0] for show in shows)
        assert one == other > 0 or tick == 6


def test_a_silent_lidar_is_an_error_for_that_robot_alone_and_for_good():
    show = Choreography(parse(TWO), HUSKY)
    poses, twists, errors = show.slot_poses(), np.zeros((2, 2)), []
    for tick in range(60):
        silent = 10 <= tick < 20
        commands = show.step(tick * 0.1, poses, twists, [CLEAR, None if silent else CLEAR])
        poses, twists = obey(show.fleet, poses, twists, commands, TICK)
        errors.append(show.state.errors.failed.tolist())
        assert not (show.state.errors.failed[1] and commands[1].any())
        assert commands[0].any()
    # The last data came at tick 9; 0.3 s after it is the last moment without an error.
    assert errors[12] == [False, False]
    assert all(error == [False, True] for error in errors[13:])
    assert show.state.queues.lengths[1] == 0  # nothing is kept for a robot that drives no more


def test_lidar_that_once_was_there_and_stops_for_all_is_missed():
    show = Choreography(parse(TWO), HUSKY)
    show.step(0.0, show.slot_poses(), np.zeros((2, 2)), [CLEAR, CLEAR])
    assert show.step(0.3, show.slot_poses(), np.zeros((2, 2)), None)[:, 0].all()
    assert not show.step(0.4, show.slot_poses(), np.zeros((2, 2)), None).any()
    assert show.state.errors.failed.all()


def test_lidar_that_never_comes_is_missed():
    show = Choreography(parse(TWO), HUSKY)
    for tick in range(5):
        show.step(tick * 0.1, show.slot_poses(), np.zeros((2, 2)), [CLEAR, None])
    assert show.state.errors.failed.tolist() == [False, True]


def test_robots_without_lidar_drive_on():
    show = Choreography(parse(TWO), HUSKY)
    for tick in range(20):
        assert show.step(tick * 0.1, show.slot_poses(), np.zeros((2, 2)), None)[:, 0].all()


def test_before_the_start_robots_stand_and_nothing_is_missed():
    show = Choreography(parse(TWO), HUSKY)
    for t in (-4.0, -2.0, -0.1):
        assert not show.step(t, show.slot_poses(), np.zeros((2, 2)), [None, None]).any()
    assert not show.state.errors.failed.any()
    assert show.step(0.1, show.slot_poses(), np.zeros((2, 2)), [CLEAR, CLEAR])[:, 0].all()


def test_two_lost_poses_stop_a_robot_and_three_end_it():
    show = Choreography(parse(TWO), HUSKY)
    good, bad = show.slot_poses(), show.slot_poses()
    bad[0] = np.nan
    lost = [False, True, True, False, True, False, True, True, True, False]
    moves = []
    for tick, gone in enumerate(lost):
        commands = show.step(tick * 0.1, bad if gone else good, np.zeros((2, 2)), None)
        moves.append(bool(commands[0].any()))
        assert commands[1].any()
    assert moves == [True, False, False, True, False, True, False, False, False, False]
    assert show.state.errors.failed.tolist() == [True, False]


def test_an_obstacle_inside_a_robot_stops_it_one_way_and_gives_finite_commands():
    show = Choreography(parse(ONE), HUSKY)
    commands = show.step(0.0, show.slot_poses(), np.zeros((1, 2)), [[[0.0, 0.0], [0.2, 0.0]]])
    assert np.isfinite(commands).all()
    assert commands[0, 0] == 0
