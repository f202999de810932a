"""Commands to robots: limits, slip, ticks, points, files; each against its law."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mp2a.dependencies import parse_toml
from mp2a.exceptions import InputError
from mp2a.formation.robot_models import HUSKY, ROBOTS
from mp2a.robots import limits, robots_file, slip, sound
from mp2a.robots.clock import RealTimeClock
from mp2a.robots.cloud import read_cloud
from mp2a.robots.robot_config import ROBOT_CONFIGS, RobotConfig
from mp2a.simulator import PHYSICS_ENGINE_SLIP, Simulation, TurnSlip, World

SPEED = st.floats(-5, 5, allow_subnormal=False)
COMMAND = st.tuples(SPEED, SPEED)
LIMIT = st.tuples(st.floats(0.1, 3), st.floats(0.1, 3))


def curvature_error(a, b):
    """Sine of the angle between two commands as vectors: 0 if their paths have the same curvature."""
    return abs(a[0] * b[1] - a[1] * b[0]) / max(math.hypot(*a) * math.hypot(*b), 1e-300)


# ---- limits ----------------------------------------------------------------------------------------------------


@given(COMMAND, LIMIT)
def test_saturation_keeps_limits_direction_and_curvature(command, limit):
    out = limits.saturate(command, limit)
    assert (np.abs(out) <= limit).all()
    assert (out * command >= 0).all()
    assert curvature_error(out, command) < 1e-12 or math.hypot(*command) < 1e-9
    if (np.abs(command) <= limit).all():
        assert out.tolist() == list(command)
    else:
        assert np.max(np.abs(out) / limit) == pytest.approx(1)


@given(COMMAND, COMMAND, LIMIT, st.floats(0.01, 0.2))
def test_approach_keeps_to_accelerations_and_comes_no_less_near_than_they_allow(now, wanted, most, dt):
    out = limits.approach(now, wanted, most, dt)
    change = np.abs(out - now) / (np.array(most) * dt)
    assert change.max() <= 1 + 1e-9
    assert out.tolist() == list(wanted) or change.max() == pytest.approx(1)
    assert curvature_error(out - now, np.subtract(wanted, now)) < 1e-6 or change.max() < 1e-6


@given(COMMAND, LIMIT)
def test_from_rest_and_to_rest_the_curvature_stays(command, most):
    started = limits.approach((0, 0), command, most, 0.05)
    braked = limits.approach(command, (0, 0), most, 0.05)
    for out in (started, braked):
        assert curvature_error(out, command) < 1e-9 or math.hypot(*out) < 1e-9


@given(COMMAND, COMMAND, LIMIT)
def test_approach_arrives_when_the_slower_of_the_two_does(now, wanted, most):
    ticks = math.ceil(np.max(np.abs(np.subtract(wanted, now)) / (np.array(most) * 0.05)) - 1e-9)
    out = now
    for _ in range(ticks + 1):
        out = limits.approach(out, wanted, most, 0.05)
    assert out.tolist() == list(wanted)


def test_limits_work_on_many_robots_at_once():
    commands, most = np.array([[2.0, 1.0], [0.1, 4.0]]), np.array([[1.0, 2.0], [0.5, 2.5]])
    each = [limits.saturate(command, limit) for command, limit in zip(commands, most, strict=True)]
    np.testing.assert_array_equal(limits.saturate(commands, most), each)


# ---- slip ------------------------------------------------------------------------------------------------------


def turn(true_slip, speeds, wanted, learn=True, seconds=10 * slip.LEARNING):
    """Turn rates that a simulated HUSKY reaches at the end of each of several legs, and what was learned."""
    simulation = Simulation(World(), HUSKY, [[0, 0, 0]], slip=true_slip)
    known, sent, out = slip.NO_SLIP_SEEN, np.zeros(2), []
    for speed in speeds:
        for _ in range(round(seconds / 0.05)):
            twist = simulation.twists[0].copy()
            if learn:
                known = slip.learn(known, sent[1], twist, 0.05)
            sent = slip.compensate(known, np.array([speed, wanted]), twist[0])
            simulation.step([sent], 0.05)
        out.append(simulation.twists[0, 1])
    return np.array(out), known


@pytest.mark.parametrize("true_slip", [TurnSlip(), PHYSICS_ENGINE_SLIP, TurnSlip(0.6, 0.4)])
@pytest.mark.parametrize("wanted", [0.4, -0.3])
def test_learned_slip_gives_the_turn_that_was_wanted(true_slip, wanted):
    """On the spot, while driving, and in between; without it every turn comes out by the share too small."""
    speeds = (0.0, 0.6, 0.25)
    without, _ = turn(true_slip, speeds, wanted, learn=False)
    np.testing.assert_allclose(without, wanted * true_slip.ratio(speeds), rtol=1e-6)
    learned, known = turn(true_slip, speeds, wanted)
    np.testing.assert_allclose(learned, wanted, rtol=0.02)
    assert slip.remaining_share(known, speeds[-1]) == pytest.approx(float(true_slip.ratio(speeds[-1])), rel=0.02)


def test_where_nothing_slips_nothing_is_changed():
    learned, known = turn(TurnSlip(1.0, 1.0), (0.5,), 0.4)
    np.testing.assert_allclose(learned, 0.4, rtol=1e-3)
    assert slip.remaining_share(known, 0.5) == pytest.approx(1.0, abs=1e-3)


@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(-1, 1), st.floats(-50, 50)), max_size=40))
def test_no_measurement_moves_a_share_out_of_its_bounds(measured):
    known = slip.NO_SLIP_SEEN
    for sent, speed, turned in measured:
        known = slip.learn(known, sent, np.array([speed, turned]), 0.05)
        assert ((known.shares >= slip.LEAST_SHARE) & (known.shares <= slip.MOST_SHARE)).all()


@given(st.lists(st.tuples(st.floats(-2, 2), st.floats(-1, 1)), max_size=60), st.sampled_from([0.02, 0.05, 0.1]))
def test_what_comes_late_is_not_lost(commands, dt):
    """A robot that turns just as it is told, `LAG` later, is not taken to slip."""
    late, known = round(slip.LAG / dt), slip.NO_SLIP_SEEN
    for k, (sent, speed) in enumerate(commands):
        turned = commands[k - late][0] if k >= late else 0.0
        known = slip.learn(known, sent, np.array([speed, turned]), dt)
    np.testing.assert_allclose(known.shares, 1.0, atol=1e-9)


def test_lost_odometry_teaches_nothing():
    known = slip.learn(slip.NO_SLIP_SEEN, 1.0, np.array([np.nan, np.nan]), 0.05)
    np.testing.assert_array_equal(known.shares, 1.0)


# ---- ticks -----------------------------------------------------------------------------------------------------


class Clock:
    """Time that passes in sleeps, each a little too long, and in work."""

    def __init__(self, late):
        self.now, self.late = 100.0, late

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        assert seconds > 0
        self.now += seconds + self.late


@given(st.lists(st.floats(0, 0.049), min_size=1, max_size=50), st.floats(0, 0.0009))
def test_ticks_do_not_drift(work, late):
    clock = Clock(late)
    ticker = RealTimeClock(0.05, clock=clock, sleep=clock.sleep)
    for k, busy in enumerate(work):
        clock.now += max(0.0, busy - 2 * late)
        ticker.wait()
        assert clock.now - 100 == pytest.approx(0.05 * (k + 1), abs=late + 1e-9)


def test_missed_ticks_are_left_out():
    clock = Clock(0.0)
    ticker = RealTimeClock(0.05, clock=clock, sleep=clock.sleep)
    clock.now += 0.172
    ticker.wait()
    late = clock.now
    ticker.wait()
    assert (late, clock.now) == pytest.approx((100.172, 100.2))


# ---- sound -----------------------------------------------------------------------------------------------------


def test_says_the_sentence_once_then_beeps_every_three_seconds_until_the_way_is_clear():
    state, heard = sound.CLEAR, []
    for tick in range(200):
        t = tick / 10
        state = sound.next_sound(state, 2 <= t < 12 or t >= 15, t)
        heard += [(t, state.say)] * (state.say is not None) + [(t, "beep")] * state.beep
    assert heard == [
        (2, sound.TEXT), (5, "beep"), (8, "beep"), (11, "beep"), (15, sound.TEXT), (18, "beep"),
    ]  # fmt: skip


# ---- points ----------------------------------------------------------------------------------------------------


def cloud_of(given, kind="<f4", height=1, pad=3, order="xyz", intensity=True):
    """Message with these points, padded and in an odd order as real ones are."""
    size = np.dtype(kind).itemsize
    names = [*order, "intensity"] if intensity else list(order)
    offsets = {name: pad + k * size for k, name in enumerate(names)}
    step = pad + size * len(names) + pad
    width = len(given) // height
    data = bytearray(height * (width * step + 5))
    for i, point in enumerate(given):
        at = (i // width) * (width * step + 5) + (i % width) * step
        for name, value in zip("xyz", point, strict=True):
            data[at + offsets[name] : at + offsets[name] + size] = np.array(value, kind).tobytes()
    number = {"f4": 7, "f8": 8, "i2": 3}[kind[1:]]
    fields = [SimpleNamespace(name=name, offset=offsets[name], datatype=number, count=1) for name in names]
    return SimpleNamespace(
        height=height, width=width, fields=fields, is_bigendian=kind[0] == ">", point_step=step,
        row_step=width * step + 5, data=bytes(data),
    )  # fmt: skip


@given(
    st.lists(st.tuples(*[st.floats(-100, 100, width=32)] * 3), min_size=2, max_size=20),
    st.sampled_from(["<f4", ">f4", "<f8", ">f8"]),
    st.sampled_from(["xyz", "zxy"]),
    st.sampled_from([1, 2]),
)
def test_points_come_back_out_of_a_cloud(given, kind, order, height):
    given = given[: len(given) // height * height]
    np.testing.assert_array_equal(read_cloud(cloud_of(given, kind, height, order=order)), given)


def test_points_that_are_not_finite_are_left_out():
    assert read_cloud(cloud_of([(1, 2, 3), (np.nan, 0, 0), (0, np.inf, 0), (4, 5, 6)])).tolist() == [
        [1, 2, 3],
        [4, 5, 6],
    ]
    assert read_cloud(cloud_of([(7, 8, 9)], "<i2")).tolist() == [[7, 8, 9]]
    assert read_cloud(SimpleNamespace(height=1, width=0, data=b"", fields=[])).shape == (0, 3)


def test_clouds_that_cannot_be_read_are_refused():
    cloud = cloud_of([(1, 2, 3)])
    cloud.fields = cloud.fields[1:]
    with pytest.raises(InputError, match="got fields y, z, intensity"):
        read_cloud(cloud)
    cloud = cloud_of([(1, 2, 3)])
    cloud.data = cloud.data[:8]
    with pytest.raises(InputError, match="got 8 bytes of data, expected at least"):
        read_cloud(cloud)
    cloud = cloud_of([(1, 2, 3)])
    cloud.fields[0].datatype = 9
    with pytest.raises(InputError, match="type 9"):
        read_cloud(cloud)


# ---- table and files -------------------------------------------------------------------------------------------


def test_the_table_is_what_thesis_and_robots_say():
    for name, model in ROBOTS.items():
        interface = ROBOT_CONFIGS[name]
        assert interface.model == model
        assert (interface.command_topic, interface.human_topic, interface.message) == (
            "/nav/cmd_vel",
            "/cmd_vel",
            "Twist",
        )
        assert (interface.points_topic, interface.fixed_frame, interface.body_frame) == (
            "/points_filtered", "map", "base_link",
        )  # fmt: skip
    assert ROBOT_CONFIGS["tradr"].acquire == "/mux_cmd_vel/acquire"
    assert ROBOT_CONFIGS["husky-jazzy"].message == "TwistStamped"


FILE = """
adapter = "ros1"
origin = "fixed-frame"
world = "hall.toml"
[all]
rate = 25
[robots.R1]
model = "husky"
max_speed = 0.6
[robots.R2]
model = "tradr"
namespace = "/tradr2"
odometry_topic = "/imu_odom"
"""


def test_a_robots_file_overrides_the_table():
    found = robots_file.robots_of(parse_toml(FILE, "robots"), ("R1", "R2"))
    assert (found.adapter, found.origin, str(found.world)) == ("ros1", "fixed-frame", "hall.toml")
    first, second = found.configs["R1"], found.configs["R2"]
    assert first == dataclasses.replace(
        ROBOT_CONFIGS["husky"], rate=25, model=dataclasses.replace(HUSKY, max_speed=0.6)
    )
    assert second.command_topic == "/tradr2/nav/cmd_vel"
    assert second.acquire == "/tradr2/mux_cmd_vel/acquire"
    assert (second.fixed_frame, second.body_frame) == ("tradr2/map", "tradr2/base_link")
    assert second.odometry_topic == "/imu_odom"
    assert first.command_topic == "/nav/cmd_vel"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"husky"', '"husk"', "robots: robots.R1: model: got 'husk', expected one of husky, tradr"),
        (
            "max_speed = 0.6",
            "max_speed = -1",
            "robots.R1: max_speed: got -1.0 for robot HUSKY, expected a positive number",
        ),
        ("max_speed = 0.6", "max_sped = 1", "robots.R1: got 'max_sped', expected one of model, namespace"),
        ("max_speed = 0.6", "rate = 5", "robots.R1: rate: got 5 Hz, expected at least 10"),
        ("max_speed = 0.6", 'rate = "20"', "robots.R1: rate: got '20', expected a number"),
        ("max_speed = 0.6", "patience = 0.05", "robots.R1: patience: got 0.05 s, expected at least two ticks"),
        ("max_speed = 0.6", "rate = 1e300", r"robots.R1: rate: got 1e\+300, expected at most 200"),
        ("max_speed = 0.6", "max_speed = 1e300", r"robots.R1: max_speed: got 1e\+300, expected at most 20"),
        ("max_speed = 0.6", "max_turn_rate = 1e9", r"robots.R1: max_turn_rate: got 1e\+09, expected at most 20"),
        ("max_speed = 0.6", "patience = 10", "robots.R1: patience: got 10, expected at most 1"),
        ("max_speed = 0.6", f"max_speed = {10**400}", "robots.R1: "),
        ("max_speed = 0.6", 'command_topic = "/cmd_vel"', "expected another one than the human's"),
        ("max_speed = 0.6", 'message = "Pose"', "message: got 'Pose', expected one of Twist, TwistStamped"),
        ("max_speed = 0.6", 'acquire = "/x"', "expected both or none"),
        ("max_speed = 0.6", 'body_frame = "a b"', "expected a name without blanks"),
        ("[robots.R2]", "[robots.R3]", r"got no table \[robots.R2\], expected one for each of R1, R2"),
        ("[robots.R2]", '[robots.R4]\nmodel="husky"\n[robots.R2]', "a table for unknown role 'R4'"),
        ('"ros1"', '"ros"', "adapter: got 'ros', expected one of dry, simulator, recording, ros1, ros2"),
        ("rate = 25", "rate = 25\n[other]", "robots: got 'other', expected one of adapter"),
        ('"/tradr2"', "7", "namespace: got 7"),
        ("[all]", "[all", "cannot be read as TOML"),
    ],
)
def test_mistakes_in_a_robots_file_are_named(old, new, message):
    assert old in FILE
    with pytest.raises(InputError, match=message):
        robots_file.robots_of(parse_toml(FILE.replace(old, new, 1), "robots"), ("R1", "R2"))


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="cannot be read as a robots file"):
        robots_file.read_robots(tmp_path / "none.toml", ("R1",))
    (tmp_path / "r.toml").write_text('world = "w.toml"\n[robots.R1]\nmodel = "husky"')
    assert robots_file.read_robots(tmp_path / "r.toml", ("R1",)).world == tmp_path / "w.toml"


def test_an_interface_made_in_python_is_checked_as_well():
    with pytest.raises(InputError, match="pose_age"):
        RobotConfig(HUSKY, pose_age=0)
