"""The compiled placements are those of numpy, for any tree, layout and number of samples."""

import numpy as np
import pytest
from helpers import ALL_JOINTS, random_forest, relative_error
from hypothesis import given, settings
from hypothesis import strategies as st

import mp2a
from mp2a import InputError, Model, kernels
from mp2a.kernels import batch
from mp2a.results import Placement
from mp2a.serial import placements_numpy

seeds = st.integers(0, 2**32 - 1)
LAYOUTS = {
    "rows": np.ascontiguousarray,
    "columns": np.asfortranarray,
    "every other row": lambda x: np.repeat(x, 2, axis=0)[::2],
    "every other column": lambda x: np.repeat(x, 2, axis=1)[:, ::2],
}
needs_kernels = pytest.mark.skipif(not kernels.status().compiled, reason="no compiled kernels here")


@given(
    n=st.integers(1, 20),
    samples=st.integers(1, 35),
    branching=st.integers(1, 4),
    seed=seeds,
    layout=st.sampled_from(sorted(LAYOUTS)),
    threads=st.integers(1, 3),
)
@settings(max_examples=100)
def test_equals_numpy(n, samples, branching, seed, layout, threads):
    model = random_forest(n, seed, branching)
    q, _, _ = model.random_state(samples, seed)
    found, expected = mp2a.placements(model, LAYOUTS[layout](q), threads=threads), placements_numpy(model, q)
    for got, wanted in zip(found, expected, strict=True):
        assert got.shape == wanted.shape
        assert got.flags.c_contiguous
        assert relative_error(got, wanted) <= 1e-13


@needs_kernels
@given(n=st.integers(1, 12), samples=st.integers(1, 30), data=st.data(), seed=seeds)
def test_what_is_not_a_number_stays_in_its_sample(n, samples, data, seed):
    model = random_forest(n, seed, 3)
    q, _, _ = model.random_state(samples, seed)
    clean, found = (Placement(np.empty((samples, n, 3, 3)), np.empty((samples, n, 3))) for _ in range(2))
    assert batch.placements(model, q, clean)
    bad = data.draw(st.integers(0, samples - 1))
    q[bad, data.draw(st.integers(0, model.nq - 1))] = np.nan
    assert batch.placements(model, q, found) is False
    others = np.arange(samples) != bad
    for got, wanted in zip(found, clean, strict=True):
        assert np.array_equal(got[others], wanted[others])


@pytest.mark.parametrize("samples", [None, 1, 21])
def test_placements_of_an_earlier_call_are_filled_again(samples):
    model = Model.random(6, joints=ALL_JOINTS)
    old, new = (model.random_state(samples, seed)[0] for seed in (1, 2))
    out, expected = mp2a.placements(model, old), mp2a.placements(model, new)
    assert mp2a.placements(model, new, out=out) is out
    for got, wanted in zip(out, expected, strict=True):
        assert np.array_equal(got, wanted)
    single = Placement(*(part.astype(np.float32) for part in out))
    for wrong in (np.empty(3), tuple(out), Placement(*(part[..., :2, :] for part in out)), single, Placement(0, 0)):
        with pytest.raises(InputError, match=r"out: got .*, expected what an earlier call returned"):
            mp2a.placements(model, new, out=wrong)


@pytest.mark.parametrize("order", "CF")
def test_placements_may_lie_over_the_coordinates(order):
    model = Model.random(6)
    out = mp2a.placements(model, np.zeros((21, 6)))
    q = out.rotation.reshape(-1)[50 : 50 + 21 * 6].reshape((21, 6), order=order)
    q[...] = model.random_state(21)[0]
    expected = mp2a.placements(model, q.copy())
    mp2a.placements(model, q, out=out)
    for got, wanted in zip(out, expected, strict=True):
        assert np.array_equal(got, wanted)


@pytest.mark.parametrize("samples", [None, 11])
def test_wrong_coordinates_are_named(samples):
    model = Model.random(7, joints=ALL_JOINTS)
    q = model.random_state(samples)[0]
    q[..., 4] = np.nan
    with pytest.raises(InputError, match="q: got nan in sample 0, column 4"):
        mp2a.placements(model, q)
    with pytest.raises(InputError, match=r"q: got shape \(2,\)"):
        mp2a.placements(model, [0.0, 1.0])
    with pytest.raises(InputError, match="q: got no sample"):
        mp2a.placements(model, np.empty((0, model.nq)))
    with pytest.raises(InputError, match="threads: got 0"):
        mp2a.placements(model, model.neutral, threads=0)


@pytest.mark.parametrize("samples", [None, 12])
def test_very_large_angles(samples):
    model = Model.random(5)
    q = np.array(model.random_state(samples)[0])
    q[..., 2] = -3e8
    found, expected = mp2a.placements(model, q), placements_numpy(model, q.reshape(-1, 5))
    for got, wanted in zip(found, expected, strict=True):
        assert relative_error(got.reshape(wanted.shape), wanted) <= 1e-13


def test_without_compiled_kernels_numpy_does_it(monkeypatch):
    model = Model.random(6, joints=ALL_JOINTS)
    q = model.random_state(9)[0]
    compiled, one = mp2a.placements(model, q), mp2a.placements(model, q[3])
    monkeypatch.setattr(kernels, "compiled", lambda name: None)
    other = Model(**{name: getattr(model, name) for name in model.__dataclass_fields__})
    for model_ in (model, other):
        for got, wanted in zip(mp2a.placements(model_, q), compiled, strict=True):
            assert relative_error(got, wanted) <= 1e-13
        for got, wanted in zip(mp2a.placements(model_, q[3]), one, strict=True):
            assert relative_error(got, wanted) <= 1e-13
