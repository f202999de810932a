"""What is said about a benchmark follows from its numbers."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mp2a.bench.contenders import BASELINES, FAMILIES, LABELS, MPI_SCAN, ONE_PROCESS, PINOCCHIO, PIPELINE, family
from mp2a.bench.findings import findings
from mp2a.bench.report import comparison
from mp2a.bench.scaling import scaling_table, scalings
from mp2a.bench.settings import BenchSettings
from mp2a.exceptions import InputError
from mp2a.methods import METHODS
from mp2a.tables import show_ratio, show_seconds


def times(names):
    """Times of contenders, no two alike."""
    some = st.lists(st.floats(1e-6, 1.0), min_size=len(names), max_size=len(names), unique=True)
    return some.map(lambda seconds: dict(zip(names, seconds, strict=True)))


def make_run(n, walls, emulated=None, cores=2):
    cells = {
        name: {size: {"wall": wall, "walls": [wall]} for size in ("single", "batch")} for name, wall in walls.items()
    }
    return {
        "n": n,
        "samples": 2000,
        "measured": cells,
        "methods": {name: {"rounds": n} for name in METHODS},
        "oversubscribed": n > cores,
        "cores": cores,
        "emulated": emulated,
    }


@given(times(LABELS))
def test_our_fastest_is_compared_with_the_fastest_of_each_kind(walls):
    contest, alone, machine = findings([make_run(2, walls), make_run(8, walls)])
    best = min(METHODS, key=walls.get)
    assert f"{best}, our fastest method, takes {show_seconds(walls[best])}" in contest
    for kind in (MPI_SCAN, PIPELINE, "gather-scatter"):
        rival = min((name for name in BASELINES if family(name) == kind), key=walls.get)
        assert f"{show_ratio(walls[best] / walls[rival])} that of {rival}" in contest
    assert f"{show_ratio(walls[PINOCCHIO] / walls[ONE_PROCESS])} as long" in alone
    assert "With n = 8 ranks take turns on 2 cores" in machine


@given(st.tuples(*[times((*METHODS, PIPELINE))] * 2))
def test_over_a_network_growth_is_what_counts(walls):
    _, growth, machine = findings([make_run(n, w, [5e-3, 54e6]) for n, w in zip((8, 16), walls, strict=True)])
    best = min(METHODS, key=walls[1].get)
    assert f"{best} goes from 8 to 16 rounds and takes {show_ratio(walls[1][best] / walls[0][best])} as long" in growth
    assert f"from 14 to 30 hops and takes {show_ratio(walls[1][PIPELINE] / walls[0][PIPELINE])} as long" in growth
    assert "emulated" in machine


def test_a_core_a_rank_is_said_and_who_is_missing_is_not_compared():
    said = findings([make_run(2, {"sweep": 1.0})])
    assert said[0] == "One sample at a time on 2 ranks, sweep, our fastest method, takes 1 s."
    assert "a core of its own" in said[-1]


@given(st.integers(1, 4), st.lists(st.integers(1, 64), min_size=1, max_size=5, unique=True))
def test_efficiency_is_one_where_every_rank_is_worth_as_much(bodies, counts):
    for kind, time in (("bodies", lambda n: 1 / n), ("bodies_per_rank", lambda n: 1.0)):
        runs = [make_run(n, {"sweep": time(n), ONE_PROCESS: 1.0}) | {kind: bodies} for n in counts]
        [scaling] = scalings([*runs, make_run(3, {"sweep": 9.0})])  # formations of one body a rank are no part of it
        assert scaling.weak == (kind == "bodies_per_rank")
        assert scaling.efficiency("sweep") == pytest.approx(dict.fromkeys(counts, 1.0))
        assert scaling.efficiency("compact") == {}
        table = scaling_table(scaling)
        assert [row[1] for row in table.rows] == sorted(counts)
        assert [row[4] for row in table.rows] == pytest.approx([1 / time(n) for n in sorted(counts)])


def test_time_lost_is_efficiency_lost():
    runs = [make_run(n, {"sweep": 1.0}) | {"bodies": 100} for n in (1, 2, 4)]
    assert scalings(runs)[0].efficiency("sweep") == pytest.approx({1: 1.0, 2: 0.5, 4: 0.25})


def test_chains_cut_in_other_ways_are_not_compared():
    cuts = [{}, {"bodies": 8}, {"bodies": 9}, {"bodies_per_rank": 8}]
    runs = [make_run(2, {"sweep": 1.0}) | {"seed": 0} | cut for cut in cuts]
    for a, b in itertools.combinations(runs, 2):
        with pytest.raises(InputError, match="without a run of the same n and settings"):
            comparison([a], [b])


def test_every_baseline_has_a_kind_and_every_method_a_label():
    assert set(FAMILIES) == {family(name) for name in BASELINES}
    assert set(LABELS) == {*METHODS, *BASELINES}
    assert BenchSettings().methods == tuple(METHODS)


@pytest.mark.parametrize(
    "settings, ranks, length", [({}, 8, 8), ({"bodies": 100}, 8, 100), ({"bodies_per_rank": 5}, 8, 40)]
)
def test_length_of_the_chain(settings, ranks, length):
    assert BenchSettings(**settings).chain_length(ranks) == length


def test_what_makes_runs_different_is_in_their_identity():
    changes = [{}, {"samples": 3}, {"seed": 1}, {"baselines": ("pipeline",)}, {"bodies": 9}, {"bodies_per_rank": 9}]
    for a, b in itertools.combinations([BenchSettings(**change).identity() for change in changes], 2):
        assert a != b
