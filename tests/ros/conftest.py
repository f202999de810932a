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
from real_time import Metronome

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def pytest_collection_modifyitems(config, items):
    """What the machine was too busy for is repeated, at most twice (if pytest-rerunfailures is there)."""
    if config.pluginmanager.hasplugin("rerunfailures"):
        for item in items:
            if item.get_closest_marker("ros"):
                item.add_marker(pytest.mark.flaky(reruns=2, only_rerun="TooBusy"))


def free_port():
    with contextlib.closing(socket.socket()) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@pytest.fixture(scope="session")
def master(tmp_path_factory):
    """Environment with a ROS master in it."""
    missing = "no ROS 1: apt-get install ros-core and the packages that docs/robots.md names"
    for name in ("rospy", "geometry_msgs.msg", "sensor_msgs.msg", "nav_msgs.msg", "tf2_msgs.msg"):
        pytest.importorskip(name, reason=missing, exc_type=ImportError)
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


@pytest.fixture
def metronome(tmp_path):
    """Tells in the end whether the machine kept real time."""
    process = Metronome(tmp_path / "late.json")
    yield process
    process.kill()


class Huskies:
    """Robots in the physics engine, in a process."""

    def __init__(self, log, places, wall, metronome):
        self._log, self._metronome = log, metronome
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
        """End them; returns what arrived and the true track by role. Raises TooBusy if time was not real."""
        self._process.send_signal(signal.SIGTERM)
        self._process.wait(30)
        found = json.loads(self._log.read_text())
        print(f"physics at most {found['behind']:.3f} s behind real time")
        self._metronome.check(found["behind"])
        return found["seen"]

    def kill(self):
        self._process.kill()
        self._process.wait()


@pytest.fixture
def huskies(master, tmp_path, metronome):
    """Start robots at places by role, and a wall across x = ``wall``."""
    pytest.importorskip("pybullet", reason="no physics engine: pip install pybullet")
    started = []

    def start(places, wall=None):
        started.append(Huskies(tmp_path / "log.json", places, wall, metronome))
        return started[-1]

    yield start
    for one in started:
        one.kill()
