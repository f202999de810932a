"""Choreographies and marches by dynamics in the simulator: late scans, failures, and whatever files there are."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mp2a.exceptions import InputError
from mp2a.formation import Formation, FormationController, Limits, waypoints
from mp2a.formation.choreography.force_field import avoidance
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.pose_history import PoseHistory
from mp2a.formation.robot_models import HUSKY, TRADR
from mp2a.formation.tracking import track
from mp2a.plot.speeds import speeds_figure
from mp2a.se2 import act, act_inverse
from mp2a.simulator import (
    ChoreographySimulationDriver,
    EventKind,
    FormationSimulationDriver,
    Observation,
    RunRecorder,
    Simulation,
    World,
    box,
    disc,
    parse_world,
    read_world,
)
from mp2a.simulator.check import check
from mp2a.simulator.scenario_run import run as ideal_run
from mp2a.simulator.vehicle import drive_arcs

EXAMPLES = Path(__file__).parents[1] / "examples"
LISTINGS = {path.stem[8:]: path.read_text() for path in (EXAMPLES / "scenarios").glob("*.txt")}
ROOM = read_world(EXAMPLES / "worlds" / "thesis.toml")
PATH = waypoints([[0, 0], [12, 0]])


def dance(text, model=HUSKY, world=ROOM, until=120.0, change=None, after=0.0):
    """Run a choreography; ``change(simulation)`` is called every tick."""
    show = Choreography(parse(text), model)
    simulation = Simulation(world, model, show.slot_poses())
    return show, *drive(simulation, ChoreographySimulationDriver(show), until, change, after)


def march(shape, n, obstacles=(), until=25.0, change=None, spacing=2.0, path=PATH):
    formation = Formation.of(shape, n, spacing)
    simulation = Simulation(World([], obstacles), HUSKY, formation.layout.poses(np.zeros(3)))
    march_ = FormationController(formation, path)
    return march_, *drive(simulation, FormationSimulationDriver(march_, HUSKY), until, change)


def drive(simulation, robots, until, change=None, after=0.0):
    recorder, end = RunRecorder(simulation, points=False), until
    while simulation.time < end - 1e-9:
        if change is not None:
            change(simulation)
        sensed = simulation.sense()
        told = robots.step(sensed)
        recorder.add(sensed, told)
        if robots.done and end == until:
            end = min(until, simulation.time + after)
        simulation.step(told)
    return simulation, recorder.recording(robots.leaders, robots.events)


# ---- where things were -----------------------------------------------------------------------------------------


@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(-3, 3), st.floats(0.0, 0.9))
def test_what_stands_still_is_put_where_it_is_whatever_the_robot_has_driven(speed, turn, heading, age):
    """A point on the ground, seen a while ago from an arc, comes out at its place in the frame of now."""
    times = np.arange(0, 1.05, 0.01)
    twist = np.array([[speed, turn]])
    poses = [drive_arcs(np.array([[1.0, 2.0, heading]]), twist, t) for t in times]
    memory = PoseHistory.empty(1)
    for time, pose in zip(times, poses, strict=True):
        memory = memory.add(time, pose)
    then = memory.at(np.array([times[-1] - age]))
    exact = drive_arcs(poses[-1], twist, -age)
    np.testing.assert_allclose(then, exact, atol=2e-4)
    place = np.array([[5.0, 5.0]])
    seen = act(then, act_inverse(exact, place))
    assert np.hypot(*(seen - place)[0]) < 5e-3


def test_a_heading_that_wraps_is_no_turn_and_what_is_older_than_the_memory_is_its_beginning():
    memory = PoseHistory.empty(2)
    memory = memory.add(0.0, np.array([[0, 0, 3.1], [1, 0, 0]]))
    memory = memory.add(0.1, np.array([[0, 0, -3.1], [2, 0, 0]]))
    half = memory.at(np.array([0.05, -9.0]))
    assert abs(np.angle(np.exp(1j * (half[0, 2] - np.pi)))) < 1e-9
    assert half[1].tolist() == [1, 0, 0]


# ---- on a setpoint ---------------------------------------------------------------------------------------------


@given(st.floats(-0.3, 0.3), st.floats(-0.5, 0.5), st.floats(-0.7, 0.7), st.floats(-0.3, 0.3), st.booleans())
@settings(max_examples=30)
def test_a_robot_comes_to_its_place_and_stays_on_it(ahead, left, heading, turn, sideways):
    """The place drives a circle, or goes on with its nose to one side, as a place at the edge of a shape does."""
    velocity = np.array([[0.6, 0.2 * sideways, turn]])
    place = np.zeros((1, 3))
    pose = np.array([[ahead, left, heading]])
    for _ in range(1500):
        told = track(place, velocity, pose)
        pose = drive_arcs(pose, np.clip(told, [-1.0, -2.0], [1.0, 2.0]), 0.02)
        step = complex(*velocity[0, :2]) * np.exp(1j * place[0, 2])
        place = place + 0.02 * np.array([step.real, step.imag, turn])
    assert np.hypot(*(pose - place)[0, :2]) < 0.03


def test_a_robot_whose_place_stands_does_not_turn():
    told = track(np.array([[0.2, 0.5, 1.0]]), np.zeros((1, 3)), np.zeros((1, 3)))
    assert told[0, 1] == 0
    assert told[0, 0] == pytest.approx(1.5 * 0.2)


# ---- the swinging turn command ---------------------------------------------------------------------------------


@given(st.floats(0.05, 2), st.floats(0, 2 * np.pi), st.floats(1e-4, 1e-2))
def test_the_turn_away_from_an_obstacle_has_no_jump_but_straight_ahead(size, angle, small):
    if abs(angle - np.pi) < 0.02:
        return
    first, second = (avoidance(size * np.array([[[np.cos(a), np.sin(a)]]]))[0] for a in (angle, angle + small))
    assert abs(first - second) <= 2 * size * (1 + np.pi) * small + 1e-9


@pytest.mark.parametrize("model", [HUSKY, TRADR])
def test_robots_side_by_side_do_not_swing_when_they_stand(model):
    """At the end of 7.1, with scans 300 ms old, each sees the other abeam, where sgn(Fx) would jump for ever."""
    _, _, recording = dance(LISTINGS["7_1"], model, after=5.0)
    last = recording.commands[-31:-1, :, 1]
    assert np.ptp(last, axis=0).max() < 0.02
    assert np.abs(recording.twists[-1]).max() < 0.02


# ---- choreographies --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["7_1", "7_2", "7_3"])
@pytest.mark.parametrize("model", [HUSKY, TRADR])
def test_scenarios_of_the_thesis_are_danced_without_touching(name, model):
    show, simulation, recording = dance(LISTINGS[name], model)
    assert show.done
    assert not simulation.collisions
    assert not show.state.errors.failed.any()
    # In place; a leader stops at once and a robot does not, and nobody reverses to its place.
    assert (np.abs(recording.gaps[-1] - recording.leaders[-1, :, 2]) < 0.15).all()


def test_a_dancer_puts_late_points_where_they_are_now():
    """Seen 1.25 m ahead, and 0.3 m nearer since: too close to drive on, which it would not be otherwise."""
    robot = ChoreographySimulationDriver(Choreography(parse("robots R1\nrow R1 0 0\nmove 5 0"), HUSKY))
    for time in (0.0, 0.3):
        pose, stamp = np.array([[time - 0.5, 0.0, 0.0]]), np.array([time - 0.3])
        seen = [np.array([[1.25, 0.0]])] if time else [np.empty((0, 2))]
        told = robot.step(Observation(time, pose, np.zeros((1, 2)), seen, stamp, stamp + 0.3, np.array([True])))
        assert (told[0, 0] == 0) == bool(time)
    assert robot.choreography.blocked[0]


@pytest.mark.parametrize(("name", "model", "which", "ticks"), [("7_1", HUSKY, 0, 110), ("6_3", TRADR, 3, 600)])
def test_a_robot_of_its_own_does_what_it_does_among_all(name, model, which, ticks):
    """What a rank does: one robot that knows its own pose and points alone gives the same commands."""
    text = LISTINGS[name]
    whole, alone = (
        ChoreographySimulationDriver(Choreography(parse(text), model)),
        ChoreographySimulationDriver(Choreography(parse(text), model, here=[which])),
    )
    simulation = Simulation(World(), model, whole.choreography.slot_poses())
    for _ in range(ticks):
        sensed = simulation.sense()
        told = whole.step(sensed)
        one = slice(which, which + 1)
        part = sensed._replace(**{
            name: getattr(sensed, name)[one] for name in ("poses", "twists", "points", "stamps", "arrivals", "new")
        })  # fmt: skip
        assert (alone.step(part)[0] == told[which]).all()
        simulation.step(told)
    assert alone.choreography.state.errors.failed.tolist() == [i != which for i in range(len(simulation))]


def test_a_column_keeps_to_its_path_though_its_robots_see_each_other():
    text = "robots R1 R2 R3 R4\ncolumn R1;R2;R3;R4 2 0\nmove 5 0\ncircle 4 90 0.1\nmove 5 0"
    path = ideal_run(Choreography(parse(text), HUSKY)).poses[..., :2]
    _, simulation, recording = dance(text, world=World(), until=40)
    assert not simulation.collisions
    for i in range(4):  # with a field that fellow robots push in, the last one is 0.7 m off
        off = np.hypot(*np.moveaxis(recording.poses[:, None, i, :2] - path[None, :, i], -1, 0)).min(axis=1)
        assert off.max() < 0.15


def test_a_robot_that_turns_along_a_wall_does_not_touch_it():
    """Up to a slanting wall, and round by 130°: without signals for turns a corner touches it after 8 s."""
    middle, along = np.array([1.495, 0.0]), 8 * np.array([np.sin(-0.952), np.cos(-0.952)])
    world = World([[middle - along, middle + along]])
    _, simulation, _ = dance("robots R1\nrow R1 0 0\nmove 2.93 0\nmove 2.94 -130", world=world, until=20)
    assert not simulation.collisions


def test_a_silent_sensor_ends_its_robot_and_is_in_the_recording():
    def silence(simulation):
        simulation.silence(0, simulation.time >= 0.95)

    show, simulation, recording = dance("robots R1 R2\nrow R1,R2 0 2\nmove 4 0", until=12, change=silence)
    assert show.state.errors.failed.tolist() == [True, False]
    [event] = [event for event in recording.events if event.kind is EventKind.ERROR_STATE]
    assert event.robot == 0
    # The last scan, of 1.0 s, comes at 1.3 s; more than 0.3 s later nothing has come.
    assert event.time == pytest.approx(1.7)
    assert (recording.commands[18:-1, 0] == 0).all()
    assert simulation.poses[0, 0] < 1.5
    assert simulation.poses[1, 0] > 3


def test_a_robot_waits_for_an_obstacle_and_says_so():
    show, simulation, recording = dance(
        "robots R1\nrow R1 0 0\nmove 5 0", world=World([], [box((3, 0), (0.2, 0.5))]), until=15
    )
    assert not simulation.collisions
    assert [event for event in recording.events if event.kind is EventKind.STOP]
    assert show.blocked[0]
    assert simulation.poses[0, 0] + HUSKY.length / 2 < 2.9


def test_the_picture_of_speeds_shows_the_distance_to_the_leader():
    _, _, recording = dance(LISTINGS["7_1"], until=3)
    lines = {line.get_gid(): line for axes in speeds_figure(recording).axes for line in axes.get_lines()}
    np.testing.assert_array_equal(lines["leader distance 2"].get_ydata(), recording.gaps[:, 1])
    assert set(lines["wanted distance 2"].get_ydata()) == {0.5}


# ---- by dynamics -----------------------------------------------------------------------------------------------


def test_followers_go_round_an_obstacle_that_nobody_knew_and_come_back():
    _, simulation, recording = march("line", 3, [disc((6, 0.1), 0.4)])
    assert not simulation.collisions
    assert not [event for event in recording.events if event.kind is EventKind.CONTACT]
    assert np.abs(recording.poses[:, :, 1]).max(axis=0).min() > 0.8
    np.testing.assert_allclose(recording.poses[-1, 0, :2], [12, 0], atol=0.1)
    assert recording.gaps.max() < 0.2


@pytest.mark.parametrize("shape", ["line", "triangle", "row", "box", "square", "polygon", "column"])
def test_fellow_robots_are_no_obstacles(shape):
    """Without obstacles nobody is pushed, though everybody sees the others, as they were 0.3 s ago."""
    spacing = 2.5 if shape in ("row", "triangle", "square") else 2.0
    march_, simulation, recording = march(shape, 3, until=8, spacing=spacing)
    assert not simulation.collisions
    assert np.abs(march_.state.displacement.value[:, :2]).max() < 1e-9
    assert np.hypot(*(recording.gaps.T)).max() < np.inf
    assert recording.gaps.max() < 0.05


def test_a_fast_predecessor_is_none_either():
    """It has driven on by 0.3 m since it was seen, which is more than it may be off its place."""
    path = waypoints([[0, 0], [12, 0]], limits=Limits(speed=0.99))
    march_, _, recording = march("line", 3, until=8, path=path)
    assert np.abs(march_.state.displacement.value[:, :2]).max() < 1e-9
    assert np.abs(recording.poses[..., 1]).max() < 1e-6


def test_a_silent_sensor_stops_its_robot_and_the_one_behind_does_not_run_into_it():
    def silence(simulation):
        simulation.silence(1, simulation.time >= 1.95)

    march_, simulation, recording = march("line", 3, until=14, change=silence)
    assert march_.state.errors.failed.tolist() == [False, True, False]
    assert [event.robot for event in recording.events if event.kind is EventKind.ERROR_STATE] == [1]
    assert (recording.commands[30:-1, 1] == 0).all()
    assert simulation.poses[0, 0] > 5
    # The one behind goes round it or stands behind it.
    assert not simulation.collisions


def test_an_obstacle_inside_a_robots_radius_is_told_and_a_wall_across_the_path_stops_it():
    _, simulation, recording = march("line", 2, [box((4, 0), (0.1, 12))], until=12)
    kinds = [event.kind for event in recording.events]
    assert EventKind.STOP in kinds
    assert not simulation.collisions
    assert np.isfinite(recording.poses).all()


def test_a_leader_without_a_path_stands_and_so_do_all():
    _, simulation, _ = march("line", 3, until=3, path=None)
    np.testing.assert_allclose(simulation.poses, Formation.of("line", 3).layout.poses(np.zeros(3)), atol=1e-9)


def test_two_robots_in_one_place_are_refused():
    with pytest.raises(InputError, match="robot 1 touches robot 2 at the start"):
        dance("robots R1 R2\ncolumn R1;R2 0.5 0\nmove 2 0")
    with pytest.raises(InputError, match="line 2, column 13: spacings in a row: got 0 m, expected more than 0"):
        dance("robots R1 R2\nrow R1,R2 0 0\nmove 2 0")


# ---- check -----------------------------------------------------------------------------------------------------


def test_check_finds_what_a_simulation_shows():
    wall = parse_world("[[box]]\ncentre = [2.0, 0.6]\nsize = [0.2, 0.2]\n[[wall]]\npoints = [[0, -1.0], [6, -1.0]]")
    found = check("robots R1 R2\nrow R1,R2 0 1.2\nmove 4 0", HUSKY, wall)
    said = [(finding.kind, finding.robots, finding.serious) for finding in found.findings]
    assert ("stop", ("R1",), False) in said
    close = next(finding for finding in found.findings if "within" in finding.message)
    assert close.robots == ("R2",)
    assert close.serious
    assert close.place is not None and close.time is not None
    nothing = check("robots R1 R2\nrow R1,R2 0 1.2\nmove 4 0", HUSKY, World())
    assert nothing.findings == []
    assert nothing.run.done


def test_check_finds_who_drives_into_whom():
    text = "robots R1 R2\ngroups\na R1\nb R2\nstart\nrow R1,R2 0 1.2\nmove 1 0\nrow R1 0 0\nrow R2 0 0\nnewVL\n"
    text += "move 3 -80 a\nmove 3 80 b"
    found = check(text, HUSKY, World())
    met = [finding for finding in found.findings if "drives into" in finding.message]
    ideal = [finding for finding in found.findings if "come closer" in finding.message]
    assert met or ideal
    assert all(finding.serious and set(finding.robots) == {"R1", "R2"} for finding in met + ideal)


def test_check_of_a_wrong_text_simulates_nothing():
    found = check("robots R1\nrow R1 0 0\nmove 1", HUSKY, World())
    assert found.run is None
    assert found.findings
    with pytest.raises(InputError, match="world: got str, expected a World"):
        check("robots R1\nrow R1 0 0\nmove 1 0", HUSKY, "hall")


# ---- any files -------------------------------------------------------------------------------------------------

NUMBERS = st.sampled_from(["0", "1", "-1", "2", "0.5", "1.2", "-90", "90", "270", "1e9", "-0", "nan", "0.1", "3"])
NAMES = st.sampled_from(["R1", "R2", "R1,R2", "R1;R2", "R3", "a", "#"])
WORDS = st.sampled_from(["move", "circle", "row", "column", "newVL", "robots", "groups", "start", "triangle"])
LINES = st.lists(st.one_of(WORDS, NUMBERS, NAMES), max_size=4).map(" ".join)
KINDS = st.sampled_from(["wall", "room", "box", "disc", "polygon", "name"])
FIELDS = st.sampled_from(["centre", "size", "radius", "points", "heading", "sides"])
PAIRS = st.lists(NUMBERS, max_size=3).map(lambda numbers: "[" + ", ".join(numbers) + "]")
VALUES = st.one_of(PAIRS, NUMBERS, st.lists(PAIRS, max_size=4).map(lambda pairs: "[" + ", ".join(pairs) + "]"))
ENTRIES = st.builds(
    lambda kind, fields: f"[[{kind}]]\n" + "\n".join(f"{name} = {value}" for name, value in fields.items()),
    KINDS,
    st.dictionaries(FIELDS, VALUES, max_size=3),
)


@given(st.lists(ENTRIES, max_size=3), st.sampled_from(["line", "row", "box"]))
@settings(max_examples=40, deadline=None)
def test_a_march_in_any_world_is_a_run_or_a_clear_error(entries, shape):
    formation = Formation.of(shape, 3)
    robots = FormationSimulationDriver(FormationController(formation, PATH), HUSKY)
    try:
        world = parse_world("\n".join(entries))
        simulation = Simulation(world, HUSKY, formation.layout.poses(np.zeros(3)))
    except InputError as error:
        assert str(error)
        return
    _, recording = drive(simulation, robots, 5.0)
    assert np.isfinite(recording.poses).all()
    assert (np.abs(recording.commands[:-1]) <= [HUSKY.max_speed, HUSKY.max_turn_rate]).all()


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_any_scenario_in_any_world_is_a_run_or_a_clear_error(data):
    lines = LISTINGS[data.draw(st.sampled_from(["7_1", "7_3", "7_4"]))].splitlines()
    for _ in range(data.draw(st.integers(0, 2))):
        lines.insert(data.draw(st.integers(0, len(lines))), data.draw(LINES))
    if data.draw(st.booleans()):
        lines.pop(data.draw(st.integers(0, len(lines) - 1)))
    world = "\n".join(data.draw(st.lists(ENTRIES, max_size=2)))
    try:
        _, simulation, recording = dance("\n".join(lines), world=parse_world(world), until=6.0)
    except InputError as error:
        assert str(error)
        return
    for values in (recording.poses, recording.twists, recording.commands[:-1]):
        assert np.isfinite(values).all()
    assert (np.abs(recording.commands[:-1]) <= [HUSKY.max_speed, HUSKY.max_turn_rate]).all()
    assert simulation.time <= 6.0 + 1e-9
