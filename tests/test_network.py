"""Networks are read as they are written."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mp2a import EmulatedNetwork, InputError
from mp2a.methods.auto import choose
from mp2a.network import parse


@pytest.mark.parametrize(
    ("text", "latency", "bandwidth"),
    [("5ms,54Mbit", 5e-3, 54e6), ("1us, 100Gbit/s", 1e-6, 1e11), ("0.5s,1kbit", 0.5, 1e3), ("0ms,1bit", 0.0, 1.0)],
)
def test_units(text, latency, bandwidth):
    assert parse(text) == pytest.approx((latency, bandwidth))


@given(st.floats(0, 10, allow_subnormal=False), st.floats(1, 1e12))
def test_what_the_launcher_spells_is_read_back(latency, bandwidth):
    assert parse(f"{latency!r}s,{bandwidth!r}bit") == (latency, bandwidth)


@pytest.mark.parametrize("text", ["", "fast", "5ms", "5,54", "5ms,54", "-5ms,54Mbit", "5ms,0Mbit", "5 furlongs,1bit"])
def test_anything_else_is_refused(text):
    with pytest.raises(InputError, match="expected latency and bandwidth"):
        parse(text)


@given(st.integers(0, 10**6))
def test_a_message_takes_latency_and_its_bits(doubles):
    network = EmulatedNetwork(0.01, 1e6)
    assert network.seconds(doubles) == pytest.approx(0.01 + 64e-6 * doubles)


@given(st.integers(3, 300), st.integers(1, 2000))
def test_auto_takes_fewest_rounds_where_latency_rules_and_the_least_time_anywhere(n, samples):
    assert choose(n, samples, latency=10.0, bandwidth=1e12).method == "sweep"
    choice = choose(n, samples, latency=1e-3, bandwidth=1e8)
    assert choice.seconds[choice.method] == min(choice.seconds.values())
    assert choice.method in str(choice)
