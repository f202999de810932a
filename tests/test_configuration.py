"""Coordinates go along velocities as pinocchio's do; joints with springs, dampers and friction resist as they say."""

import dataclasses

import numpy as np
import pinocchio
import pytest
from helpers import ALL_JOINTS, random_forest, relative_error
from hypothesis import given, settings
from hypothesis import strategies as st

import mp2a
from mp2a import InputError, Model

seeds = st.integers(0, 2**32 - 1)
sizes = st.sampled_from((0.0, 1e-9, 1e-5, 0.009, 0.011, 0.3, 1.0))


@given(n=st.integers(1, 8), samples=st.integers(1, 4), seed=seeds, size=sizes)
@settings(max_examples=60)
def test_integration_is_pinocchios(n, samples, seed, size):
    model = random_forest(n, seed, 2)
    pin_model = model.to_pinocchio()
    q, v = (
        mp2a.random_configuration(model, samples, seed),
        size * np.random.default_rng(seed).normal(size=(samples, model.nv)),
    )
    expected = np.array([pinocchio.integrate(pin_model, *pair) for pair in zip(q, v, strict=True)])
    found = mp2a.integrate(model, q, v)
    assert np.abs(found - expected).max() <= 1e-9  # pinocchio's series end earlier
    other = mp2a.random_configuration(model, samples, seed + 1)
    expected = np.array([pinocchio.difference(pin_model, *pair) for pair in zip(q, other, strict=True)])
    assert np.abs(mp2a.difference(model, q, other) - expected).max() <= 1e-6 * (1 + np.abs(expected).max())


@given(n=st.integers(1, 8), samples=st.integers(1, 4), seed=seeds, size=sizes)
@settings(max_examples=60)
def test_difference_undoes_integration(n, samples, seed, size):
    model = random_forest(n, seed, 2)
    rng = np.random.default_rng(seed)
    q, v = mp2a.random_configuration(model, samples, seed), size * rng.uniform(-1, 1, (samples, model.nv))
    moved = mp2a.integrate(model, q, v)
    assert np.abs(mp2a.difference(model, q, moved) - v).max() <= 1e-13 + 1e-10 * size
    assert np.abs(mp2a.integrate(model, moved, -v) - q).max() <= 1e-12
    half = mp2a.integrate(model, mp2a.integrate(model, q, v / 2), v / 2)
    assert np.abs(half - moved).max() <= 1e-12


def test_coordinates_come_in_samples_or_alone():
    model = Model.random(5, joints=ALL_JOINTS)
    q, v = mp2a.random_configuration(model), np.linspace(0, 1, model.nv)
    moved = mp2a.integrate(model, q, v)
    assert moved.shape == (model.nq,)
    assert np.array_equal(mp2a.integrate(model, q, [v, v]), [moved, moved])
    assert np.array_equal(mp2a.difference(model, [q], moved)[0], mp2a.difference(model, q, moved))
    assert np.array_equal(mp2a.neutral(model), pinocchio.neutral(model.to_pinocchio()))
    assert mp2a.random_configuration(model, 4, seed=1).shape == (4, model.nq)


@given(seed=seeds, bound=st.floats(0.1, 5))
def test_drawn_coordinates_are_valid_and_within_bounds(seed, bound):
    model = Model.random(12, seed=1, joints=ALL_JOINTS)
    q = mp2a.random_configuration(model, 20, seed, lower=-bound, upper=np.full(model.nq, bound))
    mp2a.placements(model, q)
    assert np.abs(q).max() <= max(bound, 1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: mp2a.integrate(m, np.zeros(2), np.zeros(3)), r"q: got shape \(2,\)"),
        (lambda m: mp2a.integrate(m, np.zeros(3), np.zeros(2)), r"v: got shape \(2,\)"),
        (lambda m: mp2a.integrate(m, np.zeros(3), [0, np.nan, 0]), "v: got nan in sample 0, column 1"),
        (lambda m: mp2a.integrate(m, np.zeros((2, 3)), np.zeros((3, 3))), "q has 2, v has 3"),
        (lambda m: mp2a.difference(m, np.zeros(3), [0, np.inf, 0]), "end: got inf in sample 0, column 1"),
        (lambda m: mp2a.random_configuration(m, lower=2), "lower: got 2.0 for coordinate 0, expected at most"),
        (lambda m: mp2a.random_configuration(m, samples=0), "samples: got 0"),
    ],
)
def test_wrong_coordinates_are_refused(call, message):
    with pytest.raises(InputError, match=message):
        call(Model.random(3))


# ---- what joints resist with ------------------------------------------------------------------------------------


def resisting(n, seed):
    model, rng = random_forest(n, seed, 2), np.random.default_rng(seed)
    numbers = {name: rng.random(model.nv) for name in ("armature", "damping", "friction", "stiffness")}
    return dataclasses.replace(model, rest=mp2a.random_configuration(model, seed=seed), **numbers)


@given(n=st.integers(1, 10), samples=st.integers(1, 12), seed=seeds)
@settings(max_examples=40)
def test_joints_resist_in_both_directions(n, samples, seed):
    model = resisting(n, seed)
    none = dict.fromkeys(("armature", "damping", "friction", "stiffness"), ())
    bare = dataclasses.replace(model, **none)
    q, v, a = model.random_state(samples, seed)
    expected = mp2a.rnea(bare, q, v, a) + model.armature * a + model.damping * v + model.friction * np.sign(v)
    expected += model.stiffness * mp2a.difference(model, model.rest, q)
    tau = mp2a.rnea(model, q, v, a)
    assert relative_error(tau, expected) <= 1e-13
    assert relative_error(mp2a.rnea(model, q[0], v[0], a[0]), tau[0]) <= 1e-12
    assert relative_error(mp2a.rnea(model, q, v, mp2a.aba(model, q, v, tau)), tau) <= 1e-11
    for method in ("compact", "sweep"):
        assert relative_error(mp2a.rnea(model, q, v, a, method=method), tau) <= 1e-11


@pytest.mark.parametrize("name", ["armature", "damping", "friction", "stiffness"])
def test_negative_numbers_of_joints_are_refused(name):
    with pytest.raises(InputError, match=f"{name}: got -1.0 for degree of freedom 1"):
        dataclasses.replace(Model.random(3), **{name: [0, -1, 0]})
    with pytest.raises(InputError, match=rf"{name}: got shape \(2,\)"):
        dataclasses.replace(Model.random(3), **{name: [0, 1]})


def test_rest_is_a_position():
    with pytest.raises(InputError, match=r"rest: got \[1.0, 1.0\] for body 0, a continuous joint"):
        dataclasses.replace(Model.random(1, joints=("continuous",)), stiffness=[1], rest=[1, 1])


def test_parts_of_a_model_keep_their_joints(tmp_path):
    model = resisting(6, 1)
    model.save(tmp_path / "model.npz")
    assert Model.load(tmp_path / "model.npz") == model
    body = model.body(3)
    start, stop = model.v_starts[3:5]
    for name in ("armature", "damping", "friction", "stiffness"):
        assert np.array_equal(getattr(body, name), getattr(model, name)[start:stop])
    assert np.array_equal(body.rest, model.rest[model.q_starts[3] : model.q_starts[4]])


def test_damping_and_friction_come_from_urdf_as_pinocchio_reads_them(tmp_path):
    text = (
        '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>'
        '<limit lower="-3" upper="3" effort="10" velocity="5"/><dynamics damping="0.3" friction="0.7"/></joint></robot>'
    )
    path = tmp_path / "r.urdf"
    path.write_text(text)
    model, pin_model = Model.from_urdf(path), pinocchio.buildModelFromUrdf(str(path))
    for read in (model, Model.from_pinocchio(pin_model), Model.from_pinocchio(model.to_pinocchio())):
        assert (read.damping[0], read.friction[0]) == (0.3, 0.7)
    path.write_text(text.replace('damping="0.3"', 'damping="-1"'))
    with pytest.raises(InputError, match=r"damping -1\.0"):
        Model.from_urdf(path)
