"""Registers keep what a node knows, in buffers that go on the wire as they are."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mp2a.methods import METHODS
from mp2a.schedule import Round
from mp2a.transport.steps import Register, Registers

LAYOUT = {"window": Register({"matrix": 36, "vector": 6}, copies=2), "sum": Register({"sum": 6})}
nodes = st.integers(1, 5)
samples = st.integers(1, 4)


@given(nodes, samples)
def test_parts_share_the_buffer_that_is_sent(nodes, samples):
    registers = Registers(LAYOUT, nodes, samples)
    registers["matrix"][:], registers["vector"][:] = 1.0, 2.0
    assert registers.flat("window").shape == (nodes, 42 * samples)
    assert (registers.flat("window")[:, : 36 * samples] == 1.0).all()
    assert (registers.flat("window")[:, 36 * samples :] == 2.0).all()
    assert (registers.flat("vector") == 2.0).all()
    for part in ("matrix", "vector"):
        assert np.shares_memory(registers[part], registers.flat("window"))
    assert registers.size == 8 * nodes * samples * (2 * 42 + 6)


@given(nodes, samples, st.integers(0, 2**32 - 1))
def test_what_came_has_the_senders_parts(nodes, samples, seed):
    registers = Registers(LAYOUT, nodes, samples)
    sent = np.random.default_rng(seed).normal(size=registers.flat("window").shape)
    registers.flat("window")[:] = sent
    for name in ("window", "vector"):
        for part, data in registers.came(name, registers.flat(name)).items():
            assert np.array_equal(data, registers[part[1:]])
    assert set(registers.came("window", sent)) == {"<matrix", "<vector"}
    assert set(registers.came("vector", registers.flat("vector"))) == {"<vector"}


@given(copies=st.integers(2, 6))
def test_versions_are_kept_until_their_buffer_comes_round(copies):
    registers = Registers({"path": Register({"path": 1}, copies)}, 1, 1)
    for k in range(copies):
        registers["path"][:] = k
        registers.note(Round("out", k, ()))
        if k + 1 < copies:
            registers.next("path")[:] = -1.0
            registers.turn("path")
    for k in range(copies):
        assert registers.read("path@out", Round("back", k, ())) == k
    registers.turn("path")
    assert registers["path"] == 0.0
    registers.turn("path")
    registers.reset()
    assert registers["path"] == 0.0


def test_all_that_is_counted_of_a_method_is_what_its_registers_send():
    """The paper's sizes, and those of the derivation."""
    assert METHODS["kogge-stone"].doubles == {"matrix+vector": 42, "vector": 6}
    assert METHODS["compact"].doubles == {"motion": 24, "force": 6}
    assert METHODS["sweep"].doubles == {"motion": 24, "force": 28}
