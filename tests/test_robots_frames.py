"""Frames in each other: the tree of transforms that ROS 2's robots tell."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mp2a.robots.transforms import Transforms

FRAMES = ("map", "odom", "base_link", "lidar", "camera")


class Clock:
    def __init__(self, now=1000.0):
        self.now = now

    def __call__(self):
        return self.now


def message(parent, child, shift=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0, 1.0), stamp=1000.0):
    seconds = math.floor(stamp)
    return SimpleNamespace(
        header=SimpleNamespace(
            stamp=SimpleNamespace(sec=seconds, nanosec=round((stamp - seconds) * 1e9)), frame_id=parent
        ),
        child_frame_id=child,
        transform=SimpleNamespace(
            translation=SimpleNamespace(**dict(zip("xyz", shift, strict=True))),
            rotation=SimpleNamespace(**dict(zip("xyzw", turn, strict=True))),
        ),
    )


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def steady():
    return Clock(50.0)


@pytest.fixture
def frames(clock, steady):
    return Transforms(clock, steady)


numbers = st.floats(-10, 10)
turns = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)


@given(
    st.lists(st.tuples(st.tuples(numbers, numbers, numbers), turns), min_size=4, max_size=4),
    st.lists(st.integers(0, 3), min_size=4, max_size=4),
    st.sampled_from(FRAMES), st.sampled_from(FRAMES), st.sampled_from(FRAMES),
)  # fmt: skip
def test_look_ups_agree_with_each_other_in_any_tree(links, parents, a, b, c):
    frames = Transforms(Clock(), Clock())
    for i, ((shift, turn), parent) in enumerate(zip(links, parents, strict=True)):
        unit = np.array(turn) / np.linalg.norm(turn)
        frames.put(message(FRAMES[min(parent, i)], FRAMES[i + 1], shift, unit.tolist()))
    points = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [-4.0, 0.5, 1.0]])
    there, back, by_way = frames.look_up(a, b), frames.look_up(b, a), frames.look_up(a, c)
    np.testing.assert_allclose(there.apply(back.apply(points)), points, atol=1e-12 * 100)
    np.testing.assert_allclose(by_way.apply(frames.look_up(c, b).apply(points)), there.apply(points), atol=1e-11)
    np.testing.assert_allclose(there.rotation @ there.rotation.T, np.eye(3), atol=1e-14)
    assert frames.look_up(a, a).apply(points) == pytest.approx(points)


def test_a_chain_is_one_shift_and_turn_after_the_other(frames):
    quarter = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
    frames.put(message("map", "odom", (1.0, 0.0, 0.0), quarter))
    frames.put(message("/odom", "/base_link", (2.0, 0.0, 0.0), quarter))
    found = frames.look_up("map", "base_link")
    np.testing.assert_allclose(found.translation, (1.0, 2.0, 0.0), atol=1e-15)
    assert abs(found.pose[2]) == pytest.approx(math.pi)
    np.testing.assert_allclose(found.apply(np.array([[1.0, 0.0, 0.0]])), [[0.0, 2.0, 0.0]], atol=1e-15)


def test_no_chain_no_transform(frames):
    frames.put(message("map", "odom"))
    frames.put(message("other", "base_link"))
    assert frames.look_up("map", "base_link") is None
    assert frames.look_up("map", "nowhere") is None


def test_frames_in_a_ring_do_not_hang(frames):
    frames.put(message("a", "b"))
    frames.put(message("b", "a"))
    frames.put(message("c", "c"))
    assert frames.look_up("a", "b") is not None
    assert frames.look_up("a", "c") is None


def test_a_chain_is_as_old_as_its_oldest_moving_link(frames, steady):
    frames.put(message("map", "odom", stamp=999.8))
    frames.put(message("odom", "base_link", stamp=1000.0))
    frames.put(message("base_link", "lidar", stamp=0.0), fixed=True)
    assert frames.look_up("map", "lidar").age == pytest.approx(0.2)
    assert frames.look_up("base_link", "lidar").age == 0.0
    steady.now += 5
    assert frames.look_up("map", "lidar").age == pytest.approx(5.2)


@pytest.mark.parametrize("set_to", [0.0, 500.0, 2000.0])
def test_who_sets_the_clock_does_not_make_transforms_young(frames, clock, steady, set_to):
    frames.put(message("map", "base_link", (1.0, 0.0, 0.0)))
    clock.now = set_to
    steady.now += 1
    assert frames.look_up("map", "base_link").age == pytest.approx(1.0)
    frames.put(message("map", "base_link", (2.0, 0.0, 0.0), stamp=set_to))
    assert frames.look_up("map", "base_link").translation[0] == 2.0
    assert frames.look_up("map", "base_link").age == pytest.approx(0.0)


def test_a_stamp_in_the_future_is_now(frames, steady):
    frames.put(message("map", "base_link", stamp=1100.0))
    steady.now += 1
    assert frames.look_up("map", "base_link").age == pytest.approx(1.0)


def test_what_comes_late_does_not_replace_what_is_newer(frames):
    frames.put(message("map", "base_link", (2.0, 0.0, 0.0), stamp=999.9))
    frames.put(message("map", "base_link", (1.0, 0.0, 0.0), stamp=999.8))
    assert frames.look_up("map", "base_link").translation[0] == 2.0


@pytest.mark.parametrize(
    ("shift", "turn"),
    [
        ((math.nan, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        ((0.0, math.inf, 0.0), (0.0, 0.0, 0.0, 1.0)),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (0.0, math.nan, 0.0, 1.0)),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 1.0)),
    ],
)
def test_what_is_no_transform_is_left_out(frames, shift, turn):
    frames.put(message("map", "base_link", shift, turn))
    assert frames.look_up("map", "base_link") is None
    frames.put(message("map", "base_link", (1.0, 0.0, 0.0)))
    frames.put(message("map", "base_link", shift, turn))
    assert frames.look_up("map", "base_link").translation[0] == 1.0
