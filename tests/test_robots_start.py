"""Robots find each other and agree when to start, over channels that lose, delay, repeat and reorder messages."""

import heapq
import itertools
import random
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mp2a import launch
from mp2a.exceptions import DependencyError, InputError
from mp2a.robots.start import CLOCK_TOLERANCE, LEAD, PATIENCE, Start

ROLES = ("R1", "R2", "R3")


def talk(roles, begins, rng, loss=0.0, delay=0.3, until=30.0, offsets=None):
    """Let robots that are switched on at some times talk until all are past the start; returns them."""
    offsets = dict.fromkeys(roles, 0.0) if offsets is None else offsets
    robots, mail, order = {}, [], itertools.count()
    for tick in range(round(until / 0.1)):
        now = tick * 0.1
        for role, begin in zip(roles, begins, strict=True):
            if now >= begin:
                robots.setdefault(role, Start(role, roles))
        out = [text for role, robot in robots.items() for text in robot.say(now + offsets[role])]
        while mail and mail[0][0] <= now:
            _, _, receiver, text = heapq.heappop(mail)
            if receiver in robots:
                out += robots[receiver].hear(text, now + offsets[receiver])
        for text, receiver in itertools.product(out, roles):
            for _ in range(rng.choice((1, 1, 2))):
                if rng.random() >= loss:
                    heapq.heappush(mail, (now + rng.uniform(0, delay), next(order), receiver, text))
        agreed = [robot.time for robot in robots.values()]
        if len(agreed) == len(roles) and None not in agreed and now > max(agreed):
            break
    return robots


@given(st.integers(1, 5), st.integers(0, 10**6), st.floats(0, 0.5))
def test_all_agree_however_messages_come(n, seed, loss):
    rng = random.Random(seed)
    roles = [f"R{k}" for k in range(n)]
    begins = [rng.uniform(0, 5) for _ in roles]
    robots = talk(roles, begins, rng, loss)
    times = {robot.time for robot in robots.values()}
    assert len(times) == 1
    assert max(begins) + LEAD <= times.pop() < 25


def test_nobody_proposes_before_all_have_answered():
    start = Start("R1", ROLES)
    assert start.say(0.0) == ["test R1"]
    assert start.hear("test R1 R2", 0.0) == []
    assert start.say(0.1) == ["test R1"]
    start.hear("test R1 R3", 0.2)
    assert start.all_ready
    assert start.say(0.3) == ["test R1", f"sync R1 {0.3 + LEAD!r}"]
    assert start.say(5.0) == ["test R1", f"sync R1 {0.3 + LEAD!r}"], "it proposes once"
    assert start.time is None


def test_a_test_of_another_is_echoed_with_the_own_role_and_nothing_else_is():
    start = Start("R2", ROLES)
    assert start.hear("test R1", 0.0) == ["test R1 R2"]
    for text in ("test R2", "test R1 R3", "test R9", "sync R1 x", "sync R1 nan", "hello", "", "test R1 R3 R2"):
        assert start.hear(text, 0.0) == []
    assert not start.all_ready


@pytest.mark.parametrize("order", list(itertools.permutations((("R2", 7.0), ("R3", 6.0)))))
def test_the_latest_proposal_holds_in_whatever_order_they_come(order):
    start = Start("R1", ROLES)
    for role in ("R2", "R3"):
        start.hear(f"test R1 {role}", 3.0)
    start.say(3.5)
    for role, time in order:
        start.hear(f"sync {role} {time}", 3.5)
    assert start.time == 3.5 + LEAD


def test_a_clock_that_is_ahead_is_refused():
    start = Start("R1", ROLES)
    start.hear(f"sync R2 {LEAD + CLOCK_TOLERANCE - 0.01}", 0.0)
    with pytest.raises(DependencyError, match=r"the clock of R3 is 2.0 s ahead of that of R1"):
        start.hear(f"sync R3 {LEAD + 2.0}", 0.0)


def test_who_learns_it_too_late_says_so():
    start = Start("R1", ("R1", "R2"))
    start.hear("test R1 R2", 0.0)
    start.say(0.0)
    with pytest.raises(DependencyError, match=r"R1 learned 1.0 s too late when to start"):
        start.hear(f"sync R2 {LEAD - 0.5}", LEAD + 1.0)


def test_who_is_missing_is_named():
    start = Start("R1", ROLES)
    start.hear("test R1 R2", 0.0)
    start.check(PATIENCE - 1)
    with pytest.raises(DependencyError, match="R1 waited 60 s for R3; are all robots on"):
        start.check(PATIENCE + 1)
    with pytest.raises(InputError, match="role: got 'R9'"):
        Start("R9", ROLES)


def test_one_robot_alone_starts_by_itself():
    start = Start("R1", ("R1",))
    start.say(1.0)
    assert start.time == 1.0 + LEAD


def test_ranks_agree_over_mpi():
    """Real messages, real time; every rank says the same time to the last digit."""
    program = (
        "import time\nfrom mpi4py import MPI\nfrom mp2a.robots.channel import MpiChannel, agree\n"
        "from mp2a.robots.start import Start\ncomm = MPI.COMM_WORLD\ntime.sleep(0.3 * comm.rank)\n"
        "roles = [f'R{k}' for k in range(comm.size)]\n"
        "print('agreed', repr(agree(Start(roles[comm.rank], roles, 1.0), MpiChannel(comm))), flush=True)\n"
    )
    done = launch.run(
        3, [sys.executable, "-m", "mpi4py", "-c", program], timeout=90, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    said = [line for line in done.stdout.splitlines() if line.startswith("agreed")]
    assert len(said) == 3
    assert len(set(said)) == 1
