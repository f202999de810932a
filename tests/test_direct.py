"""One sample, for which the interpreter calls a kernel itself, gives what any other call gives."""

import pickle
import sys
import weakref
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from helpers import ALL_JOINTS, random_forest, relative_error
from hypothesis import given
from hypothesis import strategies as st

import mp2a
from mp2a import InputError, Model, kernels
from mp2a.kernels import direct

pytestmark = pytest.mark.skipif(not kernels.status().compiled, reason="no compiled kernels here")
seeds = st.integers(0, 2**32 - 1)

UNUSUAL = {
    "list": lambda x: x.tolist(),
    "apart": lambda x: np.repeat(x, 2)[::2],
    "backwards": lambda x: np.ascontiguousarray(x[::-1])[::-1],
    "other byte order": lambda x: x.astype(x.dtype.newbyteorder()),
    "subclass": np.ma.masked_array,
    "pickled": lambda x: pickle.loads(pickle.dumps(x)),
    "read-only": lambda x: np.frombuffer(x.tobytes()),
    "odd address": lambda x: np.frombuffer(b"." + x.tobytes(), offset=1),
}
"""Arrays of the same numbers, some of which the direct call does not take."""


@given(n=st.integers(1, 20), branching=st.integers(1, 4), seed=seeds)
def test_equals_the_call_with_samples(n, branching, seed):
    model = random_forest(n, seed, branching)
    state = model.random_state(seed=seed)
    torque, out = mp2a.rnea(model, *state), np.empty(model.nv)
    assert mp2a.rnea(model, *state, out=out) is out
    assert np.array_equal(out, torque)
    assert relative_error(torque, mp2a.rnea(model, *(np.tile(x, (9, 1)) for x in state))[4]) <= 1e-13
    assert relative_error(torque, mp2a.rnea(model, *state, method="sweep")) <= 1e-11
    placement, again = (mp2a.placements(model, state[0]) for _ in range(2))
    assert mp2a.placements(model, 0 * state[0] + model.neutral, out=again) is again
    assert mp2a.placements(model, state[0], out=again) is again
    many = mp2a.placements(model, np.tile(state[0], (9, 1)))
    for one, other, each in zip(placement, again, many, strict=True):
        assert np.array_equal(one, other)
        assert relative_error(one, each[4]) <= 1e-13


@pytest.mark.parametrize("layout", UNUSUAL)
def test_whatever_the_arrays_are(layout):
    model = Model.random(6, joints=ALL_JOINTS)
    state = model.random_state()
    expected = mp2a.rnea(model, *state)
    for which in range(3):
        arrays = list(state)
        arrays[which] = UNUSUAL[layout](state[which])
        assert np.array_equal(mp2a.rnea(model, *arrays), expected)
    for got, wanted in zip(
        mp2a.placements(model, UNUSUAL[layout](state[0])), mp2a.placements(model, state[0]), strict=True
    ):
        assert np.array_equal(got, wanted)


def test_what_does_not_fit_is_left_alone():
    model = Model.random(4)
    state, out = model.random_state(), np.full(4, 7.0)
    call = direct.RNEA.get(model)
    fixed = np.zeros(4)
    fixed.flags.writeable = False
    for arguments in (
        (), (out, *state[:2]), (out, *state, out), (out, 1.0, *state[1:]), (None, *state), (fixed, *state),
        (out[:3], *state), (out, state[0][:3], *state[1:]), (out, state[0][None], *state[1:]),
        (out, np.zeros(4, np.int64), *state[1:]), (out, np.array(0.0), *state[1:]),
    ):  # fmt: skip
        assert call(*arguments) is None
    for number in (np.nan, np.inf, 1e7):
        assert call(out, np.full(4, number), *state[1:]) is False
    assert (out == 7.0).all()
    assert call(out, *state) is True
    assert np.array_equal(out, mp2a.rnea(model, *state))


def test_numbers_that_are_not_as_they_should_be():
    model = Model.random(4, joints=("revolute", "spherical"), seed=3)
    q, v, a = model.random_state()
    turned = q.copy()
    turned[model.q_starts[model.joints.index("revolute")]] += 2e7 * np.pi  # more than the kernel takes
    assert relative_error(mp2a.rnea(model, turned, v, a), mp2a.rnea(model, q, v, a)) < 1e-7
    assert relative_error(mp2a.placements(model, turned).translation, mp2a.placements(model, q).translation) < 1e-7
    wrong = q.copy()
    wrong[model.q_starts[model.joints.index("spherical")]] += 1
    for call in (lambda: mp2a.rnea(model, wrong, v, a), lambda: mp2a.placements(model, wrong)):
        with pytest.raises(InputError, match="q: got a quaternion of length"):
            call()
    with pytest.raises(InputError, match=r"v: got nan in sample 0, column 0 \(joint 'joint1'\)"):
        mp2a.rnea(model, q, np.full(model.nv, np.nan), a)
    with pytest.raises(InputError, match=r"out: got float64 \(1,\)"):
        mp2a.rnea(model, q, v, a, out=np.empty(1))


@pytest.mark.parametrize("which", range(3))
def test_torques_may_replace_the_input(which):
    model = Model.random(6)
    state = model.random_state()
    expected = mp2a.rnea(model, *state)
    mp2a.rnea(model, *state, out=state[which])
    assert np.array_equal(state[which], expected)


@pytest.mark.parametrize("angle", [0.0, 1e7])
def test_placements_may_lie_over_the_coordinates(angle):
    model = Model.random(6)
    out = mp2a.placements(model, np.zeros(6))
    q = out.rotation.reshape(-1)[3:9]
    q[:] = np.arange(6.0)
    q[2] += angle
    expected = mp2a.placements(model, q.copy())
    for got, wanted in zip(mp2a.placements(model, q, out=out), expected, strict=True):
        assert np.array_equal(got, wanted)


def test_references_are_counted():
    """What is returned is held once more, and nothing else is."""
    model = Model.random(3)
    state, out = model.random_state(), np.empty(3)
    call = direct.RNEA.get(model)
    objects = (True, False, None, out, *state)
    before = [sys.getrefcount(x) for x in objects]
    for _ in range(5000):
        call(out, *state)
        call(out, 0 * state[0] + np.nan, *state[1:])
        call(None, *state)
    assert max(abs(sys.getrefcount(x) - count) for x, count in zip(objects, before, strict=True)) < 1000


def test_plan_goes_with_its_model():
    model = Model.random(3)
    assert direct.RNEA.get(model) is direct.RNEA.get(model)
    mp2a.placements(model, np.zeros(3))
    alive = weakref.ref(model)
    del model
    assert alive() is None


def test_callers_in_several_threads():
    models = [Model.random(n, seed=n) for n in (2, 7, 12)]
    cases = [(model, *model.random_state(seed=k)) for model in models for k in range(4)]
    expected = [mp2a.rnea(*case, method="sweep") for case in cases]

    def call(start):
        return max(
            relative_error(mp2a.rnea(*cases[k % len(cases)]), expected[k % len(cases)])
            for k in range(start, start + 2000)
        )

    with ThreadPoolExecutor(4) as callers:
        assert max(callers.map(call, range(4), timeout=120)) < 1e-11


def test_long_chains_are_not_called_directly():
    """They give up the interpreter's lock, and are cut into blocks."""
    model = Model.uniform(direct._MOST_BODIES + 1)
    assert direct.RNEA.get(model) is None
    assert mp2a.rnea(model, *model.random_state()).shape == (len(model),)
    assert mp2a.placements(model, model.neutral).translation.shape == (len(model), 3)


def test_where_objects_are_of_another_form(monkeypatch):
    """As in a Python without the lock that plans rely on."""
    monkeypatch.setattr(direct, "is_usual", lambda: False)
    model = Model.random(5)
    state = model.random_state()
    assert direct.RNEA.get(model) is None
    assert relative_error(mp2a.rnea(model, *state), mp2a.rnea(model, *state, method="sweep")) < 1e-12
    assert mp2a.placements(model, state[0]).rotation.shape == (5, 3, 3)
