"""Schedules bring every robot all it needs, in the rounds and messages the formulas say."""

import math

import numpy as np
import pytest
from helpers import ALL_JOINTS, random_load
from hypothesis import given
from hypothesis import strategies as st

from mp2a import Chain, InputError
from mp2a.leaf import check_state
from mp2a.methods import METHODS
from mp2a.schedule import SCHEDULES, kogge_stone, relay, rounds_needed
from mp2a.segments.affine import DOUBLES, MATRIX_AND_VECTOR, VECTOR
from mp2a.transport.local import LocalTransport

RECURRENCES = ("velocity", "acceleration", "force")
every_size = pytest.mark.parametrize("n", [*range(1, 71), 512, 1000])


def by_kind(round_):
    """Number of messages of each kind."""
    counts = {MATRIX_AND_VECTOR: 0, VECTOR: 0}
    for kind, source, _ in round_.transfers:
        counts[kind] += len(source)
    return counts


@every_size
def test_rounds_and_messages_are_as_the_formulas_say(n):
    schedule = kogge_stone(n)
    assert len(schedule.rounds) == 3 * math.ceil(math.log2(n))
    assert [round_.recurrence for round_ in schedule.rounds] == [
        name for name in RECURRENCES for _ in range(rounds_needed(n))
    ]
    for name in RECURRENCES:
        rounds = schedule.recurrence(name)
        assert [round_.index for round_ in rounds] == list(range(1, rounds_needed(n) + 1))
        for e, round_ in enumerate(rounds, start=1):
            half = 2 ** (e - 1)
            assert by_kind(round_) == {MATRIX_AND_VECTOR: max(0, n - 2 * half), VECTOR: min(half, n - half)}
        assert sum(by_kind(round_)[VECTOR] for round_ in rounds) == n - 1


def test_eight_robots_send_17_messages_a_recurrence():
    """The figure of the paper's own example."""
    count = kogge_stone(8).count(DOUBLES)
    assert count.messages == {MATRIX_AND_VECTOR: 30, VECTOR: 21}
    assert count == (9, count.messages, 30 * 42 + 21 * 6)
    assert count.total == 3 * 17


@every_size
def test_a_round_is_one_message_between_two_robots(n):
    for schedule in (kogge_stone(n), relay(n)):
        for round_ in schedule.rounds:
            sources = np.concatenate([source for _, source, _ in round_.transfers])
            targets = np.concatenate([target for _, _, target in round_.transfers])
            for nodes in (sources, targets):
                assert nodes.min() >= 0
                assert nodes.max() < n
                assert len(set(nodes)) == len(nodes)
            assert (sources != targets).all()


@every_size
def test_windows_grow_over_the_whole_chain(n):
    """Data flow: a window is the set of bodies in it, and holds neighbours, so that composing it makes sense."""
    schedule = kogge_stone(n)
    for name, end in (("velocity", 0), ("acceleration", 0), ("force", n - 1)):
        windows = [(i, i) for i in range(n)]
        for round_ in schedule.recurrence(name):
            before = list(windows)
            for kind, source, target in round_.transfers:
                for s, t in zip(source.tolist(), target.tolist(), strict=True):
                    (s_first, s_last), (t_first, t_last) = before[s], before[t]
                    assert (end in before[s]) == (kind == VECTOR)
                    assert s_last + 1 == t_first if end == 0 else t_last + 1 == s_first
                    windows[t] = (min(s_first, t_first), max(s_last, t_last))
        assert windows == [(0, i) if end == 0 else (i, n - 1) for i in range(n)]


@every_size
def test_forces_mirror_velocities(n):
    schedule = kogge_stone(n)

    def arrows(name):
        return [
            {
                (kind, s, t)
                for kind, *ends in round_.transfers
                for s, t in zip(*map(np.ndarray.tolist, ends), strict=True)
            }
            for round_ in schedule.recurrence(name)
        ]

    mirrored = [{(kind, n - 1 - s, n - 1 - t) for kind, s, t in arrows_} for arrows_ in arrows("force")]
    assert mirrored == arrows("velocity") == arrows("acceleration")


@every_size
def test_printed_schedule_lists_every_message_once(n):
    for schedule in (kogge_stone(n), relay(n)):
        printed = []
        for line in str(schedule).splitlines():
            recurrence, _, index, kind, *pairs = line.split()
            printed += [(recurrence, int(index), kind, *map(int, pair.split("→"))) for pair in pairs]
        messages = [
            (round_.recurrence, round_.index, kind, s + 1, t + 1)
            for round_ in schedule.rounds
            for kind, source, target in round_.transfers
            for s, t in zip(source, target, strict=True)
        ]
        assert printed == messages
        assert len(set(messages)) == len(messages)


@every_size
def test_relay_passes_through_every_robot_and_back(n):
    schedule = relay(n)
    hops = [(int(s[0]), int(t[0])) for round_ in schedule.rounds for _, s, t in round_.transfers]
    assert hops == [(i, i + 1) for i in range(n - 1)] + [(i + 1, i) for i in reversed(range(n - 1))]
    count = schedule.count({"motion": 12, "force": 6})
    assert (count.rounds, count.total, count.doubles) == (2 * (n - 1), 2 * (n - 1), 18 * (n - 1))


@given(n=st.integers(1, 40), samples=st.integers(1, 4))
def test_local_transport_carries_what_the_schedule_counts(n, samples):
    chain = Chain.random(n, joints=ALL_JOINTS)
    forces, gravity = random_load(chain, samples)
    method, transport = METHODS["kogge-stone"], LocalTransport(n)
    state = check_state(chain, *chain.random_state(samples), forces)
    schedule = method.schedule(n)
    method.solve(chain, state, gravity, schedule, transport)
    count = schedule.count(DOUBLES)
    assert (transport.messages, transport.doubles) == (count.total, samples * count.doubles)


@pytest.mark.parametrize("name", SCHEDULES)
def test_no_robots_no_schedule(name):
    for n in (0, -3):
        with pytest.raises(InputError, match=f"n: got {n}, expected at least 1"):
            SCHEDULES[name](n)
    assert SCHEDULES[name](1).rounds == ()
