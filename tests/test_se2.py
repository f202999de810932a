"""SE(2): poses and planar motions are groups, and agree with matrices, with arcs and with derivatives in time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mp2a.se2 import (
    PlanarMotion,
    act,
    act_inverse,
    compose,
    drive,
    exp,
    inverse,
    mean_heading,
    relative,
    rotate,
    wrap,
)

NUMBER = st.floats(-20.0, 20.0)
POSE = arrays(float, (4, 3), elements=NUMBER)
POINT = arrays(float, (4, 2), elements=NUMBER)
MOTION = st.builds(PlanarMotion, POSE, POSE, POSE)
ZERO = np.zeros((4, 3))


def matrix(pose):
    """Homogeneous transforms ``(..., 3, 3)``."""
    out = np.zeros((*pose.shape[:-1], 3, 3))
    c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    out[..., 0, 0], out[..., 0, 1], out[..., 1, 0], out[..., 1, 1] = c, -s, s, c
    out[..., :2, 2], out[..., 2, 2] = pose[..., :2], 1.0
    return out


def close(got, expected, atol=1e-9):
    for one, other in zip(np.atleast_3d(got), np.atleast_3d(expected), strict=True):
        np.testing.assert_allclose(one, other, atol=atol)


@given(POSE, POSE, POSE)
def test_poses_are_a_group(a, b, c):
    close(compose(compose(a, b), c), compose(a, compose(b, c)))
    close(compose(a, ZERO), a)
    close(compose(ZERO, a), a)
    close(compose(a, inverse(a)), ZERO)
    close(compose(inverse(a), a), ZERO)
    close(relative(a, b), compose(inverse(a), b))
    close(compose(a, relative(a, b)), b)


@given(POSE, POSE, POINT)
def test_poses_act_on_points_as_their_matrices_do(a, b, points):
    close(matrix(compose(a, b)), matrix(a) @ matrix(b))
    close(act(a, points), (matrix(a) @ np.append(points, np.ones((4, 1)), 1)[..., None])[:, :2, 0])
    close(act(compose(a, b), points), act(a, act(b, points)))
    close(act_inverse(a, act(a, points)), points)
    close(rotate(a[:, 2], points), act(a * (0, 0, 1), points))


@given(MOTION, MOTION, MOTION)
def test_motions_are_a_group(a, b, c):
    still = PlanarMotion.at_rest(ZERO)
    large = 1e-6  # products of three rates of up to 20 and a length
    close(a.compose(b).compose(c), a.compose(b.compose(c)), large)
    close(a.compose(still), a)
    close(still.compose(a), a)
    close(a.compose(a.inverse()), still, large)
    close(a.inverse().compose(a), still, large)
    close(a.relative(b), a.inverse().compose(b), large)
    close(a.compose(a.relative(b)), b, large)


def test_motions_are_derivatives_of_poses():
    """Two frames with polynomial motion: velocity and rate of the child are differences of its poses in time."""
    rng = np.random.default_rng(3)
    parts = rng.normal(size=(2, 3, 3))  # of parent and joint: value, first and half the second derivative of a pose

    def motion(part, t):
        value, first, second = part
        pose, dot = value + t * first + t**2 * second, first + 2 * t * second
        spin, turned = dot[2], rotate(-pose[2], dot[:2])
        pull = rotate(-pose[2], 2 * second[:2]) - spin * np.array([-turned[1], turned[0]])
        return PlanarMotion(pose, np.append(turned, spin), np.append(pull, 2 * second[2]))

    def child(t):
        return motion(parts[0], t).compose(motion(parts[1], t))

    step = 1e-5
    before, now, after = child(-step), child(0.0), child(step)
    rates = (after.pose - before.pose) / (2 * step)
    np.testing.assert_allclose(np.append(rotate(-now.pose[2], rates[:2]), rates[2]), now.velocity, atol=1e-7)
    np.testing.assert_allclose((after.velocity - before.velocity) / (2 * step), now.rate, atol=1e-7)


@given(arrays(float, (4, 3), elements=NUMBER), st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_exp_is_a_one_parameter_group(twist, first, second):
    close(exp(twist * (first + second)), compose(exp(twist * first), exp(twist * second)))
    close(inverse(exp(twist)), exp(-twist))
    close(drive(twist[:, [0, 2]], first), exp(twist * (1, 0, 1) * first))


def test_driving_is_an_arc_of_a_circle():
    angle = np.array([-3.0, -1e-9, 0.0, 1e-9, 1.0, np.pi])
    pose = drive(np.column_stack((np.full(6, 2.0), angle)), 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        radius = 2.0 / angle
        circle = np.column_stack((radius * np.sin(angle), radius * (1 - np.cos(angle)), angle))
    circle[1:4] = [[2.0, x, x] for x in (-1e-9, 0.0, 1e-9)]
    np.testing.assert_allclose(pose, circle, atol=1e-12)
    seconds = np.array([0.5, 2.0])
    np.testing.assert_allclose(drive(np.full((2, 2), 0.5), seconds), [drive(np.full(2, 0.5), t) for t in seconds])


@given(arrays(float, 5, elements=st.floats(-1e3, 1e3)))
def test_wrapped_angles_are_the_same_directions(angles):
    got = wrap(angles)
    assert (np.abs(got) <= np.pi).all()
    np.testing.assert_allclose(np.exp(1j * got), np.exp(1j * angles), atol=1e-9)


def test_the_mean_of_headings_minds_the_seam():
    assert mean_heading(np.array([np.pi - 0.1, -np.pi + 0.3])) == pytest.approx(-np.pi + 0.1)


@given(POSE, POSE)
def test_arrays_of_other_shapes_are_broadcast(a, b):
    close(compose(a[0], b), [compose(a[0], one) for one in b])
    close(act(a[:, None], b[:, :2]), [act(one, b[:, :2]) for one in a])
    close(relative(a, b[0]), [relative(one, b[0]) for one in a])
