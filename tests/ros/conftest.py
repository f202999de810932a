"""A ROS master of our own, robots in a physics engine, and where they are looked for."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def free_port():
    with contextlib.closing(socket.socket()) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@pytest.fixture(scope="session")
def master(tmp_path_factory):
    """Environment with a ROS master in it."""
    pytest.importorskip("rospy", reason="no rospy: apt-get install ros-core and the packages that docs/robots.md names")
    import rosgraph

    port = free_port()
    values = {
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1",
        "ROS_LOG_DIR": str(tmp_path_factory.mktemp("ros")),
    }  # fmt: skip
    os.environ.update(values)
    process = subprocess.Popen(
        ["rosmaster", "--core", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    deadline = time.monotonic() + 20
    while not rosgraph.is_master_online():
        assert time.monotonic() < deadline, "no ROS master"
        time.sleep(0.05)
    yield values
    process.terminate()
    process.wait(20)


class Huskies:
    """Robots in the physics engine, in a process."""

    def __init__(self, log, places, wall):
        self._log = log
        arguments = [str(log), json.dumps(places), *([] if wall is None else [str(wall)])]
        self._process = subprocess.Popen(
            [sys.executable, str(HERE / "husky_nodes.py"), *arguments], stdout=subprocess.DEVNULL
        )
        deadline = time.monotonic() + 30
        while not log.with_suffix(".ready").exists():
            assert self._process.poll() is None, "the robots did not start"
            assert time.monotonic() < deadline, "the robots are not ready"
            time.sleep(0.05)

    def end(self):
        """End them; returns what arrived and the true track by role, and how far behind real time it was."""
        self._process.send_signal(signal.SIGTERM)
        self._process.wait(30)
        found = json.loads(self._log.read_text())
        return found["seen"], found["behind"]

    def kill(self):
        self._process.kill()
        self._process.wait()


@pytest.fixture
def huskies(master, tmp_path):
    """Start robots at places by role, and a wall across x = ``wall``."""
    pytest.importorskip("pybullet", reason="no physics engine: pip install pybullet")
    started = []

    def start(places, wall=None):
        started.append(Huskies(tmp_path / "log.json", places, wall))
        return started[-1]

    yield start
    for one in started:
        one.kill()
