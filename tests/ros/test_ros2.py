"""Robots that are real nodes of ROS 2, in an environment of its own (.venv-ros2), driven over DDS."""

import itertools
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.robot_models import HUSKY
from mp2a.robots import sound
from mp2a.robots.ticks import COLUMNS
from mp2a.simulator.scenario_run import run

pytestmark = pytest.mark.ros
ROOT = Path(__file__).parents[2]
PYTHON = Path(os.environ.get("MP2A_ROS2_PYTHON", ROOT / ".venv-ros2" / "bin" / "python"))
# Loopback only, without multicast, which containers often lack.
LOOPBACK = (
    '<CycloneDDS><Domain><General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>'
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex><Peers>"
    '<Peer address="127.0.0.1"/></Peers><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex></Discovery></Domain>'
    "</CycloneDDS>"
)
OURS = {"CYCLONEDDS_URI": LOOPBACK, "ROS_DOMAIN_ID": "42"}
THEIRS = {"ROS_DOMAIN_ID": "42", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
SCENARIO = "robots R1\nrow R1 0 0\nmove 2 0\nmove 2 60\n"
AHEAD = "robots R1\nrow R1 0 0\nmove 4 0\n"
TOGETHER = "robots R1 R2\nrow R1,R2 0 1.2\nmove 1 0\n"
WALL = 3.0
"""m ahead of where the robot begins."""


TWO_NODES = "from mp2a.robots.ros2.node import Ros2Node; nodes = Ros2Node('a'), Ros2Node('b')"


def has(*packages):
    """Whether the environment of ROS 2 has packages."""
    if not PYTHON.exists():
        return False
    done = subprocess.run([str(PYTHON), "-c", f"import {', '.join(packages)}"], capture_output=True, check=False)
    return done.returncode == 0


class Node:
    """A robot in a process."""

    def __init__(self, log, settings, namespace, metronome):
        self._log, self._metronome = log, metronome
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | THEIRS
        program = [PYTHON, Path(__file__).with_name("rclpy_robot.py"), log, json.dumps(settings)]
        self.process = subprocess.Popen(
            [*map(str, program), "--ros-args", "-r", f"__ns:=/{namespace}"], env=environment
        )
        deadline = time.monotonic() + 60
        while not log.with_suffix(".ready").exists():
            assert self.process.poll() is None and time.monotonic() < deadline, "the node did not start"
            time.sleep(0.05)

    def end(self):
        """Wait until it gets no commands any more; returns what it has seen, as arrays where it is numbers.

        Raises TooBusy if this machine did not keep real time.
        """
        assert self.process.wait(30) == 0
        self._metronome.check()
        seen = json.loads(self._log.read_text())
        return seen | {name: np.array(seen[name]) for name in ("arrivals", "track", "human")}


@pytest.fixture
def node(tmp_path, metronome):
    """Start a robot as a node of ROS 2."""
    pytest.importorskip("cyclonedds", reason="no cyclonedds: pip install 'mp2a[ros2]'")
    if not has("rclpy", "nav_msgs", "sensor_msgs", "std_msgs"):
        pytest.skip(f"no rclpy and its messages at {PYTHON}: make test-ros installs them")
    started = []

    def start(namespace="", **settings):
        defaults = {
            "message": "Twist", "tells": "odometry", "wall": None, "lidar": "base_link", "blind_after": None,
            "human": None, "channel": False,
        }  # fmt: skip
        started.append(Node(tmp_path / f"log{namespace}.json", defaults | settings, namespace, metronome))
        return started[-1]

    yield start
    for one in started:
        one.process.kill()
        one.process.wait()


@pytest.fixture
def built():
    """Skip where the messages that come in no wheel are missing."""
    if not has("tf2_msgs", "sound_play_msgs"):
        pytest.skip(f"no tf2_msgs and sound_play_msgs at {PYTHON}: make test-ros builds them if there is a compiler")


def begin(tmp_path, scenario, *more, roles=("R1",), **fields):
    """Begin to drive; returns the process."""
    (tmp_path / "scenario.txt").write_text(scenario)
    text = 'adapter = "ros2"\n[all]\nmodel = "husky"\n'
    text += "".join(f"{name} = {json.dumps(value)}\n" for name, value in fields.items())
    text += "".join(f"[robots.{role}]\n" + f'namespace = "{role}"\n' * (len(roles) > 1) for role in roles)
    (tmp_path / "robots.toml").write_text(text)
    program = [
        sys.executable, "-m", "mp2a", "drive", str(tmp_path / "scenario.txt"), "--robots",
        str(tmp_path / "robots.toml"), "--armed", "--quiet", "--record", str(tmp_path), *more,
    ]  # fmt: skip
    return subprocess.Popen(program, env=os.environ | OURS, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def finish(process):
    """Wait for a drive; returns its exit status and what it said."""
    try:
        said, _ = process.communicate(timeout=90)
    except subprocess.TimeoutExpired:
        process.kill()
        said, _ = process.communicate()
    return process.returncode, said


@pytest.fixture(scope="module")
def gaps():
    """Times between commands of all drives, s."""
    return []


def check_rate(arrivals, gaps):
    """Commands come at 20 Hz; how evenly is looked at in all of them together."""
    new = np.diff(arrivals[:, 0])
    print(f"{len(new)} gaps: median {np.median(new):.4f} s, 99th percentile {np.percentile(new, 99):.4f} s")
    assert np.median(new) == pytest.approx(0.05, abs=0.002)
    gaps.extend(new)


def check_end(seen, scenario):
    """It stands where an ideal robot does."""
    x, y, heading = seen["track"][-1, 1:]
    print(f"ended at ({x:.2f}, {y:.2f}) m, heading {np.rad2deg(heading):.0f}°")
    np.testing.assert_array_equal(seen["arrivals"][-1, 1:], 0.0)
    # Its own frame begins where it stands, half a metre behind the leader.
    ideal = run(Choreography(parse(scenario), HUSKY)).poses[-1, 0]
    assert (x - 0.5, y, heading) == pytest.approx(tuple(ideal), abs=0.3)


@pytest.mark.parametrize(
    ("message", "tells"), [("Twist", "odometry"), ("TwistStamped", "odometry"), ("TwistStamped", "stamped")]
)
def test_a_node_of_ros_2_is_driven_by_where_it_says_it_is(node, gaps, tmp_path, message, tells):
    robot = node(message=message, tells=tells)
    status, said = finish(begin(tmp_path, SCENARIO, message=message, pose=tells, points_topic=""))
    assert status == 0, said
    seen = robot.end()
    check_rate(seen["arrivals"], gaps)
    check_end(seen, SCENARIO)
    assert (tmp_path / "R1.csv").read_text().splitlines()[0].startswith("time,x,y,heading")


def test_a_pose_is_put_together_of_transforms(node, gaps, built, tmp_path):
    robot = node(tells="tf")
    status, said = finish(begin(tmp_path, SCENARIO, pose="tf", points_topic=""))
    assert status == 0, said
    seen = robot.end()
    check_rate(seen["arrivals"], gaps)
    check_end(seen, SCENARIO)


def stops_before_the_wall(node, gaps, tmp_path, **settings):
    robot = node(wall=WALL, **settings)
    status, said = finish(begin(tmp_path, AHEAD, pose="odometry"))
    assert status == 3, said
    assert "blocked by something in front of it" in said
    seen = robot.end()
    check_rate(seen["arrivals"], gaps)
    gap = WALL - seen["track"][:, 1].max() - HUSKY.length / 2
    print(f"stands {gap:.2f} m before the wall")
    assert 0.05 < gap < 0.56
    np.testing.assert_array_equal(seen["arrivals"][-10:, 1], 0.0)
    with (tmp_path / "R1.csv").open() as file:
        rows = [dict(zip(COLUMNS, line.split(","), strict=True)) for line in itertools.islice(file, 1, None)]
    assert not any(int(row["error"]) for row in rows)
    return seen


def test_a_robot_stops_before_a_wall(node, gaps, tmp_path):
    stops_before_the_wall(node, gaps, tmp_path)


def test_a_robot_stops_before_a_wall_that_its_sensor_sees_askew_and_says_so(node, gaps, built, tmp_path):
    """Points in the sensor's own frame, which a kept transform places on the body."""
    seen = stops_before_the_wall(node, gaps, tmp_path, lidar="lidar")
    number, command = sound.sound_numbers(sound.TEXT)
    assert seen["sounds"][0] == [number, command, 1.0, sound.TEXT]
    assert {tuple(one[:2]) for one in seen["sounds"]} <= {(number, command), sound.sound_numbers(None)}


def test_a_robot_that_sees_no_points_any_more_stands_for_good(node, gaps, tmp_path):
    robot = node(wall=20.0, blind_after=1.5)
    status, said = finish(begin(tmp_path, AHEAD, pose="odometry"))
    assert status == 3, said
    arrivals = robot.end()["arrivals"]
    check_rate(arrivals, gaps)
    moving = np.flatnonzero(arrivals[:, 1])
    stopped = arrivals[moving[-1], 0] - arrivals[0, 0] - 1.5
    print(f"drove on for {stopped:.2f} s")
    assert np.abs(arrivals[:, 1]).max() > 0.2
    assert 0.1 < stopped < 1.0
    assert len(arrivals) - moving[-1] > 5


def test_a_human_wins(node, gaps, tmp_path):
    robot = node(human=(1.5, 3.0))
    status, said = finish(begin(tmp_path, SCENARIO, pose="odometry", points_topic=""))
    assert status == 0, said
    seen = robot.end()
    came, human = seen["arrivals"][:, 0], seen["human"]
    check_rate(seen["arrivals"][came < human[0]], gaps)
    pause = human[-1] + 0.5
    print(f"the first {np.min(came[came > human[-1]]) - human[-1]:.2f} s after the human's last")
    assert not ((came > human[0] + 0.4) & (came < pause - 0.01)).any()
    assert (came > pause).sum() > 20
    check_end(seen, SCENARIO)


def test_two_robots_agree_over_topics_when_to_start(node, gaps, tmp_path):
    roles = ("R1", "R2")
    robots = [node(namespace=role, channel=True) for role in roles]
    processes = []
    for role in roles:
        processes.append(begin(tmp_path, TOGETHER, "--role", role, roles=roles, pose="odometry", points_topic=""))
        time.sleep(1.0)
    for process in processes:
        status, said = finish(process)
        assert status == 0, said
    seen = [robot.end() for robot in robots]
    for one in seen:
        check_rate(one["arrivals"], gaps)
        assert one["ready"] == [True]
        assert {"test R1", "test R2", "test R1 R2", "test R2 R1"} <= set(one["sync"])
    proposals = {text for one in seen for text in one["sync"] if text.startswith("sync")}
    assert {text.split()[1] for text in proposals} == set(roles) and len(proposals) == 2
    moved = [one["arrivals"][np.flatnonzero(one["arrivals"][:, 1])[0], 0] for one in seen]
    print(f"began {abs(moved[0] - moved[1]):.3f} s apart")
    assert abs(moved[0] - moved[1]) < 0.3


def test_commands_of_all_drives_came_at_10_hz_at_least(gaps):
    """The rate below which robots ignore commands; at the 99th percentile, of the drives above."""
    if not gaps:
        pytest.skip("nothing was driven")
    print(f"{len(gaps)} gaps: 99th percentile {np.percentile(gaps, 99):.4f} s, longest {max(gaps):.4f} s")
    assert np.percentile(gaps, 99) <= 0.1


@pytest.mark.parametrize(
    "settings", [{}, {"CYCLONEDDS_URI": "<CycloneDDS><Foo/></CycloneDDS>"}, {"ROS_DOMAIN_ID": "900"}]
)
def test_settings_that_do_not_work_are_named(settings):
    pytest.importorskip("cyclonedds", reason="no cyclonedds: pip install 'mp2a[ros2]'")
    done = subprocess.run(
        [sys.executable, "-c", TWO_NODES], env=os.environ | OURS | settings, capture_output=True, text=True, check=False
    )
    assert bool(done.returncode) == bool(settings), done.stderr
    assert all(name in done.stderr.splitlines()[-1] for name in settings)


@pytest.mark.parametrize(
    ("given", "expected"),
    [("", "1.15"), ("<Compatibility><IgnoreTypeInformation>1.1</IgnoreTypeInformation></Compatibility>", "1.1")],
)
def test_settings_of_the_user_win_over_ours(tmp_path, given, expected):
    pytest.importorskip("cyclonedds", reason="no cyclonedds: pip install 'mp2a[ros2]'")
    trace = f"<Tracing><Verbosity>config</Verbosity><OutputFile>{tmp_path / 'trace'}</OutputFile></Tracing>"
    uri = f"<CycloneDDS><Domain>{given}{trace}</Domain></CycloneDDS>"
    subprocess.run([sys.executable, "-c", TWO_NODES], env=os.environ | OURS | {"CYCLONEDDS_URI": uri}, check=True)
    said = (tmp_path / "trace").read_text()
    assert re.search(r"IgnoreTypeInformation/#text: (\S+)", said)[1] == expected
    assert "SocketReceiveBufferSize[@max]: 8 MiB" in said
