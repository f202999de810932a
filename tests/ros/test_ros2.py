"""Commands over DDS to a real node of ROS 2, which has an environment of its own (.venv-ros2)."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from mp2a.formation.choreography.ideal import run
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.robot_models import HUSKY

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


def ros2_is_there():
    if not PYTHON.exists():
        return False
    return (
        subprocess.run([str(PYTHON), "-c", "import rclpy, geometry_msgs"], capture_output=True, check=False).returncode
        == 0
    )


@pytest.fixture
def node(tmp_path):
    """Start the robot as a node of ROS 2."""
    pytest.importorskip("cyclonedds", reason="no cyclonedds: pip install 'mp2a[ros2]'")
    if not ros2_is_there():
        pytest.skip(f"no rclpy at {PYTHON}: make test-ros installs it")
    started = []

    def start(kind):
        log = tmp_path / "log.json"
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | THEIRS
        process = subprocess.Popen(
            [str(PYTHON), str(Path(__file__).with_name("rclpy_robot.py")), str(log), kind, "2"], env=environment
        )
        started.append(process)
        deadline = time.monotonic() + 30
        while not log.with_suffix(".ready").exists():
            assert process.poll() is None and time.monotonic() < deadline, "the node did not start"
            time.sleep(0.05)
        return process, log

    yield start
    for process in started:
        process.kill()
        process.wait()


@pytest.mark.parametrize("message", ["Twist", "TwistStamped"])
def test_a_node_of_ros_2_is_driven_by_where_it_says_it_is(node, tmp_path, metronome, message):
    process, log = node(message)
    (tmp_path / "scenario.txt").write_text(SCENARIO)
    (tmp_path / "robots.toml").write_text(
        f'adapter = "ros2"\n[robots.R1]\nmodel = "husky"\npose = "stamped"\npoints_topic = ""\nmessage = "{message}"\n'
    )
    program = [
        sys.executable, "-m", "mp2a", "drive", str(tmp_path / "scenario.txt"), "--robots",
        str(tmp_path / "robots.toml"), "--armed", "--quiet", "--record", str(tmp_path),
    ]  # fmt: skip
    done = subprocess.run(
        program,
        env=os.environ | OURS,
        timeout=90,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    metronome.check()
    assert done.returncode == 0, done.stdout
    process.wait(30)
    seen = json.loads(log.read_text())
    gaps = np.diff([row[0] for row in seen["arrivals"]])
    print(f"{len(gaps)} gaps: median {np.median(gaps):.4f} s, 99th percentile {np.percentile(gaps, 99):.4f} s")
    assert np.percentile(gaps, 99) <= 0.1
    assert seen["arrivals"][-1][1:] == [0.0, 0.0]
    x, y, heading = seen["track"][-1][1:]
    print(f"ended at ({x:.2f}, {y:.2f}) m, heading {np.rad2deg(heading):.0f}°")
    # Its own frame begins where it stands, half a metre behind the leader.
    ideal = run(Choreography(parse(SCENARIO), HUSKY)).poses[-1, 0]
    assert (x - 0.5, y, heading) == pytest.approx(tuple(ideal), abs=0.3)
    assert (tmp_path / "R1.csv").read_text().splitlines()[0].startswith("time,x,y,heading")
