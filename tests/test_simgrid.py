"""Replays say what the schedules say, networks are what their figures say, and simulated times obey the laws."""

import copy
import json
import shutil
import xml.etree.ElementTree as ET
from collections import Counter

import numpy as np
import pytest
from numpy.testing import assert_allclose

from mp2a.bench import costs, simulated
from mp2a.bench.costs import ComputeCosts
from mp2a.bench.simgrid import (
    NETWORKS,
    SPEED,
    ComputePhase,
    Flow,
    MessagePhase,
    SimulatedNetwork,
    gather_scatter_program,
    platform,
    replay,
    schedule_program,
    simulate,
)
from mp2a.exceptions import DependencyError, InputError
from mp2a.plot import save_figure, simulated_figure
from mp2a.schedule import rounds_needed

METHODS = ("pipeline", "kogge-stone", "compact", "sweep")
RECURRENCES = ("velocity", "acceleration", "motion", "force", "sweep")
ENVELOPE = 16  # bytes SMPI adds to every message, as an MPI would
needs_simgrid = pytest.mark.skipif(shutil.which("smpirun") is None, reason="smpirun of SimGrid is not installed")


def doubles(name):
    """Numbers a sample by kind of message."""
    return simulated.METHODS[name].doubles if name in simulated.METHODS else simulated.PIPELINE_DOUBLES


def alike(seconds):
    """ComputeCosts that are the same everywhere."""
    return ComputeCosts(dict.fromkeys(RECURRENCES, seconds), dict.fromkeys(RECURRENCES, seconds), seconds)


def every_cost(seconds):
    """What `simulated.run_simulations` takes instead of measuring."""
    return {**{name: alike(seconds)._asdict() for name in METHODS}, "gather-scatter": seconds}


def actions(n, program):
    """Actions of each rank, in order."""
    out = [[] for _ in range(n)]
    for line in "".join(replay(n, program)).splitlines():
        rank, *action = line.split()
        out[int(rank)].append(action)
    return out


def follower(name, n, samples=1, seconds=0.0):
    """Program of a schedule."""
    return list(schedule_program(simulated.SCHEDULES[name](n), doubles(name), samples, alike(seconds)))


def array(*ranks):
    return np.array(ranks, dtype=np.intp)


# ---- text ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("n", [2, 3, 8, 13])
def test_each_message_of_the_schedule_is_sent_received_and_waited_for_once(name, n):
    samples = 5
    ranks = actions(n, follower(name, n, samples))
    sent = Counter(
        (s, int(to), tag, size) for s, acts in enumerate(ranks) for w, to, tag, size, _ in found(acts, "isend")
    )
    received = Counter(
        (int(of), t, tag, size) for t, acts in enumerate(ranks) for w, of, tag, size, _ in found(acts, "irecv")
    )
    count = simulated.SCHEDULES[name](n).count(doubles(name))
    assert sent == received
    assert set(sent.values()) == {1}
    assert sent.total() == count.total
    assert sum(int(size) for *_, size in sent) == 8 * samples * count.doubles
    ends = Counter((int(s), int(t), tag) for acts in ranks for _, s, t, tag in found(acts, "wait"))
    assert ends == Counter({(s, t, tag): 2 for s, t, tag, _ in sent})


def found(acts, what):
    """Actions of one kind."""
    return [action for action in acts if action[0] == what]


@pytest.mark.parametrize("name", METHODS)
def test_a_rank_goes_on_when_all_has_come_and_waits_for_what_it_sent_a_round_later(name):
    for rank, acts in enumerate(actions(9, follower(name, 9, seconds=1e-6))):
        assert acts[0] == ["init"]
        assert acts[-1] == ["finalize"]
        coming, going = set(), set()
        for what, *rest in acts[1:-1]:
            if what == "compute":
                assert not coming
            elif what in ("irecv", "isend"):
                peer, tag = int(rest[0]), rest[1]
                coming |= {(peer, rank, tag)} if what == "irecv" else set()
                going |= {(rank, peer, tag)} if what == "isend" else set()
            elif int(rest[0]) == rank:
                going.remove((rank, int(rest[1]), rest[2]))
            else:
                coming.remove((int(rest[0]), int(rest[1]), rest[2]))
        assert not coming
        assert not going


def test_computing_is_told_in_flops_and_none_is_left_out():
    [acts] = actions(1, [ComputePhase(array(0), 2e-6), ComputePhase(array(0), 0.0), ComputePhase(array(0), 1.5)])
    assert acts == [["init"], ["compute", "2000"], ["compute", "1.5e+09"], ["finalize"]]
    assert SPEED == 1e9


@pytest.mark.parametrize("name", METHODS)
def test_a_recurrence_has_a_start_and_a_cost_between_its_rounds(name):
    n = 16
    times = ComputeCosts(dict.fromkeys(RECURRENCES, 1.0), dict.fromkeys(RECURRENCES, 1e-3), 1e-6)
    schedule = simulated.SCHEDULES[name](n)
    for rank, acts in enumerate(actions(n, schedule_program(schedule, doubles(name), 1, times))):
        flops = Counter(float(flops) for _, flops in found(acts, "compute"))
        recurrences = {r.recurrence for r in schedule.rounds}
        assert flops[1e9] == len(recurrences)
        assert flops[1e3] == 1
        arrivals = sum(any(rank in t for _, _, t in r.transfers) for r in schedule.rounds)
        assert arrivals - len(recurrences) <= flops[1e6] <= arrivals


def test_rank_0_gathers_computes_and_scatters():
    n = 6
    ranks = actions(n, gather_scatter_program(n, (3, 1), 10, 2e-6))
    assert [a[0] for a in ranks[0] if a[0] != "wait"] == [
        *(["init"] + ["irecv"] * (n - 1) + ["compute"]),
        *(["isend"] * (n - 1) + ["finalize"]),
    ]
    assert found(ranks[0], "compute") == [["compute", "12000"]]
    for acts in ranks[1:]:
        assert [(a[0], a[1], a[3]) for a in acts if a[0] in ("isend", "irecv")] == [
            ("isend", "0", "240"),
            ("irecv", "0", "80"),
        ]


# ---- platform ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NETWORKS)
def test_a_platform_is_xml_with_the_networks_figures(name):
    network = NETWORKS[name]
    [cluster] = ET.fromstring(platform(network, 512).split("\n", 2)[2])
    assert cluster.tag == "cluster"
    assert cluster.get("radical") == "0-511"
    latency = 2 * float(cluster.get("lat")[:-1]) + float(cluster.get("bb_lat", "0s")[:-1])
    speed = float((cluster.get("bb_bw") or cluster.get("bw"))[:-3]) * 8
    assert_allclose((latency, speed), (network.latency, network.speed))


def test_an_unknown_way_of_sharing_is_refused():
    with pytest.raises(InputError, match="sharing: got 'token ring', expected 'duplex'"):
        platform(SimulatedNetwork("", 1.0, 1.0, "token ring"), 2)


# ---- what is missing ------------------------------------------------------------------------------------------------


def test_without_smpirun_the_error_says_how_to_get_it(monkeypatch, tmp_path):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(DependencyError, match="apt-get install libsimgrid-dev"):
        simulate(NETWORKS["ethernet"], 2, [])
    with pytest.raises(DependencyError, match="apt-get install libsimgrid-dev"):
        simulated.run_simulations(tmp_path / "out.json", [2], [1])
    assert not list(tmp_path.iterdir())


def test_more_ranks_than_memory_holds_are_refused(monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: "smpirun")
    monkeypatch.setattr("mp2a.bench.simgrid.available_memory", lambda: 10**6)
    with pytest.raises(DependencyError, match=r"1000 ranks takes 0\.1 GB and 0\.0 GB are free"):
        simulate(NETWORKS["ethernet"], 1000, [])


# ---- costs ---------------------------------------------------------------------------------------------------------


def test_costs_are_measured_for_what_the_schedules_name(monkeypatch):
    monkeypatch.setattr(costs, "_BUDGET", 0.0)
    for name, seconds in simulated.measure_costs(3).items():
        if name == "gather-scatter":
            assert 0 < seconds < 1
            continue
        recurrences = {r.recurrence for r in simulated.SCHEDULES[name](8).rounds}
        assert seconds["start"].keys() == seconds["between"].keys() == recurrences
        assert all(0 <= s < 1 for s in (*seconds["start"].values(), *seconds["between"].values(), seconds["end"]))


# ---- simulation ----------------------------------------------------------------------------------------------------


@needs_simgrid
@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize("size", [8, 336, 672_000, 10**8])
def test_ping_pong_takes_the_latency_and_bandwidth_asked_for(name, size):
    network = NETWORKS[name]
    there, back = Flow(array(0), array(1), size), Flow(array(1), array(0), size)
    expected = 2 * (network.latency + 8 * (size + ENVELOPE) / network.speed)
    time = simulate(network, 2, [MessagePhase((there,)), MessagePhase((back,))])
    assert_allclose(time, expected, rtol=1e-3, atol=4e-9)  # SimGrid counts whole nanoseconds


@needs_simgrid
@pytest.mark.parametrize("n", [2, 8, 13, 32])
def test_time_is_rounds_times_latency_where_nothing_else_takes_time(n):
    network = SimulatedNetwork("", 1e-3, 1e12, "duplex")
    doublings = {"kogge-stone": 3, "compact": 2, "sweep": 1}
    for name, recurrences in doublings.items():
        time = simulate(network, n, follower(name, n))
        assert_allclose(time, recurrences * rounds_needed(n) * network.latency, rtol=1e-3)
    assert_allclose(simulate(network, n, follower("pipeline", n)), 2 * (n - 1) * network.latency, rtol=1e-3)
    assert_allclose(simulate(network, n, gather_scatter_program(n, (3, 1), 1, 0.0)), 2 * network.latency, rtol=1e-3)


@needs_simgrid
def test_computing_adds_up_along_the_longest_path():
    n, c = 16, 0.25
    network = SimulatedNetwork("", 1e-6, 1e12, "duplex")
    rounds = rounds_needed(n)
    for name, recurrences in {"kogge-stone": 3, "compact": 2, "sweep": 1}.items():
        time = simulate(network, n, follower(name, n, seconds=c))
        assert_allclose(time, (recurrences * rounds + 1) * c, rtol=1e-3)
    assert_allclose(simulate(network, n, gather_scatter_program(n, (3, 1), 1, c)), n * c, rtol=1e-3)


@needs_simgrid
def test_who_shares_a_medium_waits_for_the_others():
    size, speed = 10**6, 8e6
    crossing = [MessagePhase((Flow(array(0, 1, 2, 3), array(1, 0, 3, 2), size),))]
    into_one = [MessagePhase((Flow(array(1, 2, 3), array(0, 0, 0), size),))]
    expected = {"duplex": (1, 3), "half duplex": (2, 3), "channel": (4, 3)}
    for sharing, seconds in expected.items():
        network = SimulatedNetwork("", 1e-6, speed, sharing)
        assert_allclose([simulate(network, 4, p) for p in (crossing, into_one)], seconds, rtol=1e-3)


@needs_simgrid
def test_a_simulation_that_takes_too_long_is_stopped():
    with pytest.raises(TimeoutError, match=r"256 ranks: longer than 0\.001 s"):
        simulate(NETWORKS["ethernet"], 256, follower("kogge-stone", 256), limit=0.001)


@needs_simgrid
def test_a_sweep_is_kept_and_goes_on_where_it_stopped(monkeypatch, tmp_path):
    out = tmp_path / "simulated.json"
    said = []
    given = {"1": every_cost(1e-6)}
    first = simulated.run_simulations(out, [2, 4], [1], ["ethernet"], seconds=given, say=said.append)
    assert len(said) == len(first["points"]) == 2 * len(simulated.CONTENDERS)
    assert first["simulated"].startswith("SimGrid")
    assert simulated.load(out) == first
    both = simulated.run_simulations(out, [4], [1], ["ethernet", "radio"], seconds=given, say=said.append)
    assert len(both["points"]) == 3 * len(simulated.CONTENDERS) == len(said)
    with pytest.raises(InputError, match="expected the same or another file"):
        simulated.run_simulations(out, [4], [1], ["ethernet"], seconds={"1": every_cost(2e-6)})

    def too_long(*arguments):
        raise TimeoutError("longer than 1 s")

    monkeypatch.setattr(simulated, "simulate", too_long)
    held = simulated.run_simulations(out, [4, 8, 16], [1], ["ethernet"], seconds=given)
    assert {(gap["contender"], gap["n"]) for gap in held["left_out"]} == {(name, 8) for name in simulated.CONTENDERS}


# ---- file and figure -----------------------------------------------------------------------------------------------


def results():
    """What a sweep leaves, with made-up times."""
    points = [
        {"network": network, "contender": name, "samples": samples, "n": n, "seconds": 1e-6 * n * samples * k}
        for network in ("radio", "ethernet")
        for k, name in enumerate(simulated.CONTENDERS, start=1)
        for samples in (1, 2000)
        for n in (8, 512, 65536)
    ]
    networks = {name: NETWORKS[name]._asdict() for name in ("radio", "ethernet")}
    return {"format": 2, "simulated": "SimGrid 3.32", "networks": networks, "points": points, "left_out": []}


def test_the_figure_holds_every_time_and_says_simulated(tmp_path):
    figure = simulated_figure(results())
    grid = np.reshape(figure.axes, (2, 2))
    for axes, (samples, network) in zip(
        grid.flat, [(1, "ethernet"), (1, "radio"), (2000, "ethernet"), (2000, "radio")], strict=True
    ):
        for name in simulated.CONTENDERS:
            [line] = [line for line in axes.lines if line.get_gid() == name]
            expected = [
                (p["n"], p["seconds"])
                for p in results()["points"]
                if (p["network"], p["contender"], p["samples"]) == (network, name, samples)
            ]
            assert_allclose(line.get_xydata(), expected)
    assert "imulated (SimGrid" in figure.get_suptitle()
    assert all("simulated" in axes.get_ylabel() for axes in grid[:, 0])
    assert save_figure(figure, tmp_path / "new" / "a.png").stat().st_size > 10_000


def test_one_number_of_robots_gives_rows():
    held = results()
    held["points"] = [p for p in held["points"] if p["n"] == 8]
    figure = simulated_figure(held)
    assert {text.get_text() for text in figure.axes[0].get_yticklabels()} >= {"sweep", "compact"}
    assert all(len(axes.texts) == len(simulated.CONTENDERS) for axes in figure.axes)


def test_a_gap_is_mentioned_in_the_figure():
    def remarks(held):
        return [text.get_text() for legend in simulated_figure(held).legends for text in legend.get_texts()]

    shorter = copy.deepcopy(results())
    shorter["points"] = [p for p in shorter["points"] if p["contender"] != "pipeline" or p["n"] < 65536]
    assert not any("take too long" in text for text in remarks(results()))
    assert any("take too long" in text for text in remarks(shorter))


def test_files_that_hold_something_else_are_refused(tmp_path):
    for content in ("", "[]", json.dumps({"format": 2, "runs": []})):
        (tmp_path / "a.json").write_text(content)
        with pytest.raises(InputError, match="simulated times: "):
            simulated.load(tmp_path / "a.json")
    with pytest.raises(InputError, match="no simulated times"):
        simulated_figure({"points": []})
