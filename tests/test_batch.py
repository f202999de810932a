"""The compiled recursion gives what numpy's gives, for any chain, layout and number of samples."""

import dataclasses
import os
import re
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from helpers import ALL_JOINTS, random_forest, random_load, relative_error
from hypothesis import given, settings
from hypothesis import strategies as st

import mp2a
from mp2a import InputError, Model, cores, kernels
from mp2a.joint_kinematics import BaseMotion
from mp2a.kernels import batch, compiler, library, long
from mp2a.methods import METHODS
from mp2a.serial import reduce_block_numpy, rnea_numpy
from mp2a.spatial import to_linear_first
from mp2a.validation import check_shapes, check_state

RESULTS = ("velocity", "acceleration", "force", "torque")
EARTH = np.array([0.0, 0, 0, 0, 0, 0, 0, 0, 9.81, 0, 0, 0])

WITHOUT_VECTORS = {
    "replay", "replay_call", "pool_worker", "pool_run", "direct_call", "rnea_scalar", "rnea_scalar_bodies",
    "placements_scalar", "aba_scalar",
}  # fmt: skip

pytestmark = pytest.mark.skipif(not kernels.status().compiled, reason="no compiled kernels here")
seeds = st.integers(0, 2**32 - 1)


def numpy_results(model, state, forces, gravity):
    """What numpy's recursion gives, samples first."""
    base = BaseMotion.at_rest(np.asarray(gravity))
    torque, bodies, _ = rnea_numpy(model, check_state(model, *state, forces), base)
    placement = mp2a.placements(model, state[0])
    return mp2a.InverseDynamics(bodies[..., :6], bodies[..., 6:12], bodies[..., 12:], torque, placement)


def agree(found, expected, tolerance):
    for name in RESULTS:
        a, b = getattr(found, name), getattr(expected, name)
        assert a.shape == b.shape
        assert relative_error(a, b) <= tolerance, name


LAYOUTS = {
    "rows": np.ascontiguousarray,
    "columns": np.asfortranarray,
    "every other row": lambda x: np.repeat(x, 2, axis=0)[::2],
    "every other column": lambda x: np.repeat(x, 2, axis=1)[:, ::2],
    "backwards": lambda x: np.ascontiguousarray(x[::-1])[::-1],
    "part of rows": lambda x: np.hstack((x, x))[:, : x.shape[1]],
    "part of columns": lambda x: np.asfortranarray(np.vstack((x, x)))[: len(x)],
}


@given(
    n=st.integers(1, 20),
    samples=st.integers(1, 35),
    branching=st.integers(1, 4),
    seed=seeds,
    layouts=st.tuples(*[st.sampled_from(sorted(LAYOUTS))] * 3),
    force=st.sampled_from(("none", "constant", "each")),
    threads=st.integers(1, 3),
)
@settings(max_examples=150)
def test_equals_numpy(n, samples, branching, seed, layouts, force, threads):
    model = random_forest(n, seed, branching)
    state = model.random_state(samples, seed)
    forces, gravity = random_load(model, samples if force == "each" else None, seed)
    forces = None if force == "none" else forces
    laid_out = [LAYOUTS[layout](x) for layout, x in zip(layouts, state, strict=True)]
    found = mp2a.rnea(model, *laid_out, forces, gravity, bodies=True, threads=threads)
    agree(found, numpy_results(model, state, forces, gravity), 1e-12)
    torque = mp2a.rnea(model, *laid_out, forces, gravity, threads=threads)
    assert relative_error(torque, found.torque) <= 1e-13


@given(n=st.integers(1, 12), samples=st.integers(1, 40), seed=seeds, columns=st.booleans())
@settings(max_examples=40)
def test_single_precision(n, samples, seed, columns):
    model = random_forest(n, seed, 2)
    state = [np.asarray(x, dtype=np.float32, order="F" if columns else "C") for x in model.random_state(samples, seed)]
    found = mp2a.rnea(model, *state, bodies=True, dtype=np.float32)
    assert all(getattr(found, name).dtype == np.float32 for name in RESULTS)
    units = [x.astype(float) for x in state]
    assert relative_error(found.torque, mp2a.rnea(model, *units)) <= 1e-3


def test_results_are_laid_out_as_the_input_is():
    model = Model.random(5)
    state = model.random_state(24)
    assert mp2a.rnea(model, *state).flags.c_contiguous
    columns = [np.ascontiguousarray(x.T) for x in state]
    torque = mp2a.rnea(model, *(x.T for x in columns))
    assert torque.T.flags.c_contiguous
    assert relative_error(torque, mp2a.rnea(model, *state)) <= 1e-14


@pytest.mark.parametrize("layout", LAYOUTS)
def test_torques_go_where_they_are_told(layout):
    model = Model.random(6, joints=ALL_JOINTS)
    state = model.random_state(21)
    out = LAYOUTS[layout](np.full((21, model.nv), np.nan))
    assert mp2a.rnea(model, *state, out=out) is out
    assert np.array_equal(out, mp2a.rnea(model, *state))
    one = np.empty(model.nv)
    assert mp2a.rnea(model, *(x[3] for x in state), out=one) is one
    assert relative_error(one, out[3]) <= 1e-13


@pytest.mark.parametrize("samples", [None, 1, 21])
@pytest.mark.parametrize("n", [1, 6, long.WORTH_IT])
def test_results_of_an_earlier_call_are_filled_again(n, samples):
    model = Model.random(n)
    old, new = (model.random_state(samples, seed) for seed in (1, 2))
    first, expected = (mp2a.rnea(model, *state, bodies=True) for state in (old, new))
    again = mp2a.rnea(model, *new, bodies=True, out=first)
    for name in RESULTS:
        assert np.shares_memory(getattr(again, name), getattr(first, name))
        assert np.array_equal(getattr(first, name), getattr(expected, name))
    assert again is first
    apart = [getattr(first, name).copy() for name in RESULTS]
    for wrong in (np.empty((1, 1)), expected.torque, mp2a.InverseDynamics(*apart, first.placement)):
        with pytest.raises(InputError, match="out: got"):
            mp2a.rnea(model, *new, bodies=True, out=wrong)


@pytest.mark.parametrize("samples", [None, 21])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("method", ["serial", *METHODS])
def test_every_method_fills_all_of_an_earlier_result(method, samples, dtype):
    model = Model.random(6, joints=ALL_JOINTS)
    old, new = (model.random_state(samples, seed) for seed in (1, 2))
    expected = mp2a.rnea(model, *new, bodies=True, method=method, dtype=dtype)
    for first_method in ("serial", "sweep"):
        earlier = mp2a.rnea(model, *old, bodies=True, method=first_method, dtype=dtype)
        arrays = [getattr(earlier, name) for name in RESULTS]
        assert not np.array_equal(earlier.placement.translation, expected.placement.translation)
        assert mp2a.rnea(model, *new, bodies=True, method=method, dtype=dtype, out=earlier) is earlier
        for name, array in zip(RESULTS, arrays, strict=True):
            assert getattr(earlier, name) is array
            assert array.dtype == dtype
            assert np.array_equal(array, getattr(expected, name))
        for got, wanted in zip(earlier.placement, expected.placement, strict=True):
            assert got.dtype == dtype
            assert np.array_equal(got, wanted)


@pytest.mark.parametrize("samples", [None, 12, 21])
@pytest.mark.parametrize("method", ["serial", "sweep"])
@pytest.mark.parametrize("start", [0, 7, 93])
@pytest.mark.parametrize("argument", ["q", "v", "a", "external_forces"])
def test_an_earlier_result_may_overlap_the_input(argument, start, method, samples):
    """The input is memory that the result is in, as it lies there, so that no kernel needs a copy of it."""
    model = Model.uniform(6)
    arguments = dict(zip("qva", model.random_state(samples), strict=True))
    result = mp2a.rnea(model, **arguments, bodies=True)
    memory = np.lib.stride_tricks.as_strided(result.velocity, (3 * result.velocity.size,), (8,))
    shape = (*arguments["q"].shape, 6) if argument == "external_forces" else arguments["q"].shape
    start = start if start + np.prod(shape) <= memory.size else 0
    arguments[argument] = memory[start : start + np.prod(shape)].reshape(shape)
    expected = mp2a.rnea(model, **{name: array.copy() for name, array in arguments.items()}, bodies=True, method=method)
    mp2a.rnea(model, **arguments, bodies=True, method=method, out=result)
    for name in RESULTS:
        assert np.array_equal(getattr(result, name), getattr(expected, name)), name
    for got, wanted in zip(result.placement, expected.placement, strict=True):
        assert np.array_equal(got, wanted)


def test_torque_and_motion_of_a_result_may_not_overlap():
    model = Model.uniform(6)
    state = model.random_state(3)
    result = mp2a.rnea(model, *state, bodies=True)
    result.torque = result.force[..., 2]
    with pytest.raises(InputError, match="out: got a torque that shares memory"):
        mp2a.rnea(model, *state, bodies=True, out=result)


@pytest.mark.parametrize("order", "CF")
@pytest.mark.parametrize("which", [1, 2])
def test_torques_may_replace_the_input(order, which):
    model = Model.random(9)
    state = [np.asarray(x, order=order) for x in model.random_state(21)]
    expected = mp2a.rnea(model, *state)
    assert np.array_equal(mp2a.rnea(model, *state, out=state[which]), expected)
    assert np.array_equal(state[which], expected)


@pytest.mark.parametrize(
    "argument, word",
    [
        ({"out": np.empty((4, 3))}, r"out: got float64 \(4, 3\), expected a writeable array of float64 \(5, 3\)"),
        ({"out": np.empty((5, 3), np.float32)}, "out: got float32"),
        ({"out": [0.0]}, "out: got list"),
        ({"out": np.broadcast_to(0.0, (5, 3))}, "out: got"),
        ({"dtype": np.int64}, "dtype: got int64, expected float64 or float32"),
        ({"dtype": "nonsense"}, "dtype: got 'nonsense'"),
        ({"threads": 0}, "threads: got 0"),
        ({"threads": 1.5}, "threads: got 1.5"),
    ],
)
def test_wrong_arguments_are_refused(argument, word):
    model = Model.random(3)
    with pytest.raises(InputError, match=word):
        mp2a.rnea(model, *model.random_state(5), **argument)


@given(n=st.integers(1, 12), samples=st.integers(1, 30), data=st.data(), seed=seeds)
def test_what_is_not_a_number_stays_in_its_sample(n, samples, data, seed):
    model = random_forest(n, seed, 3)
    clean = check_shapes(model, *model.random_state(samples, seed), np.zeros((samples, n, 6)))
    expected = batch.rnea(model, clean, EARTH)
    assert expected.valid
    which = data.draw(st.sampled_from(("q", "v", "a", "external")))
    bad = data.draw(st.integers(0, samples - 1))
    spoiled = np.array(getattr(clean, which), copy=True)
    row = spoiled[:, bad] if which == "external" else spoiled[bad]
    row[data.draw(st.integers(0, len(row) - 1))] = np.nan
    found = batch.rnea(model, clean._replace(**{which: spoiled}), EARTH)
    others = np.arange(samples) != bad
    assert np.array_equal(found.torque[others], expected.torque[others])
    # A torque need not depend on it (a sliding joint on the base), but what the base feels does.
    assert np.isnan(found.root[:, bad]).any()
    assert np.isnan(found.torque[bad]).any() or n == 1
    assert not found.valid


@pytest.mark.parametrize("samples", [None, 11])
@pytest.mark.parametrize("number", [np.nan, np.inf])
@pytest.mark.parametrize("which", range(4))
def test_numbers_that_are_not_finite_are_named(samples, number, which):
    model = Model.random(7, joints=ALL_JOINTS)
    state = [*model.random_state(samples), np.zeros((7, 6) if samples is None else (samples, 7, 6))]
    state[which][..., 4] = number
    name = ("q", "v", "a", "external_forces")[which]
    with pytest.raises(InputError, match=f"{name}: got {number}"):
        mp2a.rnea(model, *state)


@given(angle=st.floats(-1e6, 1e6), seed=seeds)
def test_sine_and_cosine_to_rounding(angle, seed):
    """A pendulum's torques are the cosine and the sine of its angle."""
    model = Model.uniform(1, offset=(2.0, 0.0, 0.0))
    angles = np.append(np.random.default_rng(seed).uniform(-10, 10, 30), angle)[:, None]
    still = np.zeros_like(angles)
    sine = mp2a.rnea(model, angles, still, still, gravity=(1.0, 0, 0))
    cosine = mp2a.rnea(model, angles, still, still, gravity=(0, -1.0, 0))
    assert np.max(np.abs(sine - np.sin(angles))) < 3e-16
    assert np.max(np.abs(cosine - np.cos(angles))) < 3e-16


@pytest.mark.parametrize("angle", [1.1e6, -3e8, 1e15])
def test_very_large_angles(angle):
    model = Model.random(5)
    q, v, a = model.random_state(12)
    q[7, 2] = angle
    assert not batch.rnea(model, check_shapes(model, q, v, a, None), EARTH).valid
    expected = numpy_results(model, (q, v, a), None, np.array([0, 0, -9.81]))
    assert relative_error(mp2a.rnea(model, q, v, a), expected.torque) <= 1e-13


@given(n=st.integers(1, 8), samples=st.integers(1, 12), seed=seeds, moving=st.booleans())
@settings(max_examples=30)
def test_base_moves_and_tip_is_pushed(n, samples, seed, moving):
    """A moving base is a free joint that moves like it; a push on the tip is an external force on the last body."""
    model = Model.random(n, seed, ALL_JOINTS)
    carrier = Model.random(1, joints=("free",))
    carrier = dataclasses.replace(carrier, masses=[0.0], inertias=np.zeros((1, 3, 3)))
    parts = {
        field.name: np.concatenate((getattr(carrier, field.name), getattr(model, field.name)))
        for field in dataclasses.fields(Model)
        if field.name not in ("parents", "joints", "names", "gravity")
    }
    whole = Model(np.append(-1, model.parents + 1), carrier.joints + model.joints, **parts)
    q, v, a = whole.random_state(samples, seed)
    push = np.random.default_rng(seed).normal(size=(samples, 6))
    forces = np.zeros((samples, n + 1, 6))
    forces[:, -1] = push
    expected = mp2a.rnea(whole, q, v, a, forces, bodies=True)
    velocity, acceleration = expected.velocity[:, 0], expected.acceleration[:, 0]
    base = np.concatenate((velocity[:, :3], acceleration, velocity[:, 3:]), axis=1)
    state = check_shapes(model, q[:, 7:], v[:, 6:], a[:, 6:], None)
    found = batch.rnea(model, state, base, push, bodies=moving)
    assert relative_error(found.torque, expected.torque[:, 6:]) <= 1e-12
    # What the chain puts on its base is what the free joint, which carries no mass, has to give.
    assert relative_error(to_linear_first(found.root.T), expected.torque[:, :6]) <= 1e-11


@given(n=st.integers(1, 90), seed=seeds, threads=st.integers(1, 3), force=st.booleans(), mixed=st.booleans())
@settings(max_examples=60)
def test_blocks_of_a_chain_in_lanes(n, seed, threads, force, mixed):
    model = Model.random(n, seed, ("revolute", "continuous", "prismatic") if mixed else ("revolute",))
    forces, _ = random_load(model, None, seed)
    state = check_shapes(model, *model.random_state(seed=seed), forces if force else None)
    base, tip = np.random.default_rng(seed).normal(size=12), np.random.default_rng(seed).normal(size=(1, 6))
    expected = batch.rnea(model, state, base, tip, bodies=True)
    for bodies in (False, True):
        found = long.rnea(model, state, base, tip, bodies=bodies, threads=threads)
        assert found.valid
        assert relative_error(found.torque, expected.torque) <= 1e-12
        assert relative_error(found.root, expected.root) <= 1e-12
    assert relative_error(found.bodies, expected.bodies) <= 1e-12


def test_long_chain_takes_the_blocks_and_agrees_with_the_scans():
    model = Model.random(long.WORTH_IT, seed=2)
    state = model.random_state(seed=2)
    assert long.fits(model, 1)
    torque = mp2a.rnea(model, *state)
    expected = numpy_results(model, [x[None] for x in state], None, np.array([0, 0, -9.81])).torque[0]
    assert relative_error(torque, expected) < 1e-9
    out = np.empty_like(torque)
    assert mp2a.rnea(model, *state, out=out) is out
    assert np.array_equal(out, torque)
    assert relative_error(torque, mp2a.rnea(model, *state, method="sweep")) < 1e-9
    assert relative_error(torque, mp2a.rnea(model, *(np.tile(x, (3, 1)) for x in state))[1]) < 1e-10


def test_long_chain_names_what_is_wrong():
    model = Model.random(long.WORTH_IT, joints=("revolute", "continuous"), seed=1)
    q, v, a = model.random_state()
    joint = model.joints.index("continuous", 5000)
    q[model.q_starts[joint] : model.q_starts[joint] + 2] *= 1.1
    with pytest.raises(InputError, match=r"length 1\.1"):
        mp2a.rnea(model, q, v, a)
    v[7000] = np.inf
    with pytest.raises(InputError, match="v: got inf"):
        mp2a.rnea(model, model.neutral, v, a)


def test_tables_go_with_their_chain():
    """Another chain at the same address must not find the tables of the one before."""
    for seed in range(20):
        model = Model.random(4, seed=seed)
        state = model.random_state(9)
        assert relative_error(mp2a.rnea(model, *state), mp2a.rnea(model, *state, method="sweep")) <= 1e-12
        del model


@pytest.mark.parametrize("name", sorted(set(library.ARGUMENTS) - WITHOUT_VECTORS))
def test_machine_code_stays_in_vectors(name):
    """Arithmetic is in vectors, sines included; a kernel that lost them is ten times slower."""
    import llvmlite.binding as llvm

    features = llvm.get_host_cpu_features()
    if not (features.get("avx2") and features.get("fma")):
        pytest.skip("this processor has other instructions")
    wide, kind = "zmm" if features.get("avx512f") else "ymm", "ps" if "single" in name else "pd"
    lines = compiler.assembly(name).splitlines()
    packed = sum(bool(re.search(rf"\bv(?:fn?m(?:add|sub)\d+|mul|add|sub){kind}\b.*%{wide}", line)) for line in lines)
    scalar = sum(bool(re.search(r"\bv?(?:fn?m(?:add|sub)\d+|mul|add|sub)s[sd]\b", line)) for line in lines)
    calls = [line for line in lines if re.search(r"\bcall\b|\bcallq\b", line) and "mp2a" not in line]
    if name in library.ELEMENTWISE:  # they have the same formula once more, for the last samples alone
        assert packed >= scalar / 5
    else:
        assert packed >= 60
        assert scalar <= packed / 50
    assert not any(word in line for line in calls for word in ("sin", "cos", "rint"))


@pytest.mark.parametrize("ranks, threads", [("1", 4), ("2", 2), ("3", 1), ("8", 1)])
def test_ranks_share_the_cores(ranks, threads, monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    monkeypatch.setenv("OMPI_COMM_WORLD_LOCAL_SIZE", ranks)
    monkeypatch.setattr(cores.os, "sched_getaffinity", lambda process: set(range(4)), raising=False)
    cores.threads_per_rank.cache_clear()
    try:
        assert cores.threads_per_rank() == threads
    finally:
        cores.threads_per_rank.cache_clear()


def test_without_compiled_kernels_numpy_does_it(monkeypatch):
    model = Model.random(6, joints=ALL_JOINTS)
    state = model.random_state(9)
    compiled = mp2a.rnea(model, *state, bodies=True)
    out = np.empty((9, model.nv), np.float32)
    monkeypatch.setattr(kernels, "compiled", lambda name: None)
    agree(mp2a.rnea(model, *state, bodies=True), compiled, 1e-13)
    assert mp2a.rnea(model, *state, dtype=np.float32, out=out) is out
    assert relative_error(out, compiled.torque) < 1e-6


@pytest.mark.skipif(sys.platform != "linux", reason="reads this process's memory from /proc")
def test_memory_is_linear_in_the_chain_and_given_back():
    """A call leaves nothing behind but the tables of its chain, which go with it."""

    def resident():
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    def once(n):
        model = Model.random(n, seed=1)
        mp2a.rnea(model, *model.random_state())

    once(50_000)
    before = resident()
    for _ in range(4):
        once(50_000)
    assert resident() - before < 30e6


@given(n=st.integers(1, 40), samples=st.integers(1, 20), seed=seeds, force=st.booleans(), cut=st.booleans())
@settings(max_examples=60)
def test_chain_put_together_is_its_segments_put_together(n, samples, seed, force, cut):
    """The kernel that reduces a chain gives what composing and moving body after body gives."""
    samples = 1 if cut else samples
    model = Model.random(n, seed, ("revolute", "continuous", "prismatic") if cut else ALL_JOINTS)
    forces, _ = random_load(model, samples, seed)
    state = check_state(model, *model.random_state(samples, seed), forces if force else None)
    path, below = reduce_block_numpy(model, state)
    for asked in (False, True):
        found = (
            long.reduce_block(model, state, inertia=asked) if cut else batch.reduce_block(model, state, inertia=asked)
        )
        assert found.valid
        assert relative_error(found.path, path) <= 1e-12
    for part in range(28):  # its numbers differ in unit and size
        assert relative_error(found.inertia[:, part], below[:, part]) <= 1e-9 or abs(below[:, part]).max() < 1e-9
    assert relative_error(found.inertia, below) <= 1e-12


def test_torques_of_a_long_chain_go_where_they_are_told():
    model = Model.uniform(long.WORTH_IT)
    state = model.random_state()
    out = np.full(len(model), np.nan)
    found = mp2a.rnea(model, *state, out=out)
    assert np.shares_memory(found, out)
    assert np.array_equal(out, mp2a.rnea(model, *state))


def test_many_callers_share_the_threads():
    """Whoever finds the helpers busy works alone; nobody gets another's torques, and nobody waits for ever."""
    cases = []
    for n, samples in ((3, 40), (9, 300), (2, 9), (17, 64), (5, 1000)):
        model = Model.random(n, seed=n)
        state = model.random_state(samples)
        cases.append((model, state, mp2a.rnea(model, *state, threads=1)))

    def call(k):
        wrong = 0
        for i in range(200):
            model, state, expected = cases[(i * (k + 1)) % len(cases)]
            wrong += not np.array_equal(mp2a.rnea(model, *state, threads=2 + (i + k) % 3), expected)
            if i % 40 == k:
                time.sleep(0.005)  # long enough for helpers to fall asleep
        return wrong

    with ThreadPoolExecutor(4) as callers:
        assert list(callers.map(call, range(4), timeout=120)) == [0, 0, 0, 0]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.parametrize("n, samples", [(8, 400), (long.WORTH_IT, 1)])
def test_forked_process_has_threads_of_its_own(n, samples):
    """A process that is forked after the threads were used must not wait for those of its parent."""
    model = Model.random(n)
    state = model.random_state(samples)
    expected = mp2a.rnea(model, *state, threads=2)
    child = os.fork()
    if not child:
        signal.alarm(20)
        os._exit(not np.array_equal(mp2a.rnea(model, *state, threads=2), expected))
    assert os.waitpid(child, 0)[1] == 0
