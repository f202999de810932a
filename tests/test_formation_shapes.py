"""Shapes and the multibody they make; motion in the plane against the library's own recurrences."""

import numpy as np
import pytest

import mp2a
from mp2a import InputError
from mp2a.formation import SHAPES, Formation
from mp2a.formation.shapes import Layout, centre, layout, rigid
from mp2a.se2 import PlanarMotion


def numbers(shape):
    return (3,) if shape == "box" else (1, 2, 3, 4, 5, 7, 9, 10, 16, 64)


def positions(shape, n, spacing=2.0):
    return layout(shape, n, spacing).poses(np.zeros(3))[:, :2] @ [1, 1j]


@pytest.mark.parametrize("shape", SHAPES)
def test_neighbours_are_a_spacing_apart_and_nobody_is_closer(shape):
    for n in numbers(shape):
        places = layout(shape, n, 2.0)
        assert (places.parents < np.arange(n)).all()
        assert places.parents[0] == -1
        assert (places.parents[1:] >= 0).all()
        at = positions(shape, n)
        apart = np.abs(at[:, None] - at) + 10 * np.eye(n)
        assert apart.min() > 2 - 1e-9
        if n > 1:
            assert np.allclose(apart.min(1), 2)
            assert np.allclose(np.abs(at[1:] - at[places.parents[1:]]), 2)
        assert (at.real <= 1e-9).all()  # nobody is ahead of the leader


def test_each_shape_is_what_its_name_says():
    n = np.arange(6)
    assert np.allclose(positions("line", 6), -2 * n)
    assert np.allclose(positions("column", 6), -2 * n)
    assert np.allclose(np.sort(positions("row", 5).imag), [-4, -2, 0, 2, 4])
    assert np.allclose(positions("row", 5).real, 0)
    assert np.unique(positions("triangle", 10).real.round(6), return_counts=True)[1].tolist() == [4, 3, 2, 1]
    square = positions("square", 9)
    assert sorted(set(zip(square.real.round(6), square.imag.round(6), strict=True))) == [
        (x, y) for x in (-4, -2, 0) for y in (-2, 0, 2)
    ]
    corners = positions("polygon", 7)
    assert np.allclose(np.abs(corners - corners.mean()), 1 / np.sin(np.pi / 7))
    triangle = positions("box", 3)
    assert np.allclose(np.abs(triangle - complex(*centre(layout("box", 3, 2.0)))), 2 / np.sqrt(3))


def test_only_the_line_follows():
    assert [shape for shape in SHAPES if layout(shape, 3, 1.0).follows] == ["line"]


def test_formation_is_a_chain_of_planar_joints():
    formation = Formation.of("triangle", 6, mass=np.arange(6) + 1.0, inertia=2.0)
    model = formation.model
    assert model.joints == ("planar",) * 6
    assert (model.masses == np.arange(6) + 1).all()
    assert (model.inertias[:, 2, 2] == 2).all()
    assert (model.parents == formation.layout.parents).all()
    q = PlanarMotion.at_rest(formation.layout.slots).coordinates().ravel()
    _, position = mp2a.placements(model, q)
    assert np.allclose(position[:, :2] @ [1, 1j], positions("triangle", 6))


@pytest.mark.parametrize("method", ["sweep", "compact"])
def test_planar_motion_is_that_of_the_recurrences(method):
    rng = np.random.default_rng(1)
    formation = Formation.of("line", 6)
    joints = PlanarMotion(*rng.normal(size=(3, 6, 3)))
    expected = []
    for i in range(6):
        joint = PlanarMotion(*(part[i] for part in joints))
        expected.append(expected[-1].compose(joint) if i else joint)
    done = mp2a.rnea(
        formation.model,
        joints.coordinates().ravel(),
        joints.velocity.ravel(),
        joints.rate.ravel(),
        method=method,
        bodies=True,
    )
    for i, motion in enumerate(expected):
        assert np.allclose(done.placement.translation[i, :2], motion.pose[:2])
        assert np.allclose(done.placement.rotation[i, :2, 0], [np.cos(motion.pose[2]), np.sin(motion.pose[2])])
        assert np.allclose(done.velocity[i, [3, 4, 2]], motion.velocity)
        vx, vy, spin = motion.velocity
        assert np.allclose(done.acceleration[i, [3, 4, 2]], motion.rate + spin * np.array([-vy, vx, 0]))


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: Formation.of("heart", 3), "shape: got 'heart', expected one of line, column, row"),
        (lambda: Formation.of("box", 4), "robots: got 4 for the shape 'box', expected 3"),
        (lambda: Formation.of("line", 0), "robots: got 0"),
        (lambda: Formation.of("line", 2, spacing=0), "spacing: got 0"),
        (lambda: Formation.of("line", 2, mass=-1.0), "masses: got -1.0 for robot 0"),
        (lambda: Formation.of("line", 2, mass=[1.0, 2.0, 3.0]), r"mass: got shape \(3,\), expected \(2,\)"),
        (lambda: Formation(rigid(np.array([-1, -1]), np.array([0, 1j])), np.ones(2), np.ones(2)), "parents: got"),
        (
            lambda: Formation(Layout(np.array([-1, 0]), np.zeros((2, 3)), follows=True), np.ones(2), np.ones(2)),
            "follower at no distance",
        ),
    ],
)
def test_bad_formations_are_refused(make, error):
    with pytest.raises(InputError, match=error):
        make()
