"""`mp2a.rnea` is pinocchio's inverse dynamics, whatever the method, and says what is wrong with its input."""

import dataclasses
import doctest
import gc
import pickle
import weakref

import numpy as np
import pinocchio
import pytest
from helpers import ALL_JOINTS, placements, random_forest, random_load, relative_error
from hypothesis import given, settings
from hypothesis import strategies as st

import mp2a
import mp2a.dynamics
import mp2a.methods
from mp2a import DependencyError, InputError, Model
from mp2a.reference import Reference
from mp2a.validation import check_model

METHODS = ("serial", *mp2a.methods.METHODS)
ON_TREES = tuple(method for method in METHODS if method != "kogge-stone")
RESULTS = ("velocity", "acceleration", "force", "torque")


def errors(result, reference):
    """Relative error of each part of a result."""
    parts = {name: relative_error(getattr(result, name), getattr(reference, name)) for name in RESULTS}
    places = zip(("rotation", "translation"), result.placement, reference.placement, strict=True)
    return parts | {name: relative_error(*pair) for name, *pair in places}


def agree(model, methods, samples, seed, tolerance=1e-12):
    """Compare methods to pinocchio under random motion, load and gravity."""
    state = model.random_state(samples, seed)
    forces, gravity = random_load(model, samples, seed)
    expected = Reference(model).rnea(*state, forces, gravity)
    for method in methods:
        result = mp2a.rnea(model, *state, forces, gravity, method=method, bodies=True)
        for name in RESULTS:
            assert getattr(result, name).shape == getattr(expected, name).shape
        assert max(errors(result, expected).values()) <= tolerance, errors(result, expected)


@pytest.mark.parametrize("n", [*range(1, 41), 64])
def test_methods_agree_with_pinocchio_at_every_size(n):
    agree(Model.random(n, seed=n, joints=ALL_JOINTS), METHODS, samples=3 if n % 2 else None, seed=n)


@pytest.mark.parametrize("joint", ALL_JOINTS)
@pytest.mark.parametrize("n", [1, 2, 3, 8, 21])
def test_methods_agree_with_pinocchio_for_every_joint_type(joint, n):
    agree(Model.random(n, seed=n, joints=(joint,)), METHODS, samples=2, seed=n)


@given(n=st.integers(1, 25), seed=st.integers(0, 2**32 - 1), branching=st.integers(2, 6))
@settings(max_examples=30)
def test_methods_agree_with_pinocchio_on_trees(n, seed, branching):
    agree(random_forest(n, seed, branching), ON_TREES, samples=2, seed=seed)


def test_512_bodies_agree_with_pinocchio():
    model = Model.random(512, seed=5)
    try:
        reference = Reference(model)
    except DependencyError as error:
        pytest.skip(str(error))
    state = model.random_state(seed=5)
    forces, gravity = random_load(model)
    expected = reference.rnea(*state, forces, gravity)
    for method in METHODS:
        result = mp2a.rnea(model, *state, forces, gravity, method=method, bodies=True)
        assert max(errors(result, expected).values()) <= 1e-10, method


def test_methods_agree_where_pinocchio_cannot_go():
    model = Model.random(2000, seed=6, joints=("revolute", "prismatic", "spherical"))
    state = model.random_state(2)
    serial, *others = (mp2a.rnea(model, *state, method=method, bodies=True) for method in METHODS)
    for other in others:
        assert max(errors(other, serial).values()) <= 1e-10


@pytest.mark.parametrize("method", METHODS)
def test_samples_do_not_know_of_each_other(method):
    model = Model.random(7, joints=ALL_JOINTS)
    q, v, a = model.random_state(4)
    forces, gravity = random_load(model, 4)
    together = mp2a.rnea(model, q, v, a, forces, gravity, method=method)
    for t in range(4):
        alone = mp2a.rnea(model, q[t], v[t], a[t], forces[t], gravity, method=method)
        assert alone.shape == (model.nv,)
        assert relative_error(alone, together[t]) < 1e-14
    same_force = mp2a.rnea(model, q, v, a, forces[0], gravity, method=method)
    repeated = mp2a.rnea(model, q, v, a, np.tile(forces[0], (4, 1, 1)), gravity, method=method)
    assert np.array_equal(same_force, repeated)


@pytest.mark.parametrize("method", METHODS)
def test_call_leaves_its_arguments_alone(method):
    model = Model.random(6, joints=ALL_JOINTS)
    arguments = [*model.random_state(3), *random_load(model, 3)]
    before = [argument.copy() for argument in arguments]
    first = mp2a.rnea(model, *arguments, method=method)
    assert all(np.array_equal(x, y) for x, y in zip(arguments, before, strict=True))
    assert np.array_equal(first, mp2a.rnea(model, *arguments, method=method))


def test_user_needs_no_more_than_pinocchios_q_and_v():
    """The whole way a user of pinocchio goes, with its own gravity and neutral configuration."""
    model = Model.random(5, joints=ALL_JOINTS)
    pin_model = model.to_pinocchio()
    q, v = (
        pinocchio.randomConfiguration(pin_model, -np.ones(pin_model.nq), np.ones(pin_model.nq)),
        np.ones(pin_model.nv),
    )
    expected = pinocchio.rnea(pin_model, pin_model.createData(), q, v, v)
    assert relative_error(mp2a.rnea(model, q, v, v), expected) < 1e-13
    assert np.array_equal(model.neutral, pinocchio.neutral(pin_model))


def test_pinocchios_model_is_taken_as_it_is():
    """The first thing that a user of pinocchio types; a change of the model is noticed."""
    pin_model = Model.random(6, joints=ALL_JOINTS).to_pinocchio()
    pin_model.gravity.linear = np.array([1.0, 2.0, -3.0])
    data = pin_model.createData()
    q, v, a = Model.from_pinocchio(pin_model).random_state()
    torque = pinocchio.rnea(pin_model, data, q, v, a)
    assert relative_error(mp2a.rnea(pin_model, q, v, a), torque) < 1e-13
    again = mp2a.rnea(pin_model, q, v, a, method="sweep", bodies=True)
    assert relative_error(again.torque, torque) < 1e-13
    placement = mp2a.placements(pin_model, q)
    pinocchio.forwardKinematics(pin_model, data, q)
    for i in range(6):
        assert np.allclose(placement.translation[i], data.oMi[i + 1].translation, rtol=0, atol=1e-13)
    pin_model.inertias[3].mass = 7.0
    pin_model.gravity.linear = np.zeros(3)
    changed = pinocchio.rnea(pin_model, pin_model.createData(), q, v, a)
    assert relative_error(changed, torque) > 1e-3
    assert relative_error(mp2a.rnea(pin_model, q, v, a), changed) < 1e-13
    with pytest.raises(InputError, match=r"^model: got Data, expected an mp2a.Model or a pinocchio.Model"):
        mp2a.rnea(data, q, v, a)
    with pytest.raises(InputError, match=r"^model: got str"):
        mp2a.placements("robot.urdf", q)


def test_conversion_of_pinocchios_model_is_kept_while_it_lives():
    pin_model = Model.random(3).to_pinocchio()
    first = check_model(pin_model)
    assert check_model(pin_model) is first
    pin_model.inertias[1].mass = 7.0
    assert check_model(pin_model).masses[0] == 7.0
    kept = weakref.ref(check_model(pin_model))
    del pin_model, first
    gc.collect()
    assert kept() is None


@pytest.mark.parametrize("method", METHODS)
def test_gravity_is_the_models_unless_told(method):
    model = dataclasses.replace(Model.random(5, seed=8), gravity=[3.0, -2.0, 1.0])
    state = model.random_state(2)
    expected = Reference(model).rnea(*state)
    assert relative_error(mp2a.rnea(model, *state, method=method), expected.torque) < 1e-13
    assert relative_error(mp2a.rnea(model, *state, gravity=[3.0, -2.0, 1.0], method=method), expected.torque) < 1e-13
    earth = mp2a.rnea(model, *state, gravity=mp2a.spatial.GRAVITY, method=method)
    assert relative_error(earth, Reference(Model.random(5, seed=8)).rnea(*state).torque) < 1e-13


@pytest.mark.parametrize("method", METHODS)
def test_results_can_be_pickled_and_keep_the_placement_of_their_call(method):
    model = Model.random(5)
    q, v, a = model.random_state(3)
    result = mp2a.rnea(model, q, v, a, method=method, bodies=True)
    rotations, origins = placements(model, q[1])
    q[:] = 0.0  # before the placement was asked for
    sent = pickle.loads(pickle.dumps(result))
    assert relative_error(sent.placement.rotation[1], rotations) < 1e-14
    assert relative_error(result.placement.translation[1], origins) < 1e-14
    for name in RESULTS:
        assert np.array_equal(getattr(sent, name), getattr(result, name))


# ---- wrong input ---------------------------------------------------------------------------------------------------

MODEL = Model.random(4, seed=2, joints=("revolute",))
MIXED = Model(
    [-1, 0, 1], ("spherical", "continuous", "revolute"), MODEL.axes[:3], MODEL.rotations[:3], MODEL.translations[:3],
    MODEL.masses[:3], MODEL.coms[:3], MODEL.inertias[:3], ("hip", "knee", "toe"),
)  # fmt: skip


def put(array, where, value):
    out = np.array(array)
    out[where] = value
    return out


ONE, MANY = dict(zip("qva", MODEL.random_state(), strict=True)), dict(zip("qva", MODEL.random_state(3), strict=True))
MIXED_ONE, MIXED_MANY = (dict(zip("qva", MIXED.random_state(samples), strict=True)) for samples in (None, 3))
WRONG = {
    "q shape": (MODEL, ONE, {"q": np.zeros(5)}, r"^q: got shape \(5,\), expected \(4,\) or \(T, 4\)"),
    "v shape": (MODEL, MANY, {"v": np.zeros((3, 2))}, r"^v: got shape \(3, 2\), expected \(4,\) or \(T, 4\)"),
    "a shape": (MODEL, ONE, {"a": 0.0}, r"^a: got shape \(\), expected \(4,\)"),
    "three axes": (MODEL, ONE, {"q": np.zeros((1, 1, 4))}, r"^q: got shape \(1, 1, 4\)"),
    "complex": (MODEL, ONE, {"v": np.zeros(MODEL.nv) + 1j}, "^v: got ndarray of complex128, expected .*real numbers"),
    "text": (MODEL, ONE, {"q": "zero"}, "^q: got str .*expected an array of real numbers"),
    "ragged": (MODEL, ONE, {"v": [[0], [0, 0]]}, "^v: got list, expected an array of numbers"),
    "samples": (MODEL, MANY, {"v": np.zeros((2, 4))}, "q has 3 samples, v has 2 samples, a has 3 samples"),
    "one and many": (MODEL, MANY, {"a": np.zeros(4)}, "a has no samples"),
    "T = 0": (MODEL, dict.fromkeys("qva", np.zeros((0, 4))), {}, r"no sample \(T = 0\), expected at least one"),
    "q nan": (MODEL, MANY, {"q": put(MANY["q"], (2, 1), np.nan)}, "^q: got nan in sample 2, column 1 .*'joint2'"),
    "a inf": (MODEL, ONE, {"a": put(ONE["a"], 3, np.inf)}, "^a: got inf in sample 0, column 3 .*'joint4'"),
    "v inf": (MIXED, MIXED_MANY, {"v": put(MIXED_MANY["v"], (1, 3), -np.inf)}, "-inf in sample 1, column 3 .*'knee'"),
    "quaternion": (
        MIXED, MIXED_MANY, {"q": put(MIXED_MANY["q"], (2, slice(0, 4)), 1.0)},
        "^q: got a quaternion of length 2 for spherical joint 'hip' in sample 2, expected length 1",
    ),
    "zero quaternion": (MIXED, MIXED_ONE, {"q": put(MIXED_ONE["q"], slice(0, 4), 0.0)}, "quaternion of length 0 "),
    "cosine": (
        MIXED, MIXED_ONE, {"q": put(MIXED_ONE["q"], slice(4, 6), (3.0, 4.0))},
        "^q: got a cosine and sine of length 5 for continuous joint 'knee' in sample 0, expected length 1",
    ),
    "force shape": (MODEL, ONE, {"external_forces": np.zeros(6)}, r"^external_forces: got shape \(6,\), expected \(4"),
    "force samples": (MODEL, MANY, {"external_forces": np.zeros((2, 4, 6))}, r"expected \(4, 6\) or \(3, 4, 6\)"),
    "force for one": (MODEL, ONE, {"external_forces": np.zeros((1, 4, 6))}, r"\(1, 4, 6\), expected \(4, 6\)"),
    "force nan": (MODEL, ONE, {"external_forces": put(np.zeros((4, 6)), (1, 2), np.nan)}, "^external_forces: got nan"),
    "force text": (MODEL, ONE, {"external_forces": "none"}, "^external_forces: got str"),
    "gravity shape": (MODEL, ONE, {"gravity": [0, 0]}, r"^gravity: got shape \(2,\), expected \(3,\)"),
    "gravity nan": (MODEL, ONE, {"gravity": [0, 0, np.nan]}, "^gravity: got .*nan"),
    "gravity text": (MODEL, ONE, {"gravity": "down"}, "^gravity: got str"),
}  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_named(case, method):
    model, state, wrong, message = WRONG[case]
    with pytest.raises(InputError, match=message):
        mp2a.rnea(model, **{**state, **wrong}, method=method)


def test_wrong_method_is_named():
    with pytest.raises(InputError, match=r"^method: got 'newton', expected 'serial' or one of 'kogge-stone'"):
        mp2a.rnea(MODEL, **ONE, method="newton")
    tree = Model.random(5, seed=1, branching=3)
    with pytest.raises(InputError, match=r"^parents: got a tree, expected a serial chain for 'kogge-stone'"):
        mp2a.rnea(tree, *tree.random_state(), method="kogge-stone")


def test_unit_part_may_be_off_by_rounding():
    q = MIXED_ONE["q"] * (1 + 1e-9)
    assert np.isfinite(mp2a.rnea(MIXED, q, MIXED_ONE["v"], MIXED_ONE["a"])).all()


def test_examples_in_the_docstrings_run():
    result = doctest.testmod(mp2a.dynamics)
    assert result.attempted > 0
    assert result.failed == 0


@pytest.mark.parametrize("method", METHODS)
def test_bodies_are_placed_as_by_going_along_the_chain(method):
    model = Model.random(21, 3, ALL_JOINTS) if method == "kogge-stone" else random_forest(21, 3, 3)
    q, v, a = model.random_state(4, seed=3)
    for sample in range(4):
        rotations, origins = placements(model, q[sample])
        for got in (mp2a.placements(model, q[sample]), [part[sample] for part in mp2a.placements(model, q)]):
            assert relative_error(got[0], rotations) < 1e-12
            assert relative_error(got[1], origins) < 1e-12
        done = mp2a.rnea(model, q, v, a, method=method, bodies=True)
        assert relative_error(done.placement.rotation[sample], rotations) < 1e-12
        assert relative_error(done.placement.translation[sample], origins) < 1e-12
    with pytest.raises(InputError, match="q: got"):
        mp2a.placements(model, q[0, 1:])
