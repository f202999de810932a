"""A block of bodies is to its neighbours what a body is, and inside it nothing is lost."""

from functools import partial

import numpy as np
from helpers import ALL_JOINTS, random_load, relative_error
from hypothesis import given
from hypothesis import strategies as st

from mp2a import Model, kernels
from mp2a.algebra import motion
from mp2a.joint_kinematics import BaseMotion
from mp2a.methods import block
from mp2a.serial import reduce_block, reduce_block_numpy, rnea, rnea_numpy
from mp2a.spatial import classical_to_spatial, spatial_to_classical
from mp2a.validation import JointState, check_state

sizes = st.integers(1, 9)
samples = st.integers(1, 10)
seeds = st.integers(0, 2**32 - 1)


def block_of(m, samples, seed):
    """Model of all joint types with its state, and motion for its base."""
    model = Model.random(m, seed, ALL_JOINTS)
    forces, _ = random_load(model, samples, seed)
    state = check_state(model, *model.random_state(samples, seed), forces)
    return model, state, BaseMotion(*np.random.default_rng(seed).normal(size=(2, samples, 6)))


@given(sizes, samples, seeds)
def test_a_block_presses_on_its_base_as_its_load_does(m, samples, seed):
    model, state, base = block_of(m, samples, seed)
    spatial = classical_to_spatial(base.acceleration, base.velocity)
    for reduce, solve in ((reduce_block_numpy, rnea_numpy), (partial(reduce_block, loaded=True), rnea)):
        together = kernels.force(reduce(model, state)[1], base.velocity, spatial)
        assert relative_error(together, solve(model, state, base).base_force) < 1e-12


@given(sizes, samples, seeds)
def test_the_block_end_is_at_the_end_of_the_path_to_it(m, samples, seed):
    model, state, base = block_of(m, samples, seed)
    start = np.zeros((samples, 24))
    start[:, [0, 4, 8]] = 1.0  # a path of no length, from something that stands still
    start[:, 12:18], start[:, 18:] = base.velocity, classical_to_spatial(base.acceleration, base.velocity)
    for reduce, solve in (
        (reduce_block_numpy, rnea_numpy),
        (partial(reduce_block, loaded=False), partial(rnea, bodies=True)),
    ):
        end = motion.compose(start, reduce(model, state)[0])
        last = solve(model, state, base).bodies[:, -1]
        assert relative_error(end[:, 12:18], last[:, :6]) < 1e-12
        assert relative_error(spatial_to_classical(end[:, 18:], end[:, 12:18]), last[:, 6:12]) < 1e-12


def part(model, state, bodies):
    """State of consecutive bodies."""
    q, v = (slice(starts[bodies.start], starts[bodies.stop]) for starts in (model.q_starts, model.v_starts))
    external = None if state.external is None else state.external[bodies.start : bodies.stop]
    return JointState(state.q[:, q], state.v[:, v], state.a[:, v], external, state.single)


@given(m=st.integers(2, 9), samples=samples, seed=seeds, data=st.data())
def test_two_blocks_are_one(m, samples, seed, data):
    """Wherever a chain is cut, inside and outside together give what the whole gives."""
    model, state, base = block_of(m, samples, seed)
    at = data.draw(st.integers(1, m - 1))
    whole = rnea(model, state, base, bodies=True)
    parts = [(model.block(cut), part(model, state, cut)) for cut in (range(at), range(at, m))]
    end = whole.bodies[:, at - 1]
    outer = rnea(*parts[1], BaseMotion(end[:, :6], end[:, 6:12]), bodies=True)
    inner = rnea(*parts[0], base, -outer.base_force, bodies=True)
    assert relative_error(np.concatenate((inner.bodies, outer.bodies), axis=1), whole.bodies) < 1e-12
    assert relative_error(np.concatenate((inner.torque, outer.torque), axis=1), whole.torque) < 1e-12
    assert relative_error(inner.base_force, whole.base_force) < 1e-12


@given(st.integers(1, 200), st.integers(1, 50))
def test_shares_are_even(bodies, ranks):
    counts = block.even_counts(bodies, ranks)
    assert (len(counts), sum(counts)) == (ranks, bodies)
    assert max(counts) - min(counts) <= 1
    assert list(counts) == sorted(counts, reverse=True)


@given(st.integers(1, 12), st.data())
def test_parts_of_a_chain_are_the_chain(n, data):
    model = Model.random(n, 3, ALL_JOINTS)
    at = data.draw(st.integers(0, n))
    parts = [model.block(bodies) for bodies in (range(at), range(at, n)) if len(bodies)]
    assert all(part.is_serial for part in parts)
    for field in ("axes", "rotations", "translations", "masses", "coms", "inertias"):
        assert np.array_equal(np.concatenate([getattr(part, field) for part in parts]), getattr(model, field))
    assert sum((part.joints for part in parts), ()) == model.joints
    assert sum((part.names for part in parts), ()) == model.names
