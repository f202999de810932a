"""Virtual joints: the exact solution, its energy, its limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mp2a import InputError
from mp2a.formation import Springs
from mp2a.formation.springs import Displacement, energy, give_way, none, solve

ratios = st.sampled_from([0.1, 0.5, 1.0, 1.0 + 1e-9, 1.5, 30.0])
positive = st.floats(0.01, 1000)
states = st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-500, 500))


def start(value, rate):
    return Displacement(np.full(3, value), np.full(3, rate), np.zeros(3))


def springs_of(mass, stiffness, ratio):
    return Springs(mass, stiffness, ratio, inertia=mass, turning_stiffness=stiffness)


@given(positive, positive, ratios, states)
def test_a_tick_is_the_solution_of_the_equation(mass, stiffness, ratio, state):
    """Against many small Runge-Kutta steps."""
    springs = springs_of(mass, stiffness, ratio)
    value, rate, force = state
    tick = min(0.1, 2 / (ratio * np.sqrt(stiffness / mass)))
    got = give_way(springs, solve(springs, tick), start(value, rate), np.full(3, force))
    damping, steps = springs.dampings[0], 400
    x, h = np.array([value, rate]), tick / steps

    def slope(x):
        return np.array([x[1], (force - damping * x[1] - stiffness * x[0]) / mass])

    for _ in range(steps):
        a = slope(x)
        b = slope(x + h / 2 * a)
        c = slope(x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + slope(x + h * c))
    scale = 1 + np.abs(x).max()
    assert np.allclose(got.value, x[0], atol=1e-8 * scale)
    assert np.allclose(got.rate, x[1], atol=1e-7 * scale * (1 + np.sqrt(stiffness / mass)))
    assert np.allclose(got.acceleration, slope(x)[1], atol=1e-6 * (1 + abs(slope(x)[1]) + stiffness / mass * scale))


@given(positive, positive, ratios, states, st.sampled_from([1e-4, 0.1, 1.0, 100.0, 1e6]))
def test_two_half_ticks_are_a_whole_one(mass, stiffness, ratio, state, tick):
    springs = springs_of(mass, stiffness, ratio)
    value, rate, force = state
    half = solve(springs, tick / 2)
    once = give_way(springs, half, start(value, rate), np.full(3, force))
    twice = give_way(springs, half, once, np.full(3, force))
    whole = give_way(springs, solve(springs, tick), start(value, rate), np.full(3, force))
    scale = 1 + abs(value) + abs(rate) * (1 + np.sqrt(mass / stiffness)) + abs(force / stiffness)
    assert np.allclose(twice.value, whole.value, atol=1e-7 * scale)
    assert np.isfinite(np.concatenate(whole)).all()


@given(positive, positive, ratios, states, st.sampled_from([1e-3, 0.1, 1.0, 1e3]))
def test_a_force_does_the_work_that_is_stored_and_dissipated(mass, stiffness, ratio, state, tick):
    """Work less the gain of energy is what the damper takes: never negative, and its integral."""
    springs = springs_of(mass, stiffness, ratio)
    value, rate, force = state
    before, force = start(value, rate), np.full(3, force)
    after = give_way(springs, solve(springs, tick), before, force)
    work = (force * (after.value - before.value)).sum()
    taken = work - (energy(springs, after) - energy(springs, before))
    scale = 1 + energy(springs, before) + energy(springs, after) + abs(work)
    assert taken > -1e-9 * scale
    short = 0.02 / (ratio * np.sqrt(stiffness / mass))
    if tick < 50 * short:
        at, weights = np.polynomial.legendre.leggauss(40)
        rates = [give_way(springs, solve(springs, tick * (x + 1) / 2), before, force).rate for x in at]
        integral = (springs.dampings * np.square(rates)).sum(1) @ weights * tick / 2
        assert abs(taken - integral) < 1e-6 * scale


@given(positive, positive, ratios, states)
def test_without_a_force_energy_never_rises_and_the_joint_comes_back(mass, stiffness, ratio, state):
    springs = springs_of(mass, stiffness, ratio)
    now = start(*state[:2])
    levels = []
    tick = 0.3 * np.sqrt(mass / stiffness)
    step = solve(springs, tick)
    for _ in range(400):
        levels.append(energy(springs, now))
        now = give_way(springs, step, now, np.zeros(3))
    assert (np.diff(levels) <= 1e-12 * (1 + levels[0])).all()
    assert levels[-1] <= 1e-2 * levels[0] + 1e-9 or ratio == 30.0
    if ratio == 1.0:  # critically damped: at most one passage through zero, from any state
        assert energy(springs, now) < 1e-12 * (1 + levels[0])


def test_critical_damping_does_not_overshoot():
    springs = Springs()
    step = solve(springs, 0.1)
    now, values = start(1.0, 0.0), []
    for _ in range(300):
        now = give_way(springs, step, now, np.zeros(3))
        values.append(now.value[0])
    assert (np.diff(values) < 0).all()
    assert values[-1] > 0


def test_a_constant_force_is_held_by_the_spring_and_a_stiff_turn_does_not_yield():
    springs = Springs(stiffness=50.0)
    step = solve(springs, 1e4)
    now = give_way(springs, step, none(2), np.array([[10.0, -20.0, 1e6], [0, 0, 0]]))
    assert np.allclose(now.value, [[0.2, -0.4, 0.0], [0, 0, 0]])
    assert np.isfinite(np.concatenate(now)).all()


@pytest.mark.parametrize("name", ["mass", "stiffness", "damping_ratio", "inertia", "turning_stiffness"])
def test_springs_are_positive(name):
    for value in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match=f"{name}: got"):
            Springs(**{name: value})
    if name != "turning_stiffness":
        with pytest.raises(InputError, match=f"{name}: got inf"):
            Springs(**{name: np.inf})
