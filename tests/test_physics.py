"""Laws of mechanics that hold whatever formula computes the torque."""

import dataclasses

import numpy as np
import pinocchio
from helpers import derivative, on_top_of, placements, random_forest, random_load, relative_error
from hypothesis import given, settings
from hypothesis import strategies as st

import mp2a
from mp2a import Chain
from mp2a.spatial import force_to_parent, inertia_at_origin

# The five-point formula with this step is off by about step⁴ = 1e-12 times the fifth derivative, and by rounding,
# 1e-16 / 1e-3 of the differentiated quantity; both stay well below 1e-7 of the terms of a law for a few bodies.
STEP, NUMERICAL = 1e-3, 1e-7
EXACT = 1e-12
few = settings(max_examples=25)


@st.composite
def moving(draw):
    """A chain or tree of all joint types, its state, a load and gravity."""
    seed = draw(st.integers(0, 2**32 - 1))
    chain = random_forest(draw(st.integers(1, 8)), seed, branching=draw(st.integers(1, 3)))
    return chain, chain.random_state(seed=seed), *random_load(chain, seed=seed)


def along(chain, q, v, a, quantity):
    """Time derivative of ``quantity(q, v)`` of a moving chain.

    The curve q(t) = q ⊕ (v t + a t²/2), v(t) = v + a t need only leave in the right direction: a derivative at t = 0
    depends on nothing else.
    """
    model = chain.to_pinocchio()
    return derivative(lambda t: quantity(pinocchio.integrate(model, q, v * t + a * t**2 / 2), v + a * t), STEP)


def velocities(chain, q, v):
    return mp2a.rnea(chain, q, v, np.zeros(chain.nv), bodies=True).velocity


def momenta(chain, velocity):
    """Momentum ``[angular; linear]`` of each body about its origin, body frame."""
    w, v = velocity[:, :3], velocity[:, 3:]
    linear = chain.masses[:, None] * (v + np.cross(w, chain.coms))
    inertias = inertia_at_origin(chain.masses, chain.coms, chain.inertias)
    angular = np.einsum("nij,nj->ni", inertias, w) + chain.masses[:, None] * np.cross(chain.coms, v)
    return np.concatenate((angular, linear), axis=1)


def kinetic_energy(chain, q, v):
    velocity = velocities(chain, q, v)
    return 0.5 * np.sum(momenta(chain, velocity) * velocity)


def centres(chain, q):
    rotations, origins = placements(chain, q)
    return origins + np.einsum("nij,nj->ni", rotations, chain.coms)


def potential_energy(chain, q, gravity):
    return -chain.masses @ centres(chain, q) @ gravity


def in_base(chain, q, forces):
    """Sum of body forces ``(n, 6)``, in the base frame about its origin."""
    return force_to_parent(*placements(chain, q), forces).sum(axis=0)


@few
@given(case=moving())
def test_power_of_joints_and_loads_is_the_rate_of_energy(case):
    chain, (q, v, a), forces, gravity = case
    torque = mp2a.rnea(chain, q, v, a, forces, gravity)
    powers = torque @ v, np.sum(forces * velocities(chain, q, v))
    rates = (
        along(chain, q, v, a, lambda q, v: kinetic_energy(chain, q, v)),
        along(chain, q, v, a, lambda q, v: potential_energy(chain, q, gravity)),
    )
    assert abs(sum(powers) - sum(rates)) < NUMERICAL * (1 + max(map(abs, (*powers, *rates))))


@few
@given(case=moving())
def test_base_force_and_loads_are_the_rate_of_momentum(case):
    chain, (q, v, a), forces, gravity = case
    motion = mp2a.rnea(chain, q, v, a, forces, gravity, bodies=True)
    from_base = np.where((chain.parents < 0)[:, None], motion.force, 0.0)
    weight = chain.masses[:, None] * gravity
    weights = np.concatenate((np.cross(centres(chain, q), weight), weight), axis=1).sum(axis=0)
    total = in_base(chain, q, from_base + forces) + weights
    rate = along(chain, q, v, a, lambda q, v: in_base(chain, q, momenta(chain, velocities(chain, q, v))))
    scale = 1 + max(np.abs(motion.force).max(), np.abs(weights).max(), np.abs(rate).max())
    assert np.abs(total - rate).max() < NUMERICAL * scale


@few
@given(case=moving())
def test_holding_still_takes_the_gradient_of_potential_energy(case):
    chain, (q, _, _), _, gravity = case
    rest = np.zeros(chain.nv)
    gradient = [
        along(chain, q, direction, rest, lambda q, v: potential_energy(chain, q, gravity))
        for direction in np.eye(chain.nv)
    ]
    torque = mp2a.rnea(chain, q, rest, rest, gravity=gravity)
    assert np.abs(torque - gradient).max() < NUMERICAL * (1 + np.abs(torque).max())


@given(case=moving())
def test_loads_superpose_and_do_work_on_the_joints(case):
    chain, (q, v, a), forces, gravity = case
    other = np.roll(forces, 1, axis=1)
    none, first, second, both = (
        mp2a.rnea(chain, q, v, a, load, gravity) for load in (None, forces, other, forces + 2 * other)
    )
    assert np.abs((both - none) - (first - none) - 2 * (second - none)).max() < EXACT * np.abs(both).max() * 10
    virtual_power = (first - none) @ v + np.sum(forces * velocities(chain, q, v))
    assert abs(virtual_power) < EXACT * (1 + np.abs(none).max()) * (1 + np.abs(v).sum())


@given(case=moving())
def test_gravity_is_an_accelerated_base(case):
    chain, (q, v, a), forces, gravity = case
    lift = Chain.uniform(1, "free", mass=0.0)
    lifted = on_top_of(lift, chain)
    state = np.append(lift.neutral, q), np.append(np.zeros(6), v), np.concatenate((-gravity, np.zeros(3), a))
    result = mp2a.rnea(lifted, *state, np.concatenate((np.zeros((1, 6)), forces)), np.zeros(3), bodies=True)
    expected = mp2a.rnea(chain, q, v, a, forces, gravity, bodies=True)
    assert relative_error(result.torque[6:], expected.torque) < EXACT
    assert relative_error(result.acceleration[1:], expected.acceleration) < EXACT
    assert relative_error(result.force[1:], expected.force) < EXACT


@given(case=moving(), seed=st.integers(0, 2**32 - 1))
def test_torque_does_not_depend_on_the_base_frame(case, seed):
    chain, state, forces, gravity = case
    turn = Chain.random(1, seed).rotations[0]
    roots = (chain.parents < 0)[:, None, None]
    turned = dataclasses.replace(
        chain,
        rotations=np.where(roots, turn @ chain.rotations, chain.rotations),
        translations=np.where(roots[:, 0], chain.translations @ turn.T + [1, 2, 3], chain.translations),
    )
    expected = mp2a.rnea(chain, *state, forces, gravity)
    assert relative_error(mp2a.rnea(turned, *state, forces, turn @ gravity), expected) < EXACT


@given(case=moving())
def test_mass_matrix_is_symmetric_and_positive(case):
    chain, (q, v, a), _, gravity = case
    nv = chain.nv
    rest, units = np.zeros((nv, nv)), np.eye(nv)
    mass = mp2a.rnea(chain, np.tile(q, (nv, 1)), rest, units, gravity=np.zeros(3))
    assert relative_error(mass, mass.T) < EXACT
    assert np.linalg.eigvalsh(mass)[0] > 0
    torque, bias = (mp2a.rnea(chain, q, v, x, gravity=gravity) for x in (a, np.zeros(nv)))
    assert np.abs(torque - bias - mass @ a).max() < EXACT * (np.abs(mass).max() + np.abs(bias).max())
    assert np.isclose(v @ mass @ v / 2, kinetic_energy(chain, q, v), rtol=1e-11)


@given(case=moving())
def test_film_run_backwards_needs_the_same_torque(case):
    chain, (q, v, a), forces, gravity = case
    assert np.array_equal(mp2a.rnea(chain, q, -v, a, forces, gravity), mp2a.rnea(chain, q, v, a, forces, gravity))


@given(case=moving())
def test_nothing_weighs_nothing(case):
    chain, state, _, gravity = case
    empty = dataclasses.replace(chain, masses=0 * chain.masses, inertias=0 * chain.inertias)
    assert not mp2a.rnea(empty, *state, gravity=gravity).any()
