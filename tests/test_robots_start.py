"""Robots find each other and agree when to start, over channels that lose, delay, repeat and reorder messages."""

import heapq
import itertools
import json
import random
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mp2a import launch
from mp2a.exceptions import DependencyError, InputError
from mp2a.formation.choreography.reading import parse
from mp2a.formation.robot_models import HUSKY, TRADR
from mp2a.robots.channel import agree_on_start, agree_over_ranks
from mp2a.robots.start import CLOCK_TOLERANCE, LEAD, PATIENCE, Start
from mp2a.robots.terms import terms_of

ROLES = ("R1", "R2", "R3")
TERMS = {"scenario": "digest 0123", "v_max": "0.7 m/s"}
SAME = json.dumps(TERMS)


def introduce(start, *roles):
    """Let a robot hear the terms of others, which are its own."""
    for role in roles:
        assert start.hear(f"terms {role} {SAME}", 0.0) == []


def talk(roles, begins, rng, loss=0.0, delay=0.3, until=30.0, offsets=None):
    """Let robots that are switched on at some times talk until all are past the start; returns them."""
    offsets = dict.fromkeys(roles, 0.0) if offsets is None else offsets
    robots, mail, order = {}, [], itertools.count()
    for tick in range(round(until / 0.1)):
        now = tick * 0.1
        for role, begin in zip(roles, begins, strict=True):
            if now >= begin:
                robots.setdefault(role, Start(role, roles, TERMS))
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
    start = Start("R1", ROLES, TERMS)
    waiting = ["test R1", f"terms R1 {SAME}"]
    assert start.say(0.0) == waiting
    assert start.hear("test R1 R2", 0.0) == []
    introduce(start, "R2")
    assert start.say(0.1) == waiting
    start.hear("test R1 R3", 0.2)
    assert start.say(0.2) == waiting, "whose terms are not known may drive anything"
    introduce(start, "R3")
    assert start.all_ready
    assert start.say(0.3) == [*waiting, f"sync R1 {0.3 + LEAD!r}"]
    assert start.say(5.0) == [*waiting, f"sync R1 {0.3 + LEAD!r}"], "it proposes once"
    assert start.time is None


def test_a_test_of_another_is_echoed_with_the_own_role_and_nothing_else_is():
    start = Start("R2", ROLES, TERMS)
    assert start.hear("test R1", 0.0) == ["test R1 R2"]
    for text in ("test R2", "test R1 R3", "test R9", "sync R1 x", "sync R1 nan", "hello", "", "test R1 R3 R2"):
        assert start.hear(text, 0.0) == []
    assert not start.all_ready


@pytest.mark.parametrize("order", list(itertools.permutations((("R2", 7.0), ("R3", 6.0)))))
def test_the_latest_proposal_holds_in_whatever_order_they_come(order):
    start = Start("R1", ROLES, TERMS)
    for role in ("R2", "R3"):
        start.hear(f"test R1 {role}", 3.0)
        introduce(start, role)
    start.say(3.5)
    for role, proposal in order:
        start.hear(f"sync {role} {proposal}", 3.5)
    assert start.time == 3.5 + LEAD


def test_a_clock_that_is_ahead_is_refused():
    start = Start("R1", ROLES, TERMS)
    start.hear(f"sync R2 {LEAD + CLOCK_TOLERANCE - 0.01}", 0.0)
    with pytest.raises(DependencyError, match=r"the clock of R3 is 2.0 s ahead of that of R1"):
        start.hear(f"sync R3 {LEAD + 2.0}", 0.0)


def test_who_learns_it_too_late_says_so():
    start = Start("R1", ("R1", "R2"), TERMS)
    start.hear("test R1 R2", 0.0)
    introduce(start, "R2")
    start.say(0.0)
    with pytest.raises(DependencyError, match=r"R1 learned 1.0 s too late when to start"):
        start.hear(f"sync R2 {LEAD - 0.5}", LEAD + 1.0)


def test_who_is_missing_is_named():
    start = Start("R1", ROLES, TERMS)
    start.hear("test R1 R2", 0.0)
    introduce(start, "R2")
    start.check(PATIENCE - 1)
    with pytest.raises(DependencyError, match="R1 waited 60 s for R3; are all robots on"):
        start.check(PATIENCE + 1)
    with pytest.raises(InputError, match="role: got 'R9'"):
        Start("R9", ROLES, TERMS)


ROW = "robots R1 R2\nrow R1,R2 0 1.2\nmove {} 0"
MODELS = dict.fromkeys(("R1", "R2"), HUSKY)


@pytest.mark.parametrize(
    ("other", "names"),
    [
        (terms_of(parse(ROW.format(3)), MODELS, 1.0), ["scenario: digest "]),
        (terms_of(parse(ROW.format(2)), MODELS, 0.5), ["v_max: 1.0 m/s for R1, 0.5 m/s for R2"]),
        (terms_of(parse(ROW.format(2)), {**MODELS, "R2": TRADR}, 0.5), ["v_max: ", "model of R2: HUSKY, length 0.99"]),
        ({}, ["mp2a: ", "scenario: ", "v_max: 1.0 m/s for R1, none for R2", "model of R1: ", "model of R2: "]),
    ],
)
def test_robots_that_were_not_given_the_same_do_not_start(other, names):
    start = Start("R1", ("R1", "R2"), terms_of(parse(ROW.format(2)), MODELS, 1.0))
    start.hear("test R1 R2", 0.0)
    with pytest.raises(InputError, match="start: R1 and R2 were not given the same") as refused:
        start.hear(f"terms R2 {json.dumps(other)}", 0.0)
    said = str(refused.value).partition("difference: ")[2].split("; ")
    assert len(said) == len(names)
    assert all(text.startswith(name) for text, name in zip(said, names, strict=True))
    assert start.say(0.1)[-1].startswith("terms R1 "), "no time is proposed"


def test_comments_and_blanks_of_a_scenario_do_not_count():
    one, other = parse(ROW.format(2)), parse("# the same\n\nrobots  R1 R2\nrow R1,R2 0 1.20\n# and on\nmove 2.0 0")
    assert terms_of(one, MODELS, 1.0) == terms_of(other, MODELS, 1.0)


def test_both_of_two_robots_that_differ_learn_of_it():
    """The one that hears it first goes on telling until the other, switched on later, has heard it as well."""
    mail, errors = {"R1": [], "R2": []}, {}

    def talk_as(role, other, terms):
        def publish(text):
            mail[other].append(text)

        def receive():
            came, mail[role] = mail[role], []
            return came

        channel = SimpleNamespace(publish=publish, receive=receive, announce=lambda ready: None)
        try:
            agree_on_start(Start(role, ("R1", "R2"), terms), channel)
        except InputError as error:
            errors[role] = str(error)

    first = threading.Thread(target=talk_as, args=("R1", "R2", TERMS))
    first.start()
    time.sleep(0.25)
    mail["R2"].clear()  # as on a topic: who was not there has not heard it
    talk_as("R2", "R1", {**TERMS, "v_max": "0.5 m/s"})
    first.join(10)
    assert errors == {
        role: f"start: {role} and {other} were not given the same, expected no difference: "
        f"v_max: {own} m/s for {role}, {theirs} m/s for {other}"
        for role, other, own, theirs in (("R1", "R2", 0.7, 0.5), ("R2", "R1", 0.5, 0.7))
    }


def test_ranks_that_read_different_files_are_refused(tmp_path):
    """Each rank may be on a computer of its own, with files of its own."""
    for rank, length in enumerate((2, 3)):
        (tmp_path / f"scenario{rank}.txt").write_text(ROW.format(length))
    program = (
        "import os, sys\nfrom mp2a.cli import main\n"
        "sys.exit(main(['drive', sys.argv[1] + os.environ['OMPI_COMM_WORLD_RANK'] + '.txt', '--quiet']))"
    )
    done = launch.run(
        2, [sys.executable, "-c", program, str(tmp_path / "scenario")], timeout=90, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert done.returncode == 2
    assert "were not given the same, expected no difference: scenario: digest " in done.stdout


def test_one_robot_alone_starts_by_itself():
    start = Start("R1", ("R1",), TERMS)
    start.say(1.0)
    assert start.time == 1.0 + LEAD


class Ranks:
    """A communicator whose ranks have these clocks."""

    def __init__(self, *clocks):
        self.clocks = clocks

    def Ibarrier(self):
        return self

    def Test(self):
        return True

    def allgather(self, own):
        return list(self.clocks)


def test_ranks_start_by_the_latest_clock_unless_one_is_wrong():
    assert agree_over_ranks(Ranks(10.0, 10.2, 10.1)) == 10.2 + LEAD
    with pytest.raises(DependencyError, match=r"the clock of rank 1 is 0\.6 s ahead of that of rank 2"):
        agree_over_ranks(Ranks(10.0, 10.3, 9.7))


def test_ranks_agree_over_mpi():
    """Real messages, real time; every rank says the same time to the last digit."""
    program = (
        "import time\nfrom mpi4py import MPI\nfrom mp2a.robots.channel import agree_over_ranks\n"
        "time.sleep(0.3 * MPI.COMM_WORLD.rank)\n"
        "print('agreed', repr(agree_over_ranks(MPI.COMM_WORLD)), flush=True)\n"
    )
    done = launch.run(
        3, [sys.executable, "-m", "mpi4py", "-c", program], timeout=90, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    said = [line for line in done.stdout.splitlines() if line.startswith("agreed")]
    assert len(said) == 3
    assert len(set(said)) == 1
