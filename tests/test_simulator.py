"""Simulated robots: the laws their motion, their contacts and their sensors keep."""

import sys
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from mp2a.exceptions import DependencyError, InputError
from mp2a.formation.robot_models import HUSKY, TRADR
from mp2a.simulator import (
    NO_SLIP,
    PHYSICS_ENGINE_SLIP,
    Lidar,
    RunRecorder,
    Simulation,
    TurnSlip,
    World,
    box,
    disc,
    simulate,
)
from mp2a.simulator.contacts import Contacts
from mp2a.simulator.lidar import ranges, scan_points
from mp2a.simulator.vehicle import drive_arcs, respond
from mp2a.simulator.world import rectangles

WALLS = np.array([[-4.0, -3], [5, -3], [5, 3], [-4, 3], [-4, -3]])
ROOM = World([WALLS], [box((2, 1), (0.8, 0.5), 0.4), disc((3, -1), 0.4)])
EMPTY = World()
SILENCE = [[np.nan, np.nan]]


def drive(simulation, command, seconds):
    """Give all robots one command at every tick."""
    for _ in range(round(seconds / 0.1)):
        simulation.step(np.tile(np.asarray(command, dtype=float), (len(simulation), 1)))


def separated(a, b):
    """Whether a side of one of two convex outlines has the other outline on its far side (separating axis theorem)."""
    for first, second in ((a, b), (b, a)):
        for k in range(len(first)):
            along = first[(k + 1) % len(first)] - first[k]
            normal = np.array([along[1], -along[0]])
            if ((second - first[k]) @ normal).min() > 0:
                return True
    return False


# Motion


@given(st.floats(-1, 1), st.floats(-2, 2), st.floats(-4, 4))
def test_constant_twist_drives_a_circle(speed, rate, heading):
    start = np.array([[1.0, -2.0, heading]])
    pose, twist = start, np.array([[speed, rate]])
    for _ in range(7):
        pose = drive_arcs(pose, twist, 0.37)
    once = drive_arcs(start, twist, 7 * 0.37)
    assert_allclose(pose, once, atol=1e-12)
    if abs(rate) > 1e-3:
        radius = speed / rate
        centre = start[0, :2] + radius * np.array([-np.sin(heading), np.cos(heading)])
        assert_allclose(np.linalg.norm(once[0, :2] - centre), abs(radius), atol=1e-9)
        assert_allclose(once[0, 2], heading + rate * 7 * 0.37)


def test_commanded_circle_has_radius_of_speed_over_turn_rate():
    simulation = Simulation(EMPTY, HUSKY, [[0, 0, 0]], slip=NO_SLIP)
    drive(simulation, (0.6, 0.5), 1)
    x, y, heading = simulation.poses[0]
    centre = np.array([x - 1.2 * np.sin(heading), y + 1.2 * np.cos(heading)])
    for _ in range(30):
        drive(simulation, (0.6, 0.5), 0.1)
        assert np.linalg.norm(simulation.poses[0, :2] - centre) == pytest.approx(1.2, abs=1e-12)


@pytest.mark.parametrize(
    ("slip", "speed", "rate"),
    [
        (PHYSICS_ENGINE_SLIP, 0.0, 0.417),
        (PHYSICS_ENGINE_SLIP, 0.5, 0.161),
        (TurnSlip(), 0.5, 0.417),
        (NO_SLIP, 0.5, 0.5),
    ],
)
def test_slip_gives_the_turn_rates_it_was_measured_with(slip, speed, rate):
    simulation = Simulation(EMPTY, HUSKY, [[0, 0, 0]], slip=slip)
    drive(simulation, (speed, 0.5), 2)
    assert_allclose(simulation.twists, [[speed, rate]], rtol=1e-12)


twist = st.tuples(st.floats(-3, 3), st.floats(-6, 6))


@given(st.lists(st.tuples(twist, twist, st.floats(0.01, 0.3)), min_size=1, max_size=15))
def test_limits_are_never_exceeded(steps):
    models = (HUSKY, TRADR)
    simulation = Simulation(EMPTY, models, [[0, 0, 0], [0, 90, 1]], slip=PHYSICS_ENGINE_SLIP)
    fastest = np.array([(m.max_speed, m.max_turn_rate) for m in models])
    most = np.array([(m.max_acceleration, m.max_turn_acceleration) for m in models])
    for first, second, dt in steps:
        before, start = simulation.twists, simulation.poses
        simulation.step([first, second], dt)
        change, moved = simulation.twists - before, simulation.poses - start
        assert (abs(simulation.twists) <= fastest + 1e-12).all()
        assert (abs(change) <= most * dt + 1e-12).all()
        # What was driven fits the speeds at both ends: no pose jumps.
        assert (np.hypot(*moved[:, :2].T) <= fastest[:, 0] * dt + 1e-12).all()
        mean = (before + simulation.twists) / 2
        assert (abs(moved[:, 2] - mean[:, 1] * dt) <= most[:, 1] * dt**2 / 2 + 1e-12).all()


@given(st.floats(0.05, 1))
def test_braking_distance(speed):
    simulation = Simulation(EMPTY, replace(HUSKY, max_acceleration=0.4), [[0, 0, 0]])
    drive(simulation, (speed, 0), 4)
    start = simulation.poses[0, 0]
    drive(simulation, (0, 0), 4)
    assert simulation.twists[0, 0] == 0
    assert simulation.poses[0, 0] - start == pytest.approx(speed**2 / 0.8, rel=1e-9)


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.1, 4), st.floats(0.01, 3))
def test_response_does_not_depend_on_how_time_is_cut(now, wanted, most, dt):
    now, wanted, most = (np.array([[x, -x]]) for x in (now, wanted, most))
    whole = respond(now, wanted, abs(most), dt)
    first = respond(now, wanted, abs(most), 0.3 * dt)
    second = respond(first.end, wanted, abs(most), 0.7 * dt)
    assert_allclose(second.end, whole.end, atol=1e-12)
    assert_allclose(0.3 * first.mean + 0.7 * second.mean, whole.mean, atol=1e-12)


def test_robot_that_hears_nothing_stops_after_its_timeout():
    simulation = Simulation(EMPTY, HUSKY, [[0, 0, 0], [0, 5, 0]], timeout=0.25)
    drive(simulation, (0.5, 0), 1)
    heard = simulation.time - 0.1
    while simulation.twists[0, 0] > 0:
        assert_allclose(simulation.twists[1], [0.5, 0])
        simulation.step([*SILENCE, [0.5, 0]], 0.02)
        assert simulation.twists[0, 0] == 0.5 or simulation.time - heard > 0.25
    assert simulation.time - heard <= 0.25 + 0.02 + 0.5 / HUSKY.max_acceleration + 0.02
    drive(simulation, (0.5, 0), 1)
    assert_allclose(simulation.twists[:, 0], 0.5)


# Contacts


@given(st.integers(0, 2**32), st.integers(2, 12))
def test_rectangles_touch_when_shapely_and_the_separating_axes_say_so(seed, n):
    rng = np.random.default_rng(seed)
    poses = rng.uniform((-2, -2, -4), (2, 2, 4), (n, 3))
    lengths, widths = rng.uniform(0.2, 1.5, (2, n))
    found = {(int(i), int(j)) for i, j in Contacts(ROOM, lengths, widths).touching(poses)}
    corners = rectangles(poses, lengths, widths)
    outlines = [shapely.Polygon(c) for c in corners]
    pairs = {(i, j) for i in range(n) for j in range(i) if not separated(corners[i], corners[j])}
    assert {(j, i) for i, j in pairs} == {(i, j) for i, j in found if j < n}
    shapes = [(i, k) for i in range(n) for k, shape in enumerate(ROOM.shapes) if outlines[i].intersects(shape)]
    assert set(shapes) == {(i, j - n) for i, j in found if j >= n}


@settings(max_examples=20)
@given(st.floats(-1, 1), st.floats(0.5, 1))
def test_wall_stops_a_robot_at_its_outline(heading, speed):
    wall = World([[[4, -20], [4, 20]]])
    simulation = Simulation(wall, HUSKY, [[0, 0, heading]])
    drive(simulation, (speed, 0), 4 / (speed * np.cos(heading)))
    front = rectangles(simulation.poses, np.array([HUSKY.length]), np.array([HUSKY.width]))[0, :, 0].max()
    assert 4 - 1e-4 < front < 4
    [collision] = simulation.collisions
    assert (collision.robot, collision.other) == (0, None)
    assert collision.place[0] == pytest.approx(4, abs=1e-4)
    assert abs(simulation.twists[0, 0]) < 0.1
    assert collision.text(["R1"]).startswith("R1 drives into a wall")
    drive(simulation, (-speed, 0), 1)
    assert simulation.twists[0, 0] == pytest.approx(-speed)


def test_robots_that_meet_stop_and_the_time_is_told():
    simulation = Simulation(EMPTY, (HUSKY, TRADR, HUSKY), [[0, 0, 0], [4, 0, np.pi], [0, 5, 0]], slip=NO_SLIP)
    drive(simulation, (0.5, 0), 5)
    gap = 4 - (HUSKY.length + TRADR.length) / 2
    [collision] = simulation.collisions
    assert (collision.robot, collision.other) == (0, 1)
    late = 0.5 / HUSKY.max_acceleration / 2 + 0.5 / TRADR.max_acceleration / 2  # lost while speeding up
    assert collision.time == pytest.approx(gap + late / 2, abs=0.03)
    assert simulation.poses[2, 0] > 2.3


def test_robot_driven_into_from_behind_goes_on():
    simulation = Simulation(EMPTY, HUSKY, [[1.5, 0, 0], [0, 0, 0]], slip=NO_SLIP)
    for _ in range(50):
        simulation.step([[0.3, 0], [0.6, 0]])
    assert simulation.twists[0, 0] == 0.3
    assert simulation.poses[0, 0] > 1.5 + 0.3 * 4.8
    [collision] = simulation.collisions
    assert (collision.robot, collision.other) == (1, 0)
    for _ in range(20):
        simulation.step([[0, 0], [-0.2, 0]])
    drive(simulation, (0, 0), 1)
    for _ in range(30):
        simulation.step([[0, 0], [0.6, 0]])
    assert [(found.robot, found.other) for found in simulation.collisions] == [(1, 0)] * 2


@settings(max_examples=20)
@given(st.integers(0, 2**32))
def test_nobody_ever_overlaps(seed):
    rng = np.random.default_rng(seed)
    poses = np.array([[x, y, rng.uniform(-4, 4)] for x in (-2.8, -1.3, 0.2) for y in (-1.6, 0, 1.6)])
    models = [HUSKY, TRADR] * 4 + [HUSKY]
    simulation = Simulation(ROOM, models, poses, slip=NO_SLIP)
    contacts = Contacts(ROOM, *np.array([(m.length, m.width) for m in models]).T)
    for _ in range(20):
        simulation.step(rng.uniform((-1, -2), (1, 2), (9, 2)), 0.3)
        assert not len(contacts.touching(simulation.poses))
    assert simulation.collisions


# The LIDAR


def brute_force(lidar, poses, lengths, widths, world):
    """Ranges by shapely, ray by ray."""
    bodies = [shapely.Polygon(c) for c in rectangles(poses, lengths, widths)]
    out = np.full((len(poses), lidar.rays), np.inf)
    for i, (x, y, heading) in enumerate(poses):
        here = shapely.Point(x, y)
        seen = shapely.union_all([*world.shapes, *bodies[:i], *bodies[i + 1 :]])
        for k in range(lidar.rays):
            angle = heading + 2 * np.pi * k / lidar.rays
            end = (x + lidar.farthest * np.cos(angle), y + lidar.farthest * np.sin(angle))
            cut = shapely.LineString([(x, y), end]).intersection(seen)
            if not cut.is_empty:
                out[i, k] = here.distance(cut)
    return out


@settings(max_examples=25)
@given(st.integers(0, 2**32), st.sampled_from([3, 16, 61]))
def test_ranges_are_those_of_brute_force(seed, rays):
    rng = np.random.default_rng(seed)
    poses = np.array([(-3, -2, 0), (-3, 2, 0), (0.5, 0, 0), (4.2, 2, 0)]) + rng.uniform(-0.4, 0.4, (4, 3)) * (1, 1, 9)
    lengths, widths = rng.uniform(0.3, 1, (2, 4))
    lidar = Lidar(rays=rays, farthest=6.0)
    found = ranges(lidar, poses, lengths, widths, ROOM.segments)
    expected = brute_force(lidar, poses, lengths, widths, ROOM)
    grazed = np.isfinite(found) != np.isfinite(expected)  # rays that end on a wall or graze a corner
    assert grazed.mean() < 0.02
    assert_allclose(found[~grazed], expected[~grazed], rtol=1e-9)


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-7, 7), st.integers(4, 300))
def test_no_ray_leaves_a_closed_room(x, y, heading, rays):
    room = World([np.array([[-2, -2], [2, -2], [2, 2], [-2, 2], [-2, -2.0]])])
    pose = np.array([[x, y, heading]])
    found = ranges(Lidar(rays=rays), pose, np.array([1.0]), np.array([0.5]), room.segments)
    assert np.isfinite(found).all()
    [seen] = scan_points(Lidar(rays=rays, nearest=0.0), found)
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    assert_allclose(abs(seen @ turn.T + (x, y)).max(axis=1), 2, atol=1e-9)


def test_rays_through_corners_and_along_walls_meet_them():
    cross = World([[[1, 0], [1, 1]], [[1, 0], [1, -1]], [[-3, 0], [-1, 0]]])
    found = ranges(Lidar(rays=4), np.zeros((1, 3)), np.ones(1), np.ones(1), cross.segments)
    assert found[0, 0] == 1  # exactly through the end the first two share
    assert np.isinf(found[0, 1:]).all()  # a wall seen from its end is thinner than any ray


def test_what_is_too_near_hides_what_is_behind_it():
    world = World([[[0.2, -1], [0.2, 1]], [[2, -9], [2, 9]], [[-30, -1], [-30, 1]]])
    lidar = Lidar(rays=4)
    found = ranges(lidar, np.zeros((1, 3)), np.ones(1), np.ones(1), world.segments)
    assert_allclose(found, [[0.2, np.inf, np.inf, np.inf]])
    assert [len(p) for p in scan_points(lidar, found)] == [0]


@pytest.mark.parametrize("delay", [0.0, 0.04, 0.2, 0.3])
def test_scans_are_as_old_as_the_delay_says(delay):
    wall = World([[[8, -5], [8, 5]]])
    simulation = Simulation(wall, HUSKY, [[0, 0, 0]], lidar=Lidar(delay=delay))
    places = {0.0: 0.0}
    before = -np.inf
    for _ in range(60):
        sensed = simulation.sense()
        assert sensed.new[0] == (sensed.stamps[0] > before)
        assert [points is not None for points in sensed.news] == [sensed.stamps[0] > before]
        before = sensed.stamps[0]
        age = simulation.time - sensed.stamps[0]
        assert delay - 1e-9 <= age < delay + 0.1 + 1e-9
        assert sensed.arrivals[0] <= simulation.time + 1e-9
        ahead = sensed.points[0][abs(sensed.points[0][:, 1]) < 1e-9]
        then = places[max(round(sensed.stamps[0], 2), 0.0)]
        assert ahead[ahead[:, 0] > 0, 0] == pytest.approx([8 - then], abs=1e-9)
        simulation.step([[0.5, 0]], 0.02)
        places[round(simulation.time, 2)] = simulation.poses[0, 0]


def test_silent_sensor_keeps_its_last_scan():
    simulation = Simulation(ROOM, HUSKY, [[-2, 0, 0], [0, 0, 0]])
    drive(simulation, (0, 0), 0.5)
    simulation.silence(1)
    before = simulation.sense()
    drive(simulation, (0, 0), 1)
    after = simulation.sense()
    assert after.new.tolist() == [True, False]
    assert after.stamps[0] == pytest.approx(before.stamps[0] + 1)
    assert after.stamps[1] == pytest.approx(0.5)  # taken when it fell silent, arrived 0.3 s later
    simulation.silence(1, False)
    drive(simulation, (0, 0), 0.5)
    assert simulation.sense().stamps[1] == pytest.approx(simulation.time - 0.3)


def test_noise_is_as_large_as_said_and_does_not_depend_on_who_asks():
    wall = World([disc((0, 0), 3.0, sides=360)])
    quiet, loud, seldom = (
        Simulation(wall, HUSKY, [[0, 0, 0]], lidar=Lidar(noise=noise), seed=3) for noise in (0.0, 0.05, 0.05)
    )
    errors = []
    for _ in range(20):
        true, seen = (np.linalg.norm(s.sense().points[0], axis=1) for s in (quiet, loud))
        errors.append(seen - true)
        for s in (quiet, loud, seldom):
            s.step([[0, 0]])
    assert np.std(errors) == pytest.approx(0.05, rel=0.05)
    assert_array_equal(seldom.sense().points[0], loud.sense().points[0])


# The whole


def test_same_calls_give_the_same_numbers():
    def once():
        simulation = Simulation(ROOM, HUSKY, [[-3, 0, 0], [0, 0, 1]], lidar=Lidar(noise=0.02), seed=5)
        recorder = RunRecorder(simulation)
        simulate(simulation, lambda sensed: [[0.5, sensed.points[0][0, 1]], [0.3, np.sin(sensed.time)]], 8, recorder)
        return recorder.recording()

    first, second = once(), once()
    for name in ("times", "poses", "twists", "commands", "points", "stamps"):
        assert_array_equal(getattr(first, name), getattr(second, name))
    assert first.events == second.events


def test_without_shapely_the_error_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "shapely", None)
    with pytest.raises(DependencyError, match=r"the simulator needs shapely.* pip install 'mp2a\[formation\]'"):
        Simulation(EMPTY, HUSKY, [[0, 0, 0]])
    with pytest.raises(DependencyError, match="the simulator needs shapely"):
        World(obstacles=[box((0, 0), (1, 1))])


def test_run_ends_when_time_is_up_or_the_controller_says_so():
    simulation = Simulation(EMPTY, HUSKY, [[0, 0, 0]])
    simulate(simulation, lambda sensed: [[0.1, 0]], 1.0)
    assert simulation.time == pytest.approx(1.0)
    simulate(simulation, lambda sensed: None if sensed.time > 2 else [[0.1, 0]], 100.0)
    assert simulation.time == pytest.approx(2.1, abs=0.1)


def free(**more):
    return Simulation(EMPTY, HUSKY, [[0, 0, 0]], **more)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Simulation(EMPTY, HUSKY, [[0, 0]]), "poses: got shape"),
        (lambda: Simulation(EMPTY, HUSKY, np.empty((0, 3))), "number of poses: got 0"),
        (lambda: Simulation(EMPTY, [HUSKY], np.zeros((2, 3))), "models: got 1 for 2 poses"),
        (lambda: Simulation(EMPTY, HUSKY, [[0, 0, 0], [0.9, 0, 0]]), "robot 1 touches robot 2 at the start"),
        (lambda: Simulation(ROOM, HUSKY, [[2, 1, 0]]), "robot 1 touches a wall or an obstacle"),
        (lambda: Simulation(World(obstacles=[box((0, 0), (9, 9))]), HUSKY, [[0, 0, 0]]), "touches a wall or an obst"),
        (lambda: free(timeout=0), "timeout: got 0"),
        (lambda: free(slip=TurnSlip(1.5)), "slip.standing: got 1.5"),
        (lambda: free(slip=TurnSlip(full_speed=-1)), "slip.full_speed: got -1"),
        (lambda: free(lidar=Lidar(rays=0)), "lidar.rays: got 0"),
        (lambda: free(lidar=Lidar(delay=-0.1)), "lidar.delay: got -0.1"),
        (lambda: free(lidar=Lidar(period=0)), "lidar.period: got 0"),
        (lambda: free(seed=-1), "seed: got -1"),
        (lambda: free().step([[0, 0]], 0), "dt: got 0, expected a number from 1e-06 to 60 s"),
        (lambda: free().step([[0, 0]], 1e-300), "dt: got 1e-300, expected a number from 1e-06 to 60 s"),
        (lambda: free().step([[0, 0]], 1e300), r"dt: got 1e\+300, expected a number from 1e-06 to 60 s"),
        (lambda: free(lidar=Lidar(period=1e-300)), "lidar.period: got 1e-300, expected a number from 0.001 to 1000 s"),
        (lambda: free(lidar=Lidar(delay=1e300)), r"lidar.delay: got 1e\+300, expected a number from 0 to 60 s"),
        (lambda: free(lidar=Lidar(rays=10**12)), "lidar.rays: got 1000000000000, expected a number from 1 to 100000"),
        (
            lambda: Simulation(EMPTY, replace(HUSKY, max_speed=1e300), [[0, 0, 0]]),
            r"max_speed of HUSKY: got 1e\+300, expected a number from 1e-06 to 100 m/s",
        ),
        (
            lambda: Simulation(EMPTY, replace(HUSKY, width=1e-300), [[0, 0, 0]]),
            "width of HUSKY: got 1e-300, expected a number from 0.01 to 100 m",
        ),
        (lambda: Simulation(EMPTY, HUSKY, [[1e300, 0, 0]]), r"poses: got 1e\+300 m, expected coordinates of at most"),
        (
            lambda: simulate(free(), lambda sensed: None, 1e300),
            r"until: got 1e\+300 s in ticks of 0.1 s, expected at most",
        ),
        (lambda: simulate(free(), lambda sensed: None, 1, tick=1e-300), "until: got 1 s in ticks of 1e-300 s"),
        (lambda: free().step([0, 0]), r"commands: got shape \(2,\), expected \(1, 2\)"),
        (lambda: free().step([[np.inf, 0]]), "commands: got .* for robot 1"),
        (lambda: free().step([[np.nan, 0]]), "commands: got .* for robot 1"),
        (lambda: free().silence(1), "robot: got 1, expected less than 1"),
        (lambda: simulate(free(), lambda sensed: None, -1), "until: got -1"),
    ],
)
def test_wrong_input_is_named(call, message):
    with pytest.raises(InputError, match=message):
        call()
