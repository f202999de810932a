"""The operators are the paper's 6×6 matrices (eq. 1-6)."""

import numpy as np
from helpers import relative_error
from hypothesis import given
from hypothesis import strategies as st

from mp2a import Model, spatial

EXACT = 1e-13
seeds = st.integers(0, 2**32 - 1)


def placement(rng):
    """A rotation and a translation."""
    model = Model.random(1, seed=int(rng.integers(2**32)))
    return model.rotations[0], rng.normal(size=3)


def paper_p(p):
    """P-hat and S-hat of eq. 2."""
    out = np.eye(6)
    out[:3, 3:] = spatial.skew(p)
    return out


def paper_r(r):
    return np.kron(np.eye(2), r)


def random_body(rng):
    """Mass, centre of mass and rotational inertia about it, and the 6×6 inertia about the body's origin."""
    mass, com, root = rng.uniform(0.5, 2.0), rng.normal(size=3), rng.normal(size=(3, 3))
    inertia = root @ root.T
    at_com = np.zeros((6, 6))
    at_com[:3, :3], at_com[3:, 3:] = inertia, mass * np.eye(3)
    return np.array(mass), com, inertia, paper_p(com) @ at_com @ paper_p(com).T


@given(seeds)
def test_cross_skew_and_apply_agree_with_numpy(seed):
    a, b = np.random.default_rng(seed).normal(size=(2, 4, 3, 3))
    assert np.array_equal(spatial.cross(a, b), np.cross(a, b))
    assert relative_error(spatial.apply(spatial.skew(a), b), np.cross(a, b)) < EXACT
    assert np.array_equal(spatial.transpose(spatial.skew(a)), -spatial.skew(a))


@given(seeds)
def test_motion_operator_is_the_papers(seed):
    rng = np.random.default_rng(seed)
    r, p = placement(rng)
    operator = paper_p(r.T @ p).T @ paper_r(r).T  # the paper takes p in the body's own frame
    assert relative_error(spatial.motion_operator(r, p), operator) < EXACT
    motion, force = rng.normal(size=(2, 6))
    assert relative_error(spatial.motion_to_child(r, p, motion), operator @ motion) < EXACT
    assert relative_error(spatial.force_to_parent(r, p, force), operator.T @ force) < EXACT


@given(seeds)
def test_force_to_child_undoes_force_to_parent(seed):
    rng = np.random.default_rng(seed)
    r, p = placement(rng)
    force = rng.normal(size=6)
    assert relative_error(spatial.force_to_child(r, p, spatial.force_to_parent(r, p, force)), force) < EXACT


@given(seeds)
def test_power_does_not_depend_on_the_frame(seed):
    rng = np.random.default_rng(seed)
    r, p = placement(rng)
    motion, force = rng.normal(size=(2, 6))
    in_child = force @ spatial.motion_to_child(r, p, motion)
    in_parent = spatial.force_to_parent(r, p, force) @ motion
    scale = np.linalg.norm(force) * np.linalg.norm(motion) * (1 + np.linalg.norm(p))
    assert abs(in_child - in_parent) < EXACT * scale


@given(seeds)
def test_operators_work_along_leading_axes(seed):
    rng = np.random.default_rng(seed)
    r, p = (np.stack(x) for x in zip(*(placement(rng) for _ in range(4)), strict=True))
    x = rng.normal(size=(4, 6))
    for function in (spatial.motion_to_child, spatial.force_to_parent, spatial.force_to_child):
        one_by_one = np.stack([function(*arguments) for arguments in zip(r, p, x, strict=True)])
        assert relative_error(function(r, p, x), one_by_one) < EXACT
    operators = [spatial.motion_operator(*arguments) for arguments in zip(r, p, strict=True)]
    assert relative_error(spatial.motion_operator(r, p), np.stack(operators)) < EXACT


@given(seeds)
def test_force_at_origin_is_s_times_force(seed):
    com, force = np.random.default_rng(seed).normal(size=(2, 6))
    assert relative_error(spatial.force_at_origin(com[:3], force), paper_p(com[:3]) @ force) < EXACT


@given(seeds)
def test_inertia_at_origin_is_the_parallel_axis_theorem(seed):
    mass, com, inertia, at_origin = random_body(np.random.default_rng(seed))
    assert relative_error(spatial.inertia_at_origin(mass, com, inertia), at_origin[:3, :3]) < EXACT


@given(seeds)
def test_body_force_is_equation_6_assembled_literally(seed):
    rng = np.random.default_rng(seed)
    mass, com, inertia, m = random_body(rng)
    velocity, acceleration = rng.normal(size=(2, 6))
    turn = paper_r(spatial.skew(velocity[:3]))  # what is fixed in the body changes by the commutator with ω~
    m_dot = turn @ m - m @ turn
    s_dot = turn @ paper_p(com) - paper_p(com) @ turn
    force = m @ acceleration + (m_dot - s_dot @ m) @ velocity
    about_origin = spatial.inertia_at_origin(mass, com, inertia)
    assert relative_error(spatial.body_force(mass, com, about_origin, velocity, acceleration), force) < EXACT


@given(seeds)
def test_velocity_product_is_equation_5_assembled_literally(seed):
    rng = np.random.default_rng(seed)
    r, p = placement(rng)
    carried, relative = rng.normal(size=(2, 6))
    velocity = carried + relative
    in_body = r.T @ p
    p_dot = np.zeros((6, 6))
    p_dot[:3, 3:] = spatial.skew(np.cross(carried[:3], in_body) + relative[3:])
    h_dot_rate = paper_r(spatial.skew(velocity[:3])) @ relative
    expected = p_dot.T @ carried + h_dot_rate
    assert relative_error(spatial.velocity_product(p, r, carried, relative, velocity), expected) < EXACT


@given(seeds)
def test_accelerations_convert_both_ways(seed):
    velocity, acceleration = np.random.default_rng(seed).normal(size=(2, 5, 6))
    there = spatial.classical_to_spatial(acceleration, velocity)
    assert np.array_equal(there[:, :3], acceleration[:, :3])
    assert relative_error(there[:, 3:] + np.cross(velocity[:, :3], velocity[:, 3:]), acceleration[:, 3:]) < EXACT
    assert relative_error(spatial.spatial_to_classical(there, velocity), acceleration) < EXACT
    assert np.array_equal(spatial.to_linear_first(spatial.to_linear_first(velocity)), velocity)
    assert np.array_equal(spatial.to_linear_first(velocity)[:, :3], velocity[:, 3:])
