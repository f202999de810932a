"""Laws of mechanics that hold whatever formula computes the torque."""

import dataclasses

import numpy as np
import pinocchio
from helpers import derivative, on_top_of, placements, random_forest, random_load, relative_error
from hypothesis import given, settings
from hypothesis import strategies as st

import mp2a
from mp2a import Model
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
    model = random_forest(draw(st.integers(1, 8)), seed, branching=draw(st.integers(1, 3)))
    return model, model.random_state(seed=seed), *random_load(model, seed=seed)


def along(model, q, v, a, quantity):
    """Time derivative of ``quantity(q, v)`` of a moving chain.

    The curve q(t) = q ⊕ (v t + a t²/2), v(t) = v + a t need only leave in the right direction: a derivative at t = 0
    depends on nothing else.
    """
    pin_model = model.to_pinocchio()
    return derivative(lambda t: quantity(pinocchio.integrate(pin_model, q, v * t + a * t**2 / 2), v + a * t), STEP)


def velocities(model, q, v):
    return mp2a.rnea(model, q, v, np.zeros(model.nv), bodies=True).velocity


def momenta(model, velocity):
    """Momentum ``[angular; linear]`` of each body about its origin, body frame."""
    w, v = velocity[:, :3], velocity[:, 3:]
    linear = model.masses[:, None] * (v + np.cross(w, model.coms))
    inertias = inertia_at_origin(model.masses, model.coms, model.inertias)
    angular = np.einsum("nij,nj->ni", inertias, w) + model.masses[:, None] * np.cross(model.coms, v)
    return np.concatenate((angular, linear), axis=1)


def kinetic_energy(model, q, v):
    velocity = velocities(model, q, v)
    return 0.5 * np.sum(momenta(model, velocity) * velocity)


def centres(model, q):
    rotations, origins = placements(model, q)
    return origins + np.einsum("nij,nj->ni", rotations, model.coms)


def potential_energy(model, q, gravity):
    return -model.masses @ centres(model, q) @ gravity


def in_base(model, q, forces):
    """Sum of body forces ``(n, 6)``, in the base frame about its origin."""
    return force_to_parent(*placements(model, q), forces).sum(axis=0)


@few
@given(case=moving())
def test_power_of_joints_and_loads_is_the_rate_of_energy(case):
    model, (q, v, a), forces, gravity = case
    torque = mp2a.rnea(model, q, v, a, forces, gravity)
    powers = torque @ v, np.sum(forces * velocities(model, q, v))
    rates = (
        along(model, q, v, a, lambda q, v: kinetic_energy(model, q, v)),
        along(model, q, v, a, lambda q, v: potential_energy(model, q, gravity)),
    )
    assert abs(sum(powers) - sum(rates)) < NUMERICAL * (1 + max(map(abs, (*powers, *rates))))


@few
@given(case=moving())
def test_base_force_and_loads_are_the_rate_of_momentum(case):
    model, (q, v, a), forces, gravity = case
    motion = mp2a.rnea(model, q, v, a, forces, gravity, bodies=True)
    from_base = np.where((model.parents < 0)[:, None], motion.force, 0.0)
    weight = model.masses[:, None] * gravity
    weights = np.concatenate((np.cross(centres(model, q), weight), weight), axis=1).sum(axis=0)
    total = in_base(model, q, from_base + forces) + weights
    rate = along(model, q, v, a, lambda q, v: in_base(model, q, momenta(model, velocities(model, q, v))))
    scale = 1 + max(np.abs(motion.force).max(), np.abs(weights).max(), np.abs(rate).max())
    assert np.abs(total - rate).max() < NUMERICAL * scale


@few
@given(case=moving())
def test_holding_still_takes_the_gradient_of_potential_energy(case):
    model, (q, _, _), _, gravity = case
    rest = np.zeros(model.nv)
    gradient = [
        along(model, q, direction, rest, lambda q, v: potential_energy(model, q, gravity))
        for direction in np.eye(model.nv)
    ]
    torque = mp2a.rnea(model, q, rest, rest, gravity=gravity)
    assert np.abs(torque - gradient).max() < NUMERICAL * (1 + np.abs(torque).max())


@given(case=moving())
def test_loads_superpose_and_do_work_on_the_joints(case):
    model, (q, v, a), forces, gravity = case
    other = np.roll(forces, 1, axis=1)
    none, first, second, both = (
        mp2a.rnea(model, q, v, a, load, gravity) for load in (None, forces, other, forces + 2 * other)
    )
    assert np.abs((both - none) - (first - none) - 2 * (second - none)).max() < EXACT * np.abs(both).max() * 10
    virtual_power = (first - none) @ v + np.sum(forces * velocities(model, q, v))
    assert abs(virtual_power) < EXACT * (1 + np.abs(none).max()) * (1 + np.abs(v).sum())


@given(case=moving())
def test_gravity_is_an_accelerated_base(case):
    model, (q, v, a), forces, gravity = case
    lift = Model.uniform(1, "free", mass=0.0)
    lifted = on_top_of(lift, model)
    state = np.append(lift.neutral, q), np.append(np.zeros(6), v), np.concatenate((-gravity, np.zeros(3), a))
    result = mp2a.rnea(lifted, *state, np.concatenate((np.zeros((1, 6)), forces)), np.zeros(3), bodies=True)
    expected = mp2a.rnea(model, q, v, a, forces, gravity, bodies=True)
    assert relative_error(result.torque[6:], expected.torque) < EXACT
    assert relative_error(result.acceleration[1:], expected.acceleration) < EXACT
    assert relative_error(result.force[1:], expected.force) < EXACT


@given(case=moving(), seed=st.integers(0, 2**32 - 1))
def test_torque_does_not_depend_on_the_base_frame(case, seed):
    model, state, forces, gravity = case
    turn = Model.random(1, seed).rotations[0]
    roots = (model.parents < 0)[:, None, None]
    turned = dataclasses.replace(
        model,
        rotations=np.where(roots, turn @ model.rotations, model.rotations),
        translations=np.where(roots[:, 0], model.translations @ turn.T + [1, 2, 3], model.translations),
    )
    expected = mp2a.rnea(model, *state, forces, gravity)
    assert relative_error(mp2a.rnea(turned, *state, forces, turn @ gravity), expected) < EXACT


@given(case=moving())
def test_mass_matrix_is_symmetric_and_positive(case):
    model, (q, v, a), _, gravity = case
    nv = model.nv
    rest, units = np.zeros((nv, nv)), np.eye(nv)
    mass = mp2a.rnea(model, np.tile(q, (nv, 1)), rest, units, gravity=np.zeros(3))
    assert relative_error(mass, mass.T) < EXACT
    assert np.linalg.eigvalsh(mass)[0] > 0
    torque, bias = (mp2a.rnea(model, q, v, x, gravity=gravity) for x in (a, np.zeros(nv)))
    assert np.abs(torque - bias - mass @ a).max() < EXACT * (np.abs(mass).max() + np.abs(bias).max())
    assert np.isclose(v @ mass @ v / 2, kinetic_energy(model, q, v), rtol=1e-11)


@given(case=moving())
def test_film_run_backwards_needs_the_same_torque(case):
    model, (q, v, a), forces, gravity = case
    assert np.array_equal(mp2a.rnea(model, q, -v, a, forces, gravity), mp2a.rnea(model, q, v, a, forces, gravity))


@given(case=moving())
def test_nothing_weighs_nothing(case):
    model, state, _, gravity = case
    empty = dataclasses.replace(model, masses=0 * model.masses, inertias=0 * model.inertias)
    assert not mp2a.rnea(empty, *state, gravity=gravity).any()
