"""The cost model is the paper's, and its true counts are those of the schedule."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mp2a import InputError, cost_model
from mp2a.algebra.affine import DOUBLES, MATRIX_AND_VECTOR, VECTOR
from mp2a.schedule import kogge_stone, pipeline

NETWORK = cost_model.Network(serial_time=6.4, latency=1e-6, speed=1e9, bits=64)


@given(st.integers(1, 600))
def test_true_counts_are_the_schedules(n):
    count, counted = cost_model.true_messages(n), kogge_stone(n).count(DOUBLES)
    assert counted.messages.get(VECTOR, 0) == 3 * count.vectors == 3 * (n - 1)
    assert counted.messages.get(MATRIX_AND_VECTOR, 0) == 3 * count.matrices
    # The last term of eq. 12 has no message of its own.
    assert cost_model.numbers_sent(n, count) - 6 * (n - 1) == counted.doubles


def test_the_papers_figures():
    assert cost_model.true_messages(8) == (7, 10)
    assert cost_model.true_messages(8).total == 17
    assert cost_model.table_one_messages(8) == (4, 3)
    assert cost_model.table_one_messages(512) == (256, 255)
    assert float(cost_model.amdahl(512, 0.99)) == pytest.approx(83, abs=1)
    assert float(cost_model.karp_flatt(42.1, 512)) == pytest.approx(0.978, abs=1e-3)


@given(st.integers(1, 600))
def test_table_one_as_printed(n):
    rounds = cost_model.rounds_needed(n)
    matrices = sum(2 ** (i - 1) for i in range(1, rounds))
    vectors = 2 ** (rounds - 1) - (2**rounds - n) if rounds else 0
    assert cost_model.table_one_messages(n) == (vectors, matrices)


@given(st.integers(2, 600), st.integers(1, 5000))
def test_equation_13_is_linear_in_samples_and_falls_with_the_network(n, samples):
    messages = cost_model.true_messages(n)
    once, twice = (cost_model.total_time(n, k * samples, messages, NETWORK) for k in (1, 2))
    start = cost_model.rounds_needed(n) * NETWORK.serial_time / n
    assert twice - start == pytest.approx(2 * (once - start))
    free = cost_model.total_time(n, samples, messages, NETWORK._replace(latency=0.0, speed=float("inf")))
    assert free == pytest.approx(start)
    slow = cost_model.total_time(n, samples, messages, NETWORK._replace(latency=1.0, speed=float("inf")))
    assert slow - start == pytest.approx(3 * samples * messages.total)


def test_equation_11():
    messages = cost_model.table_one_messages(8)
    expected = 3 * 6.4 / 8 + 1e-6 + 64 * cost_model.numbers_sent(8, messages) / 1e9
    assert cost_model.parallel_time(8, messages, NETWORK) == pytest.approx(expected)


@given(st.integers(2, 100))
def test_pipeline_time_is_hops(n):
    hops = len(pipeline(n).rounds)
    free = NETWORK._replace(speed=float("inf"))
    assert cost_model.pipeline_time(n, 1, free) == pytest.approx(hops * NETWORK.latency)


def test_amdahl_at_its_ends():
    assert float(cost_model.amdahl(64, 1.0)) == 64
    assert float(cost_model.amdahl(64, 0.0)) == 1
    assert float(cost_model.amdahl(1, 0.5)) == 1


@pytest.mark.parametrize(("speedup", "n"), [(2.0, 1), (0.0, 8), (-1.0, 8)])
def test_karp_and_flatt_need_a_speedup_on_several(speedup, n):
    with pytest.raises(InputError, match="more than one processor"):
        cost_model.karp_flatt(speedup, n)
