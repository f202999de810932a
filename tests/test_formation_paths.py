"""Paths: derivatives, limits, ends; curves by arc length."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mp2a import InputError
from mp2a.formation import Arc, Limits, Line, lines_and_arcs, spline, waypoints
from mp2a.formation.vectors import as_complex
from mp2a.se2 import wrap

LIMITS = Limits(speed=1.0, turn_rate=0.6, acceleration=0.4)
PATHS = {
    "waypoints": waypoints([[0, 0], [6, 0], [6, 5], [2, 7]], 1.5, LIMITS),
    "a corner too tight for its radius": waypoints([[0, 0], [1, 0], [1, 1], [2, 1]], 3.0, LIMITS),
    "straight": waypoints([[1, 2], [2, 4], [3, 6]], 1.0, LIMITS),
    "lines and arcs": lines_and_arcs([Line(2), Arc(1.5, -2.0), Line(0.5), Arc(0.4, 1.0)], (1, 2, 0.3), LIMITS),
    "full circle": lines_and_arcs([Arc(2.0, 2 * np.pi)], limits=LIMITS),
    "spline": spline([[0, 0], [4, 1], [6, 5], [2, 7]], LIMITS),
    "spline of two points": spline([[0, 0], [3, 4]], LIMITS),
}
places = st.floats(-20, 20, allow_nan=False).map(lambda x: round(x, 2))


@pytest.fixture(params=PATHS.values(), ids=PATHS.keys())
def path(request):
    return request.param


def times(path, margin=1e-3):
    return np.linspace(margin, path.duration - margin, 400)


def test_velocity_is_the_derivative_of_the_pose(path):
    step = 1e-5
    for time in times(path):
        before, now, after = (path.at(time + shift) for shift in (-step, 0, step))
        velocity = (as_complex(after.pose) - as_complex(before.pose)) / (2 * step) * np.exp(-1j * now.pose[2])
        assert abs(velocity - as_complex(now.velocity)) < 1e-4
        assert now.velocity[1] == 0
        assert abs(wrap(after.pose[2] - before.pose[2]) / (2 * step) - now.velocity[2]) < 0.5 * LIMITS.turn_rate
        # Turn rate and speed have corners, but almost nowhere.


def test_rates_are_derivatives_except_at_corners(path):
    step = 1e-6
    errors = []
    for time in times(path):
        before, now, after = (path.at(time + shift) for shift in (-step, 0, step))
        turn_rate = wrap(after.pose[2] - before.pose[2]) / (2 * step)
        errors.append(
            (abs(turn_rate - now.velocity[2]), *abs((after.velocity - before.velocity) / 2 / step - now.rate))
        )
    assert np.mean(np.max(errors, axis=1) < 1e-4) > 0.97


def test_limits_are_kept_and_used(path):
    motions = [path.at(time) for time in times(path)]
    speed = np.array([motion.velocity[0] for motion in motions])
    turn_rate = np.abs([motion.velocity[2] for motion in motions])
    acceleration = np.abs([motion.rate[0] for motion in motions])
    assert (speed > 0).all()
    assert speed.max() <= LIMITS.speed * (1 + 1e-9)
    assert turn_rate.max() <= LIMITS.turn_rate * (1 + 1e-3)
    assert acceleration.max() <= LIMITS.acceleration * (1 + 1e-9)
    # At every time one of the three is at its limit: nothing is slower than it has to be.
    used = np.maximum.reduce([speed / LIMITS.speed, turn_rate / LIMITS.turn_rate, acceleration / LIMITS.acceleration])
    assert np.mean(used > 0.97) > 0.9


def test_a_path_rests_before_its_start_and_after_its_end(path):
    for time in (-1.0, 0.0, path.duration, path.duration + 5):
        motion = path.at(time)
        assert (motion.velocity == 0).all()
    distance = np.abs(np.diff([as_complex(path.at(time).pose) for time in np.linspace(0, path.duration, 1500)])).sum()
    assert abs(distance - path.length) < 1e-3 * path.length


def test_waypoints_begin_and_end_at_the_points_and_pass_corners_within_their_arcs():
    points = np.array([[0, 0], [6, 0], [6, 5], [2, 7]])
    path = PATHS["waypoints"]
    assert np.allclose(path.at(0).pose, [0, 0, 0])
    assert np.allclose(path.at(path.duration).pose[:2], points[-1])
    track = np.array([path.at(time).pose[:2] for time in np.linspace(0, path.duration, 2000)])
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        turn = np.angle(complex(*(after - corner)) / complex(*(corner - before)))
        nearest = np.hypot(*(track - corner).T).min()
        assert abs(nearest - 1.5 * (1 / np.cos(turn / 2) - 1)) < 1e-2


def test_spline_goes_through_its_points():
    points = np.array([[0, 0], [4, 1], [6, 5], [2, 7]])
    path = PATHS["spline"]
    track = np.array([path.at(time).pose[:2] for time in np.linspace(0, path.duration, 4000)])
    for corner in points:
        assert np.hypot(*(track - corner).T).min() < 3e-3


@given(st.lists(st.tuples(places, places), min_size=2, max_size=7), st.floats(0.1, 5))
def test_any_waypoints_make_a_path_or_an_error(points, radius):
    try:
        path = waypoints(points, radius, LIMITS)
    except InputError:
        ways = np.diff(np.array(points) @ [1, 1j])
        assert (np.abs(ways) < 1e-9).any() or (np.abs(np.angle(ways[1:] / ways[:-1])) > np.pi - 1e-5).any()
        return
    assert np.allclose(path.at(path.duration).pose[:2], points[-1], atol=1e-6)
    assert np.isfinite(path.duration)
    for time in np.linspace(0, path.duration, 50):
        assert abs(path.at(time).velocity[2]) <= LIMITS.turn_rate * (1 + 1e-6)


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: waypoints([[0, 0]]), "points: got 1, expected at least two"),
        (lambda: waypoints([[0, 0], [0, 0]]), r"points: got \[0.0, 0.0\] twice in sequence"),
        (lambda: waypoints([[0, 0], [1, 0], [0, 0]]), "turns right back at point 1"),
        (lambda: waypoints([[0, 0], [1, 0]], radius=0), "radius: got 0"),
        (lambda: waypoints([[0, 0, 1]]), "points: got shape"),
        (lambda: spline([[0, np.nan], [1, 0]]), "points: got nan"),
        (lambda: lines_and_arcs([]), "pieces: got none"),
        (lambda: lines_and_arcs([Line(-1)]), "positive length"),
        (lambda: lines_and_arcs([Arc(-1, -1)]), "positive length and radius"),
        (lambda: Limits(speed=0), "speed: got 0"),
        (lambda: Limits(turn_rate=np.nan), "turn_rate: got nan"),
    ],
)
def test_bad_paths_are_refused(make, error):
    with pytest.raises(InputError, match=error):
        make()
