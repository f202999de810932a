"""`mp2a.aba` is pinocchio's forward dynamics and undoes `mp2a.rnea`, and says what is wrong with its input."""

import dataclasses
import pickle

import numpy as np
import pinocchio
import pytest
from helpers import ALL_JOINTS, random_forest, random_load, relative_error
from hypothesis import given, settings
from hypothesis import strategies as st
from test_batch import LAYOUTS

import mp2a
from mp2a import InputError, Model, kernels
from mp2a.joint_kinematics import BaseMotion
from mp2a.kernels import batch
from mp2a.serial import aba_numpy
from mp2a.spatial import to_linear_first
from mp2a.validation import check_shapes

seeds = st.integers(0, 2**32 - 1)
needs_kernels = pytest.mark.skipif(not kernels.status().compiled, reason="no compiled kernels here")


def pinocchio_aba(model, q, v, tau, forces=None, gravity=None):
    """What pinocchio gives for ``(T, …)``."""
    pin_model = model.to_pinocchio()
    pin_model.gravity.linear = model.gravity if gravity is None else gravity
    data, found = pin_model.createData(), []
    for t in range(len(q)):
        external = [] if forces is None else [np.zeros((1, 6)), to_linear_first(forces[t])]
        wrenches = pinocchio.StdVec_Force([pinocchio.Force(f) for f in np.concatenate(external or [[]])])
        found.append(pinocchio.aba(pin_model, data, q[t], v[t], tau[t], *([wrenches] if external else [])).copy())
    return np.array(found)


def by_numpy(model, q, v, tau, forces, gravity):
    state = check_shapes(model, q, v, tau, forces, "tau")
    return aba_numpy(model, state, BaseMotion.at_rest(gravity))


@pytest.mark.parametrize("joint", [*ALL_JOINTS, "all"])
@pytest.mark.parametrize("n", [1, 2, 3, 8, 21])
def test_agrees_with_pinocchio_for_every_joint_type(joint, n):
    model = Model.random(n, seed=n, joints=ALL_JOINTS if joint == "all" else (joint,), branching=1 + n % 3)
    q, v, tau = model.random_state(3, seed=n)
    forces, gravity = random_load(model, 3, seed=n)
    expected = pinocchio_aba(model, q, v, tau, forces, gravity)
    # The inertia of many joints of six degrees of freedom in a row is nearly singular, for pinocchio as well.
    tolerance = 1e-8 if joint in ("free", "all") else 1e-10
    assert relative_error(mp2a.aba(model, q, v, tau, forces, gravity), expected) <= tolerance
    assert relative_error(by_numpy(model, q, v, tau, forces, gravity), expected) <= tolerance


def test_512_revolute_joints_agree_with_pinocchio():
    model = Model.random(512, seed=5)
    q, v, tau = model.random_state(2, seed=5)
    assert relative_error(mp2a.aba(model, q, v, tau), pinocchio_aba(model, q, v, tau)) <= 1e-10


@pytest.mark.parametrize("joint", ["revolute", "prismatic", "continuous"])
def test_torques_come_back_as_well_as_from_pinocchio(joint):
    """What is left of rnea(q, v, aba(q, v, τ)) - τ is rounding, and no more of it than in pinocchio."""
    model = Model.random(128, seed=1, joints=(joint,))
    q, v, tau = model.random_state(8, seed=1)
    ours, theirs = (
        np.abs(mp2a.rnea(model, q, v, aba(model, q, v, tau)) - tau).max() for aba in (mp2a.aba, pinocchio_aba)
    )
    assert ours <= 10 * theirs


@given(
    n=st.integers(1, 20),
    samples=st.integers(1, 35),
    branching=st.integers(1, 4),
    seed=seeds,
    layouts=st.tuples(*[st.sampled_from(sorted(LAYOUTS))] * 3),
    force=st.sampled_from(("none", "constant", "each")),
    threads=st.integers(1, 3),
    driven=st.booleans(),
)
@settings(max_examples=100)
def test_undoes_inverse_dynamics(n, samples, branching, seed, layouts, force, threads, driven):
    model = random_forest(n, seed, branching)
    if driven:
        model = dataclasses.replace(model, armature=np.random.default_rng(seed).random(model.nv))
    q, v, a = (LAYOUTS[layout](x) for layout, x in zip(layouts, model.random_state(samples, seed), strict=True))
    forces, gravity = random_load(model, samples if force == "each" else None, seed)
    forces = None if force == "none" else forces
    tau = mp2a.rnea(model, q, v, a, forces, gravity)
    found = mp2a.aba(model, q, v, LAYOUTS[layouts[2]](tau), forces, gravity, threads=threads)
    # How much an error of the torque counts depends on the model, so that torques are compared.
    assert relative_error(mp2a.rnea(model, q, v, found, forces, gravity), tau) <= 1e-11
    assert (
        relative_error(mp2a.rnea(model, q, v, by_numpy(model, q, v, tau, forces, gravity), forces, gravity), tau)
        <= 1e-11
    )


@needs_kernels
@given(n=st.integers(1, 12), samples=st.integers(1, 40), seed=seeds, columns=st.booleans())
@settings(max_examples=40)
def test_single_precision(n, samples, seed, columns):
    model = dataclasses.replace(random_forest(n, seed, 2), armature=())
    state = [np.asarray(x, dtype=np.float32, order="F" if columns else "C") for x in model.random_state(samples, seed)]
    found = mp2a.aba(model, *state, dtype=np.float32)
    assert found.dtype == np.float32
    q, v, tau = (x.astype(float) for x in state)
    scale = (
        np.abs(mp2a.rnea(model, q, v, mp2a.aba(model, q, v, tau))).max() + np.abs(mp2a.rnea(model, q, v, 0 * v)).max()
    )
    assert np.abs(mp2a.rnea(model, q, v, found.astype(float)) - tau).max() <= 1e-2 * scale


def test_samples_do_not_know_of_each_other():
    model = Model.random(7, joints=ALL_JOINTS)
    q, v, tau = model.random_state(4)
    forces, gravity = random_load(model, 4)
    together = mp2a.aba(model, q, v, tau, forces, gravity)
    for t in range(4):
        alone = mp2a.aba(model, q[t], v[t], tau[t], forces[t], gravity)
        assert alone.shape == (model.nv,)
        assert relative_error(alone, together[t]) < 1e-12


@needs_kernels
@given(seed=seeds, n=st.integers(1, 10), samples=st.integers(2, 20), data=st.data())
@settings(max_examples=30)
def test_a_number_that_is_none_stays_in_its_sample(seed, n, samples, data):
    model = random_forest(n, seed, 2)
    state = [x.copy() for x in model.random_state(samples, seed)]
    base = batch.pack_base(BaseMotion.at_rest(model.gravity))
    expected = batch.aba(model, check_shapes(model, *state, None, "tau"), base)
    bad = data.draw(st.integers(0, samples - 1))
    row = state[data.draw(st.integers(0, 2))][bad]
    row[data.draw(st.integers(0, len(row) - 1))] = np.nan
    found = batch.aba(model, check_shapes(model, *state, None, "tau"), base)
    assert expected.valid and not found.valid
    others = np.arange(samples) != bad
    assert np.array_equal(found.acceleration[others], expected.acceleration[others])


# ---- results ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", LAYOUTS)
def test_accelerations_go_where_they_are_told(layout):
    model = Model.random(6, joints=ALL_JOINTS)
    state = model.random_state(21)
    out = LAYOUTS[layout](np.full((21, model.nv), np.nan))
    assert mp2a.aba(model, *state, out=out) is out
    assert np.array_equal(out, mp2a.aba(model, *state))
    q, v, tau = (x.copy() for x in state)
    assert np.array_equal(mp2a.aba(model, q, v, tau, out=tau), out)
    assert np.array_equal(tau, out)


@pytest.mark.parametrize("samples", [None, 1, 21])
def test_bodies_move_as_the_accelerations_say(samples):
    model = Model.random(6, joints=ALL_JOINTS)
    old, (q, v, tau) = (model.random_state(samples, seed) for seed in (1, 2))
    result = mp2a.aba(model, *old, bodies=True)
    assert mp2a.aba(model, q, v, tau, bodies=True, out=result) is result
    assert relative_error(result.joint_acceleration, mp2a.aba(model, q, v, tau)) <= 1e-14
    motion = mp2a.rnea(model, q, v, result.joint_acceleration, bodies=True)
    for name in ("velocity", "acceleration", "force", "torque"):
        assert np.array_equal(getattr(result, name), getattr(motion, name))
    assert relative_error(result.torque, tau) <= 1e-10
    again = pickle.loads(pickle.dumps(result))
    assert np.array_equal(again.joint_acceleration, result.joint_acceleration)
    assert "joint_acceleration" in repr(again)


# ---- what resists a joint ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("joint", ALL_JOINTS)
def test_armature_is_pinocchios(joint):
    model = Model.random(5, joints=(joint, "revolute"), seed=2)
    model = dataclasses.replace(model, armature=np.arange(1, model.nv + 1) / 10)
    q, v, tau = model.random_state(3)
    assert relative_error(mp2a.aba(model, q, v, tau), pinocchio_aba(model, q, v, tau)) <= 1e-11
    assert np.array_equal(Model.from_pinocchio(model.to_pinocchio()).armature, model.armature)


def test_drives_move_without_mass_as_in_pinocchio():
    model = Model.random(6, joints=("revolute", "prismatic", "spherical"))
    model = dataclasses.replace(
        model, masses=np.zeros(6), inertias=np.zeros((6, 3, 3)), armature=np.full(model.nv, 0.3)
    )
    q, v, tau = model.random_state(2)
    assert relative_error(mp2a.aba(model, q, v, tau), pinocchio_aba(model, q, v, tau)) <= 1e-12


@pytest.mark.parametrize("joint", ALL_JOINTS)
@pytest.mark.parametrize("samples", [None, 20])
def test_joint_that_nothing_resists_is_named(joint, samples):
    model = Model.random(4, joints=(joint,))
    masses, inertias = model.masses.copy(), model.inertias.copy()
    masses[3], inertias[3] = 0, 0
    model = dataclasses.replace(model, masses=masses, inertias=inertias)
    with pytest.raises(InputError, match=f"nothing that resists {joint} joint 'joint4' in sample 0"):
        mp2a.aba(model, *model.random_state(samples))


def test_two_joints_about_one_axis_with_nothing_between_are_refused():
    model = Model.uniform(3, offset=(0, 0, 0), inertia=np.eye(3))
    model = dataclasses.replace(model, masses=[1, 0, 1], inertias=[np.eye(3), np.zeros((3, 3)), np.eye(3)])
    for samples in (None, 20):
        with pytest.raises(InputError, match="nothing that resists revolute joint 'joint2'"):
            mp2a.aba(model, *model.random_state(samples))


def test_input_is_checked():
    model = Model.random(3)
    q, v, tau = model.random_state(4)
    for wrong, message in (
        ((q, v, tau[:, :2]), r"tau: got shape \(4, 2\), expected \(3,\) or \(T, 3\)"),
        ((q, v, tau[:3]), "q, v, tau: got different numbers of samples"),
        ((q, v, np.full_like(tau, np.inf)), "tau: got inf in sample 0, column 0"),
    ):
        with pytest.raises(InputError, match=message):
            mp2a.aba(model, *wrong)
    for out in (np.empty(3), mp2a.rnea(model, q, v, tau, bodies=True)):
        with pytest.raises(InputError, match="out: got"):
            mp2a.aba(model, q, v, tau, bodies=True, out=out)
    with pytest.raises(InputError, match="dtype: got int64"):
        mp2a.aba(model, q, v, tau, dtype=int)
