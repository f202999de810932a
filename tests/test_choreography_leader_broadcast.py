"""Through the chain the leaders' motion reaches every robot as each robot would have worked it out by itself."""

from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mp2a.exceptions import InputError
from mp2a.formation.choreography import leader
from mp2a.formation.choreography.leader_broadcast import broadcast_leaders, planar_chain, shared_leaders
from mp2a.formation.choreography.program import compile_program
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.constants import TICK
from mp2a.formation.exchange import LocalExchange
from mp2a.formation.robot_models import HUSKY, TRADR
from mp2a.methods import METHODS
from mp2a.se2 import compose, drive
from mp2a.simulator.scenario_run import run

LISTINGS = {
    path.stem: path.read_text() for path in (Path(__file__).parents[1] / "examples" / "scenarios").glob("*.txt")
}


def told(text, model, method="sweep"):
    scenario = parse(text)
    return Choreography(scenario, model, exchange=LocalExchange(planar_chain(len(scenario.robots)), method))


@pytest.mark.parametrize("name", LISTINGS)
def test_robots_that_are_told_drive_as_those_that_work_it_out(name):
    own, scan = Choreography(parse(LISTINGS[name]), TRADR), told(LISTINGS[name], TRADR)
    expected, got = run(own), run(scan)
    assert got.done == expected.done
    for field in ("time", "poses", "twists", "commands", "leader_twists", "slots"):
        np.testing.assert_allclose(getattr(got, field), getattr(expected, field), atol=1e-9, err_msg=field)
    turned = np.exp(1j * got.leader_poses[..., 2]) - np.exp(1j * expected.leader_poses[..., 2])
    assert np.abs(turned).max() < 1e-9
    np.testing.assert_allclose(got.leader_poses[..., :2], expected.leader_poses[..., :2], atol=1e-9)
    assert scan.events == own.events


@pytest.mark.parametrize("method", ["serial", *METHODS])
def test_every_method_tells_the_same(method):
    np.testing.assert_allclose(
        run(told(LISTINGS["listing_6_3"], TRADR, method)).poses, run(told(LISTINGS["listing_6_3"], TRADR)).poses,
        atol=1e-9,
    )  # fmt: skip


def test_leaders_move_as_the_told_twist_says():
    show = told(LISTINGS["listing_6_3"], TRADR)
    for tick in range(150):
        show.step(tick * TICK, show.slot_poses(), np.zeros((4, 2)), None)
        before = show.state.leaders
        show.step((tick + 1) * TICK, show.slot_poses(), np.zeros((4, 2)), None)
        now = show.state.leaders
        same = before.step == now.step
        step = compose(before.pose, drive(before.twist, TICK))
        np.testing.assert_allclose(now.pose[same, :2], step[same, :2], atol=1e-9)


@pytest.mark.parametrize(("name", "count"), [("listing_7_1", 1), ("listing_6_1", 2), ("listing_7_4", 2)])
def test_robots_with_the_same_instructions_share_a_leader(name, count):
    program = compile_program(parse(LISTINGS[name]))
    found = shared_leaders(program)
    assert len(found.first) == count
    assert found.leader[found.first].tolist() == list(range(count))


@pytest.mark.parametrize("name", LISTINGS)
def test_leader_and_place_follow_from_the_step(name):
    program = compile_program(parse(LISTINGS[name]))
    found = shared_leaders(program)
    course = leader.start(program, None)
    for tick in range(900):
        course = leader.advance(program, course, tick * TICK, 1.0)
        state = course.leaders
        first = found.first[found.leader]
        assert (state.pose == state.pose[first]).all()
        assert (state.twist == state.twist[first]).all()
        assert (state.step == state.step[first]).all()
        assert (state.slot == found.slots[np.arange(len(program)), state.step]).all()


@given(st.integers(0, 2**32 - 1), st.sampled_from(list(LISTINGS)))
@settings(max_examples=40, deadline=None)
def test_any_motion_arrives(seed, name):
    """Leaders anywhere, at any step."""
    rng = np.random.default_rng(seed)
    program = compile_program(parse(LISTINGS[name]))
    found, n = shared_leaders(program), len(program)
    many = len(found.first)
    step = rng.integers(0, program.kind.shape[1], many)[found.leader]
    pose = (rng.normal(scale=(20, 20, 3), size=(many, 3)))[found.leader]
    twist = rng.normal(size=(many, 2))[found.leader]
    twist[found.leader == 0] = 0.0
    course = leader.Leaders(pose, twist, step, found.slots[np.arange(n), step])
    got = broadcast_leaders(LocalExchange(planar_chain(n)), found, course)
    np.testing.assert_allclose(got.pose[:, :2], pose[:, :2], atol=1e-10)
    np.testing.assert_allclose(np.exp(1j * got.pose[:, 2]), np.exp(1j * pose[:, 2]), atol=1e-12)
    np.testing.assert_allclose(got.twist, twist, atol=1e-12)
    assert (got.step == step).all()
    assert (got.slot == course.slot).all()
    assert (got.stands == course.stands).all()  # zero stays zero


def test_what_is_wrong_is_raised_where_the_exchange_shares_it():
    """A wrong argument is an error of the broadcast, if one is due, and the others do not wait for the scan."""

    class Listening(LocalExchange):
        calls = ()

        @contextmanager
        def together(self, call):
            try:
                yield call
            except InputError:
                self.calls = (*self.calls, "shared error")
                raise

        def broadcast(self, values):
            self.calls = (*self.calls, "broadcast")
            return values

        def run(self, joints, external):
            self.calls = (*self.calls, "scan")
            return super().run(joints, external)

    exchange = Listening(planar_chain(2))
    show = Choreography(parse(LISTINGS["listing_7_1"]), HUSKY, exchange=exchange)
    show.step(0.0, show.slot_poses(), np.zeros((2, 2)), None)
    with pytest.raises(InputError, match=r"poses: got shape \(1, 3\), expected \(2, 3\)"):
        show.step(0.1, np.zeros((1, 3)), np.zeros((2, 2)), None)
    assert exchange.calls == ("broadcast", "scan", "shared error")
    show.step(0.2, show.slot_poses(), np.zeros((2, 2)), None)
    assert show.state.tick == 2
    with pytest.raises(InputError, match="twists"):  # nothing is told between two ticks
        show.step(0.25, show.slot_poses(), np.zeros((1, 2)), None)
    assert exchange.calls == ("broadcast", "scan", "shared error", *("broadcast", "scan") * 2)
