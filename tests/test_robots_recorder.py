"""The process that writes records: planners that are killed leave whole files, and a slow disk stops no robot."""

import functools
import importlib
import os
import resource
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import numpy as np
import pytest
from ideal_robot import IdealRobot
from rosbags.highlevel import AnyReader

from mp2a import launch
from mp2a.cli import drive, main
from mp2a.exceptions import DependencyError, InputError, OutputError
from mp2a.robots import drive_setup
from mp2a.robots.adapters import ADAPTERS, REAL, Adapter, AdapterResult
from mp2a.robots.interface import Sensed
from mp2a.robots.records.bag_writer import BAGS
from mp2a.robots.records.recorder import NO_BAG, DriveRecorder, RecordConfig
from mp2a.robots.robot_config import ROBOT_CONFIGS
from mp2a.robots.start import Start
from mp2a.robots.ticks import DriveTick
from mp2a.robots.topics import EVENTS_TOPIC

SCENARIO = str(Path(__file__).parents[1] / "examples" / "scenarios" / "listing_7_1.txt")
HUSKY = ROBOT_CONFIGS["husky"]
SECOND = 1_000_000_000
LONG = 30.0

# A planner: records 50 steps of two robots, says so, and goes on as its argument says.
PLANNER = """
import os, signal, sys, time
from pathlib import Path
sys.path.insert(0, str(Path(sys.argv[3])))
from test_robots_recorder import HUSKY, SECOND, step
from mp2a.robots.records.recorder import DriveRecorder, RecordConfig

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs come with it ignored
roles = ["R1", "R2"]
if sys.argv[4] == "mpi":
    from mpi4py import MPI
    roles = [roles[MPI.COMM_WORLD.rank]]
config = RecordConfig(Path(sys.argv[1]), sys.argv[2], dict.fromkeys(roles, HUSKY), "starts")
recorder = DriveRecorder(config, wait=False)
for k in range(50):
    for role in roles:
        recorder.add(role, (k + 1) * SECOND, step(k))
print("there", flush=True)
if sys.argv[4] == "mpi":
    MPI.COMM_WORLD.barrier()
    if MPI.COMM_WORLD.rank == 1:
        MPI.COMM_WORLD.Abort(7)
if sys.argv[4] == "raise":
    raise RuntimeError("a bug")
time.sleep(60)
"""


def step(k, points=10):
    scan = np.full((points, 2), k, np.float32)
    sensed = Sensed(np.array([k, 0.0, 0.0]), np.zeros(2), scan)
    return DriveTick(float(k), sensed, sensed.pose, np.zeros(2), np.array([0.5, 0.1]), 1.0, False, False, False)


def orders(folder, bag="mcap", roles=("R1",)):
    return RecordConfig(Path(folder), bag, dict.fromkeys(roles, HUSKY), "starts")


def count(path):
    """Numbers of messages by topic."""
    with AnyReader([Path(path)]) as reader:
        return {name: topic.msgcount for name, topic in reader.topics.items()}


def wait_for(what):
    """Wait until something is true; fails if it takes too long."""
    deadline = time.monotonic() + LONG
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.parametrize("how", ["SIGKILL", "SIGTERM", "SIGINT", "SIGHUP", "raise"])
def test_a_planner_that_is_killed_leaves_whole_files(how, tmp_path):
    program = planner_program(tmp_path, how)
    planner = subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True)
    assert planner.stdout.readline() == b"there\n"
    if how != "raise":
        os.killpg(planner.pid, signal.Signals[how])  # its whole group, as a terminal and mpirun do
    planner.wait(LONG)
    assert_whole(tmp_path)


def test_planners_that_mpi_ends_leave_whole_files(tmp_path):
    done = launch.run(2, planner_program(tmp_path, "mpi"), timeout=60, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode
    assert_whole(tmp_path)


def planner_program(folder, how):
    return [sys.executable, "-c", PLANNER, str(folder / "out"), "mcap", str(Path(__file__).parent), how]


def assert_whole(folder):
    for role in ("R1", "R2"):
        bag = folder / "out" / role
        wait_for((bag / "metadata.yaml").exists)
        found = count(bag)
        assert (found[EVENTS_TOPIC], found["/nav/cmd_vel"], found["/points_filtered"]) == (1, 50, 50)
        assert len((folder / "out" / f"{role}.csv").read_text().splitlines()) == 51


def test_a_writer_that_stalls_stops_nobody_and_loses_nothing(tmp_path):
    recorder = DriveRecorder(orders(tmp_path), wait=False)
    os.kill(recorder.pid, signal.SIGSTOP)
    for k in range(100):  # 16 MB, far more than a pipe holds: it would hang here
        recorder.add("R1", (k + 1) * SECOND, step(k, 20_000))
    os.kill(recorder.pid, signal.SIGCONT)
    assert recorder.close() == ""
    assert count(tmp_path / "R1")["/points_filtered"] == 100


def test_a_writer_that_is_killed_stops_nobody_and_is_told(tmp_path):
    recorder = DriveRecorder(orders(tmp_path), wait=True)
    os.kill(recorder.pid, signal.SIGKILL)
    for k in range(100):
        recorder.add("R1", (k + 1) * SECOND, step(k, 20_000))
    assert recorder.close() == "the process that writes ended with status -9"


def test_what_the_disk_says_is_told(tmp_path):
    recorder = DriveRecorder(orders(tmp_path), wait=True)
    (tmp_path / "R1.csv").mkdir()  # somebody was quicker
    recorder.add("R1", SECOND, step(0))
    assert recorder.close() == f"{tmp_path / 'R1.csv'}: cannot be written (File exists)"


@pytest.mark.parametrize("bag", BAGS)
def test_a_disk_that_is_full_stops_nobody_and_is_told(bag, tmp_path):
    recorder = DriveRecorder(orders(tmp_path, bag), wait=True)
    resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE, (4096, 4096))
    for k in range(100):
        recorder.add("R1", (k + 1) * SECOND, step(k, 20_000))
    why = "disk I/O error" if bag == "ros2" else "File too large"
    assert recorder.close() == f"{tmp_path}: cannot be written ({why})"


def test_a_record_that_is_lost_ends_the_command_with_2_but_drives(tmp_path, monkeypatch, capsys):
    add = DriveRecorder.add

    def kill_then_add(self, role, stamp, step):
        if step.time > 1:
            os.kill(self.pid, signal.SIGKILL)
        add(self, role, stamp, step)

    monkeypatch.setattr(DriveRecorder, "add", kill_then_add)
    assert main(["drive", SCENARIO, "--record", str(tmp_path / "r")]) == 2
    said = capsys.readouterr()
    assert said.out.count("would be sent  done") == 4
    assert "--record: the process that writes ended with status -9" in said.err


def test_records_are_not_overwritten(tmp_path):
    for bag in ("none", "ros1", "mcap"):
        recorder = DriveRecorder(orders(tmp_path / bag, bag), wait=True)
        recorder.add("R1", SECOND, step(0))
        assert recorder.close() == ""
        name = "R1.csv"
        for again in ("none", "ros1", "ros2"):
            with pytest.raises(InputError, match=rf"{name} is there already, expected a folder without a record of R1"):
                DriveRecorder(orders(tmp_path / bag, again), wait=True)
        (tmp_path / bag / name).unlink()
    with pytest.raises(InputError, match=r"R1\.bag is there already"):
        DriveRecorder(orders(tmp_path / "ros1"), wait=True)
    assert DriveRecorder(orders(tmp_path / "ros1", roles=["R2"]), wait=True).close() == ""


def test_links_are_not_written_through_nor_replaced(tmp_path):
    (tmp_path / "R1.csv").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match=r"R1\.csv is there already"):
        DriveRecorder(orders(tmp_path), wait=True)
    assert not (tmp_path / "elsewhere").exists()


@pytest.mark.parametrize(("what", "kind"), [("/dev/null", "empty"), ("run.npz", "a zip archive, as numpy's .npz are")])
def test_what_is_no_folder_is_named_and_stays(what, kind, tmp_path, capsys):
    path = tmp_path / what  # the device itself, if it is one
    if not path.exists():
        np.savez(path, a=1)
    before = path.stat()
    assert main(["drive", SCENARIO, "--quiet", "--record", str(path)]) == 2
    assert f"--record: {path} cannot be made a folder (File exists)" in capsys.readouterr().err
    assert path.stat() == before
    assert main(["drive", SCENARIO, "--quiet", "--recording", str(path)]) == 2
    assert f"recording: {path} cannot be read as a bag of ROS 1 or ROS 2: it is {kind} (" in capsys.readouterr().err


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"--record: .*file/x cannot be made a folder"):
        DriveRecorder(orders(tmp_path / "file" / "x"), wait=True)


def test_without_rosbags_the_error_says_how_to_get_it(tmp_path, monkeypatch):
    (tmp_path / "rosbags").mkdir()
    (tmp_path / "rosbags" / "__init__.py").write_text("raise ImportError('no rosbags')")
    path = os.environ.get("PYTHONPATH")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *([path] if path else [])]))
    with pytest.raises(DependencyError, match=r"without one: --bag none.*pip install 'mp2a\[record\]'"):
        DriveRecorder(orders(tmp_path / "out"), wait=True)
    assert DriveRecorder(orders(tmp_path / "out", "none"), wait=True).close() == ""


class InRealTime(IdealRobot):
    """An ideal robot that drives by the clock."""

    first = None

    def sense(self):
        now = time.monotonic()
        if self.first is None:
            self.first = now
        self.advance(now - self.first)
        return super().sense()


def test_where_time_is_real_records_have_the_real_time(tmp_path, monkeypatch, capsys):
    module = types.ModuleType("in_real_time")
    module.make = lambda config: AdapterResult([InRealTime(HUSKY.model, config.places[0])], channel=Alone)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(ADAPTERS, "ros1", Adapter(module.__name__, real=True))
    monkeypatch.setattr(drive_setup, "Start", functools.partial(Start, lead=0.5))
    scenario = tmp_path / "one.txt"
    scenario.write_text("robots R1\nrow R1 0 0\nmove 1 0")
    before = time.time_ns()
    assert main(["drive", str(scenario), "--adapter", "ros1", "--record", str(tmp_path / "r"), "--bag", "ros1"]) == 0
    with AnyReader([tmp_path / "r" / "R1.bag"]) as reader:
        found = [(c.topic, stamp, reader.deserialize(raw, c.msgtype)) for c, stamp, raw in reader.messages()]
    stamps = [stamp for topic, stamp, _ in found if topic == "/nav/cmd_vel"]
    assert before < stamps[0] < stamps[-1] < time.time_ns()
    assert len(stamps) > 10
    texts = [message.data for topic, _, message in found if topic == EVENTS_TOPIC]
    assert texts == ["R1 starts, adapter ros1, not armed: commands are not sent", "R1 is at its end"]
    assert main(["drive", str(scenario), "--recording", str(tmp_path / "r"), "--quiet"]) == 0
    assert "largest difference" in capsys.readouterr().out


class Alone:
    """A channel to nobody."""

    def publish(self, text):
        pass

    def receive(self):
        return []

    def announce(self, ready):
        pass


# ---- processes load what they run ------------------------------------------------------------------------------


def loaded_by(statement):
    code = f"import sys\n{statement}\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    return set(done.stdout.split())


def test_a_planner_loads_its_adapter_alone():
    recorded = "mp2a.robots.records.recorded"
    everything = {"rosbags", "shapely", "cyclonedds", "rospy", recorded, "mp2a.simulator.simulation"}
    assert not loaded_by("import mp2a.robots.drive_setup, mp2a.robots.records.recorder") & everything
    assert loaded_by("import mp2a.robots.simulated") & everything == {"mp2a.simulator.simulation"}
    assert loaded_by("import mp2a.robots.records.recorded") & everything == {recorded}
    assert not loaded_by("import mp2a.robots.ros_robot") & everything


def test_the_table_of_adapters_names_modules_that_are_there():
    for adapter in ADAPTERS.values():
        assert callable(importlib.import_module(adapter.module).make)
    assert REAL == ("ros1", "ros2")


def test_the_command_knows_every_bag():
    assert (*BAGS, NO_BAG) == drive._BAGS


# ---- under mpirun ----------------------------------------------------------------------------------------------


def test_each_rank_writes_and_reads_the_record_of_its_robot(tmp_path):
    """The same to the byte as that of one process; and each rank's robot drives its own again."""
    options = ["drive", SCENARIO, "--quiet", "--record"]
    assert main([*options, str(tmp_path / "one"), "--adapter", "simulator"]) == 0
    for more in (["two", "--adapter", "simulator"], ["three", "--recording", str(tmp_path / "two")]):
        program = [sys.executable, "-m", "mp2a", *options, str(tmp_path / more[0]), *more[1:]]
        done = launch.run(2, program, timeout=120, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert done.returncode == 0, done.stdout
    assert "R1       largest difference" in done.stdout and "R2       largest difference" in done.stdout
    for file in ("R1.csv", "R1/R1.mcap", "R2.csv", "R2/R2.mcap", "R2/metadata.yaml"):
        one, two = ((tmp_path / name / file).read_bytes() for name in ("one", "two"))
        assert one == two
    for role in ("R1", "R2"):
        assert count(tmp_path / "three" / role)["/nav/cmd_vel"] == count(tmp_path / "two" / role)["/nav/cmd_vel"]
