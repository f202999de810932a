"""Bags of drives: what is written is read back, by libraries that did not write it too; bad files are named."""

import contextlib
import dataclasses
import shutil
import sqlite3
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from mp2a.exceptions import InputError
from mp2a.formation.robot_models import HUSKY
from mp2a.robots.cloud import read_cloud
from mp2a.robots.interface import NO_POSE, Sensed
from mp2a.robots.records.bag_reader import BagReader
from mp2a.robots.records.bag_writer import BAGS, BagWriter, bag_path
from mp2a.robots.records.recorded import RecordedRobot
from mp2a.robots.robot_config import ROBOT_CONFIGS
from mp2a.robots.robots_file import within
from mp2a.robots.ticks import BEGINS, DriveTick, changes
from mp2a.robots.topics import EVENTS_TOPIC, bag_topics
from mp2a.robots.transforms import heading
from mp2a.simulator import RunRecorder, Simulation, World, save_recording

SECOND = 1_000_000_000
NUMBER = st.floats(-1e3, 1e3)
POSE = st.one_of(st.tuples(NUMBER, NUMBER, st.floats(-3.1, 3.1)).map(np.array), st.just(NO_POSE))
PAIR = st.tuples(NUMBER, NUMBER).map(np.array)
POINTS = st.one_of(
    st.none(), arrays(np.float32, st.tuples(st.integers(0, 5), st.just(2)), elements=st.floats(-99, 99, width=32))
)
SENSED = st.builds(Sensed, POSE, PAIR, POINTS, st.booleans())
FLAG = st.booleans()
STEP = st.builds(DriveTick, st.just(0.0), SENSED, POSE, PAIR, PAIR, st.just(1.0), FLAG, FLAG, FLAG)
CONFIG = st.sampled_from(
    [
        ROBOT_CONFIGS["husky"],
        within(ROBOT_CONFIGS["husky-jazzy"], "R1"),
        dataclasses.replace(ROBOT_CONFIGS["tradr"], pose="stamped", points_topic=""),
    ]
)


def write(path, bag, config, steps, stamp=SECOND):
    """Write steps as a bag, one each 50 ms."""
    writer = BagWriter(path, bag, "R1", config)
    for k, step in enumerate(steps):
        writer.add(stamp + k * SECOND // 20, step)
    writer.close()
    return path


def still(pose=(0.0, 0.0, 0.0), points=None):
    """A step of a robot that stands."""
    return DriveTick(
        0.0, Sensed(np.array(pose), np.zeros(2), points), np.array(pose), np.zeros(2), np.zeros(2), 1.0, *[False] * 3
    )


def read(path):
    """Stamp in ns and message, by topic, as rosbags reads them."""
    out = {}
    with AnyReader([path]) as reader:
        for connection, stamp, raw in reader.messages():
            out.setdefault(connection.topic, []).append((stamp, reader.deserialize(raw, connection.msgtype)))
    return out


def same(a, b):
    np.testing.assert_array_equal(np.asarray(a, float), np.asarray(b, float))


def speeds(twist):
    return twist.linear.x, twist.angular.z


@pytest.mark.parametrize("bag", BAGS)
@settings(max_examples=20)
@given(config=CONFIG, steps=st.lists(STEP, min_size=1, max_size=4))
def test_what_is_written_is_read_back(bag, config, steps, tmp_path_factory):
    stamps = [SECOND + k * SECOND // 20 for k in range(len(steps))]
    found = read(write(bag_path(tmp_path_factory.mktemp("bag"), "R1", bag), bag, config, steps))
    sent = found[config.command_topic]
    assert [stamp for stamp, _ in sent] == stamps
    for (_, message), step in zip(sent, steps, strict=True):
        same(speeds(message if config.message == "Twist" else message.twist), step.command)
    told = found[config.odometry_topic]
    for (stamp, message), step in zip(told, steps, strict=True):
        assert message.header.stamp.sec * SECOND + message.header.stamp.nanosec == stamp
        assert (message.header.frame_id, message.child_frame_id) == (config.fixed_frame, config.body_frame)
        same(speeds(message.twist.twist), step.sensed.twist)
        placed = message.pose.pose
        same((placed.position.x, placed.position.y), step.sensed.pose[:2])
        np.testing.assert_allclose(heading(placed.orientation), step.sensed.pose[2], atol=1e-15, rtol=1e-14)
    known = [
        (stamp, step.sensed.pose) for stamp, step in zip(stamps, steps, strict=True) if np.isfinite(step.sensed.pose[0])
    ]
    for (stamp, message), (wanted, pose) in zip(found.get("/tf", []), known, strict=True):
        [moved] = message.transforms
        assert (moved.header.frame_id, moved.child_frame_id) == (config.fixed_frame, config.body_frame)
        assert stamp == wanted
        same((moved.transform.translation.x, moved.transform.translation.y), pose[:2])
    seen = [
        (stamp, step.sensed.points) for stamp, step in zip(stamps, steps, strict=True) if step.sensed.points is not None
    ]
    clouds = found.get(config.points_topic, [])
    for (stamp, cloud), (wanted, points) in zip(clouds, seen if config.points_topic else [], strict=True):
        assert (stamp, cloud.header.frame_id) == (wanted, config.body_frame)
        same(read_cloud(cloud)[:, :2], points)
    texts, flags = [], BEGINS
    for stamp, step in zip(stamps, steps, strict=True):
        texts += [(stamp, f"R1 {text}") for text in changes(flags, step.flags)]
        flags = step.flags
    assert [(stamp, message.data) for stamp, message in found.get(EVENTS_TOPIC, [])] == texts
    if config.pose == "stamped":
        for (_, message), step in zip(found[config.pose_topic], steps, strict=True):
            same((message.pose.position.x, message.pose.position.y), step.sensed.pose[:2])
        for (_, message), step in zip(found[config.twist_topic], steps, strict=True):
            same(speeds(message.twist), step.sensed.twist)


def test_flags_that_change_are_told_once():
    flags = [
        (False, False, False, False),
        (True, False, False, False),
        (True, True, False, False),
        (False, True, False, True),
    ]
    told = [changes(before, now) for before, now in zip([BEGINS, *flags], flags, strict=False)]
    assert told == [
        [],
        ["stops: something is in its way"],
        ["is in its error state and stays there"],
        ["goes on", "is at its end"],
    ]


def test_another_library_reads_the_mcap_file(tmp_path):
    points = np.array([[1.5, -2.0], [0.25, 3.0]], np.float32)
    steps = [still((0.1 * k, -1.0, 0.5), points) for k in range(5)]
    path = write(tmp_path / "R1", "mcap", ROBOT_CONFIGS["husky"], steps)
    with (path / "R1.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        found = {}
        for decoded in reader.iter_decoded_messages():
            found.setdefault(decoded.channel.topic, []).append((decoded.message.log_time, decoded.decoded_message))
        assert reader.get_header().profile == "ros2"
    assert set(found) == {"/nav/cmd_vel", "/odometry/filtered", "/tf", "/points_filtered"}
    for k, (stamp, message) in enumerate(found["/odometry/filtered"]):
        assert stamp == SECOND + k * SECOND // 20
        assert message.pose.pose.position.x == 0.1 * k
        assert heading(message.pose.pose.orientation) == pytest.approx(0.5)
    cloud = found["/points_filtered"][0][1]
    assert (cloud.width, cloud.point_step, cloud.row_step) == (2, 12, 24)
    np.testing.assert_array_equal(read_cloud(cloud)[:, :2], points)


@pytest.mark.skipif(shutil.which("rosbag") is None, reason="there is no rosbag of ROS 1 here")
def test_ros_1_itself_reads_its_bag(tmp_path):
    path = write(tmp_path / "R1.bag", "ros1", ROBOT_CONFIGS["husky"], [still()] * 3)
    told = subprocess.run(["rosbag", "info", str(path)], check=False, capture_output=True, text=True, timeout=60)
    assert told.returncode == 0, told.stderr
    for text in ("/nav/cmd_vel", "3 msgs    : geometry_msgs/Twist", "nav_msgs/Odometry", "tf2_msgs/TFMessage"):
        assert text in told.stdout


# ---- bad input -------------------------------------------------------------------------------------------------


def robot(path, config=ROBOT_CONFIGS["husky"], begin=None):
    return RecordedRobot("R1", Path(path), config, begin)


def good_bag(folder, bag="mcap", points=True):
    scan = np.zeros((1, 2), np.float32) if points else None
    return write(bag_path(folder, "R1", bag), bag, ROBOT_CONFIGS["husky"], [still(points=scan)] * 3)


def test_files_that_are_no_bags_are_named(tmp_path):
    simulation = Simulation(World(), HUSKY, [[0, 0, 0]])
    recorder = RunRecorder(simulation)
    recorder.add(simulation.sense(), None)
    foxglove = save_recording(recorder.recording(), tmp_path / "run.mcap")
    (tmp_path / "text.bag").write_text("no bag")
    (tmp_path / "text.mcap").write_text("no bag")
    (tmp_path / "empty.db3").write_text("")
    (tmp_path / "text.txt").write_text("no bag")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "R2.bag").write_text("")
    for name, why in (
        ("none.bag", "missing"), ("text.bag", ""), ("text.mcap", "magic"), ("empty.db3", ""),
        ("text.txt", "Unrecognized"),
        (foxglove.name, "Profile is not ros2"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=rf"{name} cannot be read as a bag of ROS 1 or ROS 2: it is .*\(.*{why}"):
            robot(tmp_path / name)
    with pytest.raises(InputError, match=r"folder with R2\.bag in it, expected one of R1, R1\.bag, R1\.mcap, R1\.db3"):
        robot(tmp_path / "folder")


def test_a_bag_that_was_not_finished_is_named(tmp_path):
    path = good_bag(tmp_path)
    (path / "metadata.yaml").unlink()
    with pytest.raises(InputError, match=r"R1 cannot be read as a bag.*Expected metadata file"):
        robot(tmp_path)
    file = path / "R1.mcap"
    assert robot(file).sense().pose[0] == 0  # the file alone will do
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(InputError, match=r"R1\.mcap cannot be read as a bag"):
        robot(file)


@pytest.mark.parametrize("bag", BAGS)
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"odometry_topic": "/odom"},
            r"R1.*: got no /odom, odometry_topic of R1 \(nav_msgs/msg/Odometry\), expected it among its topics: "
            r".*/nav/cmd_vel \(geometry_msgs/msg/Twist\), /odometry/filtered \(nav_msgs/msg/Odometry\)",
        ),
        ({"points_topic": "/points"}, r"got no /points, points_topic of R1 \(sensor_msgs/msg/PointCloud2\)"),
        (
            {"human_topic": "/tf"},
            r"/tf, human_topic of R1: got tf2_msgs/msg/TFMessage, expected geometry_msgs/msg/Twist or",
        ),
        ({"fixed_frame": "odom"}, r"got no pose of R1 from begin to end.*transforms: map to base_link"),
    ],
)
def test_what_a_bag_lacks_is_named(bag, changes, message, tmp_path):
    good_bag(tmp_path, bag)
    with pytest.raises(InputError, match=message):
        robot(tmp_path, dataclasses.replace(ROBOT_CONFIGS["husky"], **changes))


def test_a_beginning_after_the_end_is_named(tmp_path):
    good_bag(tmp_path)
    with pytest.raises(InputError, match=r"got no pose and no odometry of R1 5 s after its first message"):
        robot(tmp_path, begin=5)


def test_a_bag_without_messages_is_named(tmp_path):
    write(tmp_path / "R1", "mcap", ROBOT_CONFIGS["husky"], [])
    with pytest.raises(InputError, match="R1 has no message for R1"):
        robot(tmp_path)


def test_bags_of_ros_2_humble_do_not_define_their_messages(tmp_path):
    path = good_bag(tmp_path, "ros2")
    with contextlib.closing(sqlite3.connect(path / "R1.db3")) as base:
        base.execute("DELETE FROM message_definitions")
        base.commit()
    assert robot(tmp_path).sense().pose[0] == 0


def test_a_cloud_without_coordinates_is_named(tmp_path):
    path = good_bag(tmp_path, "ros1")
    path.write_bytes(path.read_bytes().replace(b"\x01\x00\x00\x00y", b"\x01\x00\x00\x00q"))
    with pytest.raises(InputError, match=r"R1\.bag: points at 1000000000 ns: cloud: got fields x, q, z"):
        robot(tmp_path)


def test_a_topic_for_points_without_any_is_a_robot_without_lidar(tmp_path):
    good_bag(tmp_path, points=False)
    assert not robot(tmp_path).has_lidar


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A folder with good bags."""
    folder = tmp_path_factory.mktemp("whole")
    good_bag(folder, "ros1")
    good_bag(folder, "mcap")
    return folder


@settings(max_examples=60)
@given(st.sampled_from(["R1.bag", "R1/R1.mcap"]), st.integers(0, 10**6), st.integers(0, 255), st.integers(1, 40))
def test_broken_bags_are_refused_or_read(whole, name, place, byte, many):
    content = bytearray((whole / name).read_bytes())
    place %= len(content)
    content[place : place + many] = bytes([byte]) * many
    path = whole / f"broken{Path(name).suffix}"
    path.write_bytes(content)
    try:
        replayed = robot(path)
        for k in range(5):
            replayed.advance(0.05 * k)
    except InputError as error:
        assert str(path) in str(error)


def test_topics_have_one_name_each():
    for config in ROBOT_CONFIGS.values():
        names = [topic.name for topic in bag_topics(config)]
        assert len(set(names)) == len(names)
        assert all(name.startswith("/") for name in names)


def test_a_reader_gives_topics_with_a_slash_or_without(tmp_path):
    path = write(
        tmp_path / "R1", "mcap", dataclasses.replace(ROBOT_CONFIGS["husky"], odometry_topic="odom"), [still()] * 2
    )
    asked = bag_topics(dataclasses.replace(ROBOT_CONFIGS["husky"], odometry_topic="/odom"))
    reader = BagReader(path, asked, "R1")
    assert reader.counts["odometry_topic"] == 2
    assert [message.stamp for message in reader.messages() if message.field == "odometry_topic"] == [
        SECOND,
        SECOND * 21 // 20,
    ]
    reader.close()
