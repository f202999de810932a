"""Schedules bring every robot all it needs, in the rounds and messages the formulas say."""

import math

import numpy as np
import pytest
from helpers import ALL_JOINTS, random_load
from hypothesis import given
from hypothesis import strategies as st

from mp2a import InputError, Model
from mp2a.algebra.affine import DOUBLES, MATRIX_AND_VECTOR, VECTOR
from mp2a.bench.simulated import SCHEDULES
from mp2a.methods import METHODS, block
from mp2a.methods.cost import cost
from mp2a.methods.local import solve_locally
from mp2a.schedule import (
    FORCE,
    MOTION,
    SHIFT,
    TAIL,
    broadcast,
    compact,
    kogge_stone,
    motion,
    parent_to_child,
    pipeline,
    rounds_needed,
    shifted,
    sweep,
)
from mp2a.validation import check_state

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
    for schedule in (kogge_stone(n), pipeline(n)):
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
    for schedule in (kogge_stone(n), pipeline(n)):
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
def test_the_pipeline_passes_through_every_robot_and_back(n):
    schedule = pipeline(n)
    hops = [(int(s[0]), int(t[0])) for round_ in schedule.rounds for _, s, t in round_.transfers]
    assert hops == [(i, i + 1) for i in range(n - 1)] + [(i + 1, i) for i in reversed(range(n - 1))]
    count = schedule.count({"motion": 12, "force": 6})
    assert (count.rounds, count.total, count.doubles) == (2 * (n - 1), 2 * (n - 1), 18 * (n - 1))


@pytest.mark.parametrize("name", METHODS)
@given(n=st.integers(1, 40), samples=st.integers(1, 4), branching=st.integers(1, 3))
def test_local_transport_carries_what_the_schedule_and_the_cost_model_count(name, n, samples, branching):
    model = Model.random(n, joints=ALL_JOINTS, branching=1 if name == "kogge-stone" else branching)
    forces, gravity = random_load(model, samples)
    method = METHODS[name]
    state = check_state(model, *model.random_state(samples), forces)
    schedule = method.schedule(model.parents)
    _, transport = solve_locally(method, model, state, gravity)
    count = schedule.count(method.doubles)
    assert (transport.messages, transport.doubles) == (count.total, samples * count.doubles)
    modelled = cost(name, model.parents, samples, latency=0.01, bandwidth=1e9)
    assert modelled[:3] == (len(schedule.rounds), transport.messages, 8 * transport.doubles)
    assert modelled.seconds >= 0.01 * modelled.rounds


def parents_of(n, seed, branching):
    return Model.random(n, seed, branching=branching).parents


def depth(parents):
    levels = np.zeros(len(parents), dtype=int)
    for i, parent in enumerate(parents):
        levels[i] = 1 + (levels[parent] if parent >= 0 else 0)
    return int(levels.max())


@given(n=st.integers(1, 60), seed=st.integers(0, 999), branching=st.integers(1, 8))
def test_doubling_over_parents_brings_everybody_all_above_and_all_below(n, seed, branching):
    """Data flow on trees: paths grow to the base, loads to the whole subtree, nobody is counted twice."""
    parents = parents_of(n, seed, branching)
    above = [{i} for i in range(n)]
    below = [[i] for i in range(n)]
    up = parents.copy()
    schedule = sweep(parents)
    assert len(schedule.rounds) == math.ceil(math.log2(depth(parents)))
    for round_ in schedule.rounds:
        (_, source, target), (_, child, ancestor) = round_.transfers
        assert (source == up[target]).all()
        assert (ancestor == up[child]).all()
        paths_before, loads_before = [set(x) for x in above], [list(x) for x in below]
        for s, t in zip(source, target, strict=True):
            above[t] |= paths_before[s]
        for c, a in zip(child, ancestor, strict=True):
            below[a] += loads_before[c]
        up = np.where(up >= 0, up[up], -1)
    for i in range(n):
        line = {i}
        while parents[i] >= 0 and min(line) != -1:
            top = parents[min(line)]
            if top < 0:
                break
            line.add(int(top))
        assert above[i] == line
    for i in range(n):
        assert sorted(below[i]) == [j for j in range(n) if i in above[j]]


@given(n=st.integers(1, 60), seed=st.integers(0, 999), branching=st.integers(1, 4))
def test_compact_is_the_sweep_one_direction_after_the_other(n, seed, branching):
    parents = parents_of(n, seed, branching)
    one, two = sweep(parents), compact(parents)
    assert len(two.rounds) == 2 * len(one.rounds)
    for k, round_ in enumerate(one.rounds):
        out, back = round_.transfers
        assert (out.kind, back.kind) == (MOTION, FORCE)
        for mine, theirs in ((out, two.recurrence("motion")[k]), (back, two.recurrence("force")[k])):
            assert all(np.array_equal(a, b) for a, b in zip(mine, theirs.transfers[0], strict=True))


def test_counts_at_512():
    """Numbers of one rank at most, and rounds: design figures of the three methods."""
    most = {"kogge-stone": (27, 3 * 9 * 42), "compact": (18, 9 * (24 + 6)), "sweep": (9, 9 * (24 + 28))}
    for name, (rounds, doubles) in most.items():
        schedule = METHODS[name].schedule(512)
        sent = np.zeros(512, dtype=int)
        for round_ in schedule.rounds:
            for kind, source, _ in round_.transfers:
                np.add.at(sent, source, METHODS[name].doubles[kind])
        assert len(schedule.rounds) == rounds
        assert sent.max() <= doubles


def ranks_that_know(schedule, samples, broken):
    """Which ranks have noticed by the end that one is broken, or that their numbers of samples differ."""
    sound = ~broken
    for round_ in schedule.rounds:
        before = sound.copy()
        for _, source, target in round_.transfers:
            misfit = ~before[source] | (samples[source] != samples[target])
            np.logical_and.at(sound, target, ~misfit)
    return ~sound


@pytest.mark.parametrize("name", METHODS)
@given(n=st.integers(2, 40), data=st.data())
def test_along_a_chain_every_rank_learns_of_a_wrong_one(name, n, data):
    """What the MPI transport relies on when it sends no extra message to agree that all is well."""
    schedule = METHODS[name].schedule(n)
    broken = np.zeros(n, dtype=bool)
    broken[data.draw(st.integers(0, n - 1))] = True
    assert ranks_that_know(schedule, np.ones(n), broken).all()
    samples = np.array(data.draw(st.lists(st.integers(1, 3), min_size=n, max_size=n)))
    differ = len(set(samples)) > 1
    assert ranks_that_know(schedule, samples, np.zeros(n, dtype=bool)).all() == differ
    assert ranks_that_know(shifted(schedule), np.ones(n), broken).all()
    assert ranks_that_know(shifted(schedule), samples, np.zeros(n, dtype=bool)).all() == differ


@pytest.mark.parametrize("name", METHODS)
@given(n=st.integers(1, 70))
def test_blocks_need_one_round_and_a_path_a_rank_more(name, n):
    schedule, doubles = METHODS[name].schedule(n), METHODS[name].doubles | block.DOUBLES
    without, count = schedule.count(doubles), shifted(schedule).count(doubles)
    assert count.rounds == without.rounds + (n > 1)
    assert count.total == without.total + n - 1
    assert count.messages.get(TAIL, 0) == n - 1
    assert count.doubles == without.doubles + 24 * (n - 1)
    for round_ in shifted(schedule).recurrence(SHIFT):
        ((_, source, target),) = round_.transfers
        assert sorted(target) == list(range(1, n))
        assert (source == target - 1).all()
    assert shifted(schedule).rounds[min(n - 1, 1) :] == schedule.rounds


@pytest.mark.parametrize("name", SCHEDULES)
def test_no_robots_no_schedule(name):
    for n in (0, -3):
        with pytest.raises(InputError, match=f"n: got {n}, expected a whole number of at least 1"):
            SCHEDULES[name](n)
    assert SCHEDULES[name](1).rounds == ()


@pytest.mark.parametrize("parents", [[-1], [-1, 0, 1, 2, 3], [-1, 0, 0, 1, -1, 4]])
def test_one_way_schedules(parents):
    parents = np.array(parents)
    ahead = np.flatnonzero(parents >= 0)
    (round_,) = parent_to_child(parents).rounds
    ((kind, source, target),) = round_.transfers
    assert kind == MOTION
    assert (target == ahead).all() and (source == parents[ahead]).all()
    assert str(motion(parents)) == "\n".join(
        line for line in str(compact(parents)).splitlines() if line.startswith("motion")
    )


@given(n=st.integers(1, 60), seed=st.integers(0, 999), branching=st.integers(1, 8))
def test_a_broadcast_tells_everybody_once(n, seed, branching):
    """In as many rounds as a sweep has; who tells has been told in a round before, or hangs on the base."""
    parents = parents_of(n, seed, branching)
    told = parents < 0
    schedule = broadcast(parents)
    assert len(schedule.rounds) == math.ceil(math.log2(depth(parents)))
    for round_ in schedule.rounds:
        before = told.copy()
        for _, source, target in round_.transfers:
            assert before[source].all()
            assert not before[target].any()
            assert len(set(target)) == len(target)
            told[target] = True
    assert told.all()
    assert schedule.count({MOTION: 1}).total == (parents >= 0).sum()
