"""A block of bodies is to its neighbours what a body is, and inside it nothing is lost."""

import numpy as np
from helpers import ALL_JOINTS, random_load, relative_error
from hypothesis import given
from hypothesis import strategies as st

import mp2a
from mp2a import Chain, kernels
from mp2a.leaf import check_state, joint_motion
from mp2a.methods import block
from mp2a.segments import load, motion
from mp2a.spatial import classical_to_spatial, force_to_child, spatial_to_classical

sizes = st.integers(1, 9)
samples = st.integers(1, 10)
seeds = st.integers(0, 2**32 - 1)


def block_of(m, samples, seed):
    """Chain of all joint types with its state, the paths across its joints and the loads of its bodies."""
    chain = Chain.random(m, seed, ALL_JOINTS)
    forces, gravity = random_load(chain, samples, seed)
    state = check_state(chain, *chain.random_state(samples, seed), forces)
    paths = motion.leaf(joint_motion(chain, state))
    loads = load.leaf(chain.masses, chain.coms, chain.origin_inertias, state.external, samples)
    return chain, state, gravity, paths, loads


@given(sizes, samples, seeds)
def test_a_block_presses_on_its_head_as_its_bodies_do(m, samples, seed):
    _, _, _, paths, loads = block_of(m, samples, seed)
    velocity, acceleration = np.random.default_rng(seed).normal(size=(2, samples, 6))
    inside = block.expand(paths, loads, velocity, acceleration)
    assert np.array_equal(inside.velocity[0], velocity)
    assert np.array_equal(inside.acceleration[0], acceleration)
    together = kernels.force(block.reduce(paths, loads), velocity, acceleration)
    assert relative_error(together, inside.force[0]) < 1e-12


@given(sizes, samples, seeds)
def test_the_tail_is_at_the_end_of_the_path_to_it(m, samples, seed):
    _, _, _, paths, loads = block_of(m, samples, seed)
    velocity, acceleration = np.random.default_rng(seed).normal(size=(2, samples, 6))
    inside = block.expand(paths, loads, velocity, acceleration)
    head = motion.compose(block.tail(paths[:1]), block.tail(paths[:1]))  # a path of no length
    head[:, 12:18], head[:, 18:] = velocity, acceleration
    end = motion.compose(head, block.tail(paths))
    assert relative_error(end[:, 12:18], inside.velocity[-1]) < 1e-12
    assert relative_error(end[:, 18:], inside.acceleration[-1]) < 1e-12


@given(m=st.integers(2, 9), samples=samples, seed=seeds, data=st.data())
def test_two_blocks_are_one(m, samples, seed, data):
    """Wherever a chain is cut, inside and outside together give what the serial recursion gives."""
    chain, state, gravity, paths, loads = block_of(m, samples, seed)
    at = data.draw(st.integers(1, m - 1))
    whole = mp2a.rnea(chain, state.q, state.v, state.a, np.moveaxis(state.external, 1, 0), gravity, bodies=True)
    expected = [np.moveaxis(x, 0, 1) for x in (whole.velocity, whole.acceleration, whole.force)]
    spatial = classical_to_spatial(expected[1], expected[0])
    outer = block.expand(paths[at:], loads[at:], expected[0][at], spatial[at])
    inner = block.expand(paths[:at], loads[:at], expected[0][0], spatial[0])
    # What the outer block takes, at the head of the inner one, and from there back to its tail.
    across = block.tail(paths[:at])
    at_head = kernels.carry(across, kernels.carry(paths[at], outer.force[0]))
    turn, shift, _, _ = motion.view(across)
    block.press(paths[:at], inner.force, force_to_child(turn, shift, at_head))
    force = np.concatenate((inner.force, outer.force))
    velocity = np.concatenate((inner.velocity, outer.velocity))
    acceleration = np.concatenate((inner.acceleration, outer.acceleration))
    assert relative_error(force, expected[2]) < 1e-12
    assert relative_error(velocity, expected[0]) < 1e-12
    assert relative_error(spatial_to_classical(acceleration, velocity), expected[1]) < 1e-12


@given(st.integers(1, 200), st.integers(1, 50))
def test_shares_are_even(bodies, ranks):
    counts = block.share(bodies, ranks)
    assert (len(counts), sum(counts)) == (ranks, bodies)
    assert max(counts) - min(counts) <= 1
    assert list(counts) == sorted(counts, reverse=True)


@given(st.integers(1, 12), st.data())
def test_parts_of_a_chain_are_the_chain(n, data):
    chain = Chain.random(n, 3, ALL_JOINTS)
    at = data.draw(st.integers(0, n))
    parts = [block.cut(chain, bodies) for bodies in (range(at), range(at, n)) if len(bodies)]
    assert all(part.is_serial for part in parts)
    for field in ("axes", "rotations", "translations", "masses", "coms", "inertias"):
        assert np.array_equal(np.concatenate([getattr(part, field) for part in parts]), getattr(chain, field))
    assert sum((part.joints for part in parts), ()) == chain.joints
    assert sum((part.names for part in parts), ()) == chain.names
