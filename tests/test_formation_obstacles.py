"""Eq. 14: its matrix as printed, directions, reach, packed points; the small world of discs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mp2a import InputError
from mp2a.formation import Discs, ObstacleLaw, SensedPoints, pack
from mp2a.formation.obstacles import eq14, push
from mp2a.formation.sensing import check_points

LAW = ObstacleLaw()
angles = st.floats(-np.pi, np.pi)


def one(point, aside=0.0, law=LAW):
    return complex(push(law, np.array([complex(point)]), np.zeros(1, dtype=int), np.array([aside]))[0])


@given(angles, st.floats(0, 1), st.floats(-2, 2), st.floats(0, 3), st.floats(0, 3))
def test_the_matrix_is_the_printed_one(direction, level, aside, tangential, attraction):
    law = ObstacleLaw(tangential=tangential, attraction=attraction, repulsion=0.7)
    ray = np.exp(1j * direction)
    got = eq14(law, np.array([level]), np.array([ray]), np.array([aside]))[0]
    phi = np.pi / 2 - direction  # from the ray to the path's normal
    turn = np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])
    normal = law.force * level
    matrix = turn @ np.diag([normal, -normal + tangential * normal]) @ turn.T
    towards = -np.sign(aside * ray.real)
    force = matrix @ [law.repulsion, attraction * aside**2 * towards]
    assert np.isclose(got, complex(*force) * ray, atol=1e-9)


@given(st.floats(-5, 5), st.floats(-2, 2), st.floats(-2, 2))
def test_a_force_is_finite_and_none_out_of_reach(x, y, aside):
    force = one(complex(x, y), aside)
    assert abs(force) <= LAW.force * np.hypot(LAW.repulsion, LAW.attraction * aside**2) * (1 + 1e-9)
    reach = np.hypot(x / (LAW.ahead if x > 0 else LAW.radius), y / LAW.beside)
    if reach > 1:
        assert force == 0
    elif reach < 0.999 and aside == 0:
        assert force.real == pytest.approx(0, abs=1e-9)  # C_T = C_N: to the side alone
        assert (force.imag > 0) == (y <= 1e-6)  # away from the obstacle; from one straight ahead, to the left


@given(st.floats(-1, 3.5), st.floats(1e-3, 1.3))
def test_the_law_is_the_same_on_both_sides(x, y):
    assert one(complex(x, y), 0.3) == pytest.approx(np.conj(one(complex(x, -y), -0.3)))


def test_attraction_leads_back_to_the_path():
    with_attraction, without = ObstacleLaw(attraction=0.3), ObstacleLaw(attraction=0.0)
    for aside in (0.5, -0.5):
        back = one(1 - 0.4j * np.sign(aside), aside, with_attraction) - one(1 - 0.4j * np.sign(aside), aside, without)
        assert back.imag * aside < 0


def test_more_tangential_force_holds_a_robot_back():
    held = one(1 - 0.3j, law=ObstacleLaw(tangential=1.5))
    assert held.real < 0 < held.imag


def test_closer_obstacles_push_harder_and_one_in_the_middle_pushes_left():
    forces = [one(x - 0.2j).imag for x in (3.5, 2.5, 1.5, 0.5, 0.0)]
    assert (np.diff(forces) > 0).all()
    assert one(0) == pytest.approx(1j * LAW.force)


def test_of_many_points_the_nearest_on_each_side_count_each_for_its_robot():
    points = np.array([1 + 0.7j, 1 + 0.9j, 1.5 + 0.8j, 1 - 0.6j, 2 - 0.7j, 1 + 0.7j, 9])
    robot = np.array([0, 0, 0, 0, 0, 2, 1])
    forces = push(LAW, points, robot, np.zeros(3))
    assert forces[0] == pytest.approx(one(1 + 0.7j) + one(1 - 0.6j))
    assert forces[1] == 0
    assert forces[2] == pytest.approx(one(1 + 0.7j))


@given(st.floats(1.3, 3), st.floats(-0.55, 0.55), st.floats(0.1, 0.6), st.integers(20, 60))
def test_an_obstacle_across_the_path_pushes_to_the_side_that_has_less_of_it(x, y, radius, many):
    disc = x + radius + 1j * y - radius * np.exp(1j * np.linspace(-1.5, 1.5, many))
    force = push(LAW, disc, np.zeros(many, dtype=int), np.zeros(1))[0]
    if abs(y) > 1e-3 or y == 0:
        assert force.imag * (-1 if y > 0 else 1) > 0
    # A cloud of it pushes no less than its nearest point, and no more than a point of the law may.
    nearest = abs(one(disc[np.abs(disc).argmin()]))
    assert 0.5 * nearest < abs(force.imag) <= LAW.force
    # Where a robot fits between two halves, each of them pushes.
    halves = np.array([x + 0.7j, x - 0.7j])
    assert push(LAW, halves, np.zeros(2, dtype=int), np.zeros(1))[0] == pytest.approx(0, abs=1e-9)


def test_points_are_packed_and_checked():
    sensed = pack([[[1, 2]], None, [], [[3, 4], [5, 6]]])
    assert sensed.points.tolist() == [[1, 2], [3, 4], [5, 6]]
    assert sensed.robot.tolist() == [0, 3, 3]
    assert sensed.heard.tolist() == [True, False, True, True]
    assert check_points(sensed, 4).robot.tolist() == [0, 3, 3]


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: pack([[[1, 2, 3]]]), r"points\[0\]: got shape"),
        (lambda: pack([None, [[1, np.inf]]]), r"points\[1\]: got inf"),
        (lambda: check_points(pack([[[1, 2]]]), 2), "heard: got shape"),
        (lambda: check_points(SensedPoints(np.zeros((1, 2)), np.array([5]), np.ones(2, bool)), 2), "robot: got 5 to 5"),
        (lambda: ObstacleLaw(ahead=0), "ahead: got 0"),
        (lambda: ObstacleLaw(force=-1), "force: got -1"),
        (lambda: ObstacleLaw(attraction=np.nan), "attraction: got nan"),
        (lambda: Discs([[0, 0, -1]]), "radius of -1"),
        (lambda: Discs([[0, 0]]), "discs: got shape"),
    ],
)
def test_bad_input_is_refused(make, error):
    with pytest.raises(InputError, match=error):
        make()


@given(st.floats(-4, 4), st.floats(-4, 4), angles)
def test_robots_see_the_nearest_point_of_a_disc_in_their_own_frame(x, y, heading):
    world = Discs([[1, 2, 0.5], [50, 0, 1]])
    pose = np.array([[x, y, heading]])
    sensed = world.sense(pose)
    assert sensed.heard.all()
    distance = abs(complex(x - 1, y - 2))
    assert len(sensed.points) == (distance - 0.5 < world.reach)
    for point in sensed.points:
        there = complex(x, y) + np.exp(1j * heading) * complex(*point)
        if distance > 0.502:
            assert abs(abs(there - (1 + 2j)) - 0.5) < 1e-9
            assert np.hypot(*point) == pytest.approx(distance - 0.5, abs=1e-9)
        else:  # inside, the point is right beside the robot, towards the middle
            assert np.hypot(*point) < 3e-3
            assert distance < 2e-3 or abs(there - (1 + 2j)) < distance
    assert world.clearance(pose)[0] == pytest.approx(min(distance - 0.5, abs(complex(x - 50, y)) - 1))


def test_a_world_without_discs_is_empty():
    world = Discs()
    assert len(world.sense(np.zeros((3, 3))).points) == 0
    assert (world.clearance(np.zeros((3, 3))) == np.inf).all()
