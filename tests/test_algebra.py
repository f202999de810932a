"""Pieces of chain form a monoid, and what they do to a force is what the bodies in them do together."""

import numpy as np
from helpers import ALL_JOINTS, relative_error
from hypothesis import given
from hypothesis import strategies as st

from mp2a import Model
from mp2a.algebra import affine, inertia, motion
from mp2a.joint_kinematics import joint_motion
from mp2a.spatial import body_force, force_to_parent, motion_to_child, spatial_to_classical
from mp2a.validation import check_state

seeds = st.integers(0, 2**32 - 1)


def piece(rng, *lead):
    """Random affine maps, matrices in rows."""
    return rng.normal(size=(*lead, 36)), rng.normal(size=(*lead, 6))


def compose(outer, inner):
    return affine.product(outer[0], inner[0]), affine.push(outer[0], inner[1], outer[1])


@given(seeds)
def test_affine_maps_are_associative(seed):
    rng = np.random.default_rng(seed)
    x, y, z = (piece(rng, 3, 2) for _ in range(3))
    left, right = compose(compose(x, y), z), compose(x, compose(y, z))
    for a, b in zip(left, right, strict=True):
        assert relative_error(a, b) < 1e-13


@given(seeds)
def test_product_and_push_are_one_map_after_the_other(seed):
    rng = np.random.default_rng(seed)
    outer, inner, entering = piece(rng), piece(rng), rng.normal(size=6)
    matrix, vector = compose(outer, inner)
    between = inner[0].reshape(6, 6) @ entering + inner[1]
    expected = outer[0].reshape(6, 6) @ between + outer[1]
    assert relative_error(affine.push(matrix, entering, vector), expected) < 1e-13
    assert relative_error(matrix.reshape(6, 6) @ entering + vector, expected) < 1e-13


@given(seeds)
def test_identity_changes_nothing(seed):
    some, identity = piece(np.random.default_rng(seed)), (np.eye(6).reshape(36), np.zeros(6))
    for both in (compose(some, identity), compose(identity, some)):
        assert all(np.array_equal(a, b) for a, b in zip(both, some, strict=True))


@given(samples=st.integers(1, 4), seed=seeds)
def test_affine_results_go_where_they_are_wanted(samples, seed):
    rng = np.random.default_rng(seed)
    (c2, b2), (c1, b1) = piece(rng, samples), piece(rng, samples)
    wide = np.zeros((samples, 42))
    expected = affine.product(c2, c1), affine.push(c2, b1, b2)
    affine.product(c2, c1, out=wide[:, :36])
    affine.push(c2, b1, b2, out=wide[:, 36:])
    assert np.array_equal(wide, np.concatenate(expected, axis=1))
    assert affine.push(c2, b1, b2, out=b2) is b2
    assert np.array_equal(b2, expected[1])


def paths(seed, *lead):
    """Random motion across joints, with true rotations."""
    model = Model.random(max(int(np.prod(lead)), 1), seed, ALL_JOINTS)
    joints = joint_motion(model, check_state(model, *model.random_state(1, seed), None))
    segment = motion.from_joint(joints).reshape(*lead, motion.DOUBLES)
    segment[..., 12:] = np.random.default_rng(seed).normal(size=(*lead, 12))
    return segment


def bodies(seed, *lead):
    """Random single bodies, as loads."""
    model = Model.random(max(int(np.prod(lead)), 1), seed)
    forces = np.random.default_rng(seed).normal(size=(len(model), 1, 6))
    out = inertia.from_body(model.masses, model.coms, model.origin_inertias, forces, 1)
    return out.reshape(*lead, inertia.DOUBLES)


def carried_on(path, velocity, acceleration):
    """Motion of the body at a path's lower end for that of the upper one."""
    across = motion.view(path)
    between = motion_to_child(across.rotation, across.translation, velocity)
    turned = motion_to_child(across.rotation, across.translation, acceleration)
    turning = motion.motion_cross(between, across.velocity)
    return between + across.velocity, turned + across.acceleration + turning


@given(seeds)
def test_paths_compose_associatively(seed):
    x, y, z = paths(seed, 3, 2)
    left = motion.compose(motion.compose(x, y), z)
    right = motion.compose(x, motion.compose(y, z))
    assert relative_error(left, right) < 1e-13


@given(seeds)
def test_a_composed_path_is_one_path_after_the_other(seed):
    upper, lower = paths(seed, 2, 3)
    start = np.random.default_rng(seed).normal(size=(2, 3, 6))
    ends = carried_on(lower, *carried_on(upper, *start))
    for ours, theirs in zip(carried_on(motion.compose(upper, lower), *start), ends, strict=True):
        assert relative_error(ours, theirs) < 1e-13


def test_a_path_of_no_length_changes_nothing():
    some = paths(1, 3)
    still = np.zeros(motion.DOUBLES)
    motion.view(still).rotation[:] = np.eye(3)
    for both in (motion.compose(some, still), motion.compose(still, some)):
        assert np.array_equal(both, some)


@given(seeds)
def test_a_single_bodys_load_is_the_force_that_moves_it(seed):
    model = Model.random(4, seed)
    velocity, acceleration = np.random.default_rng(seed).normal(size=(2, 4, 1, 6))
    segment = inertia.from_body(model.masses, model.coms, model.origin_inertias, None, 1)
    mass, com = model.masses[:, None], model.coms[:, None]
    classical = spatial_to_classical(acceleration, velocity)
    expected = body_force(mass, com, model.origin_inertias[:, None], velocity, classical)
    assert relative_error(inertia.force(segment, velocity, acceleration), expected) < 1e-13


@given(seeds)
def test_a_moved_load_presses_as_it_does_at_its_place(seed):
    """Whatever the upper body does: the force of the load at its own place, carried back across the path."""
    path, segment = paths(seed, 3), bodies(seed, 3)
    segment = segment + inertia.transform(
        bodies(seed + 1, 3), paths(seed + 1, 3)
    )  # of bodies that move against each other
    upper = np.random.default_rng(seed).normal(size=(2, 3, 6))
    across = motion.view(path)
    at_place = inertia.force(segment, *carried_on(path, *upper))
    expected = force_to_parent(across.rotation, across.translation, at_place)
    assert relative_error(inertia.force(inertia.transform(segment, path), *upper), expected) < 1e-12


@given(seeds)
def test_moving_goes_along_with_composing_and_adding(seed):
    upper, lower = paths(seed, 2, 3)
    one, two = bodies(seed, 2, 3)
    step_by_step = inertia.transform(inertia.transform(one, lower), upper)
    assert relative_error(inertia.transform(one, motion.compose(upper, lower)), step_by_step) < 1e-12
    together = inertia.transform(one + two, lower)
    assert relative_error(inertia.transform(one, lower) + inertia.transform(two, lower), together) < 1e-13
