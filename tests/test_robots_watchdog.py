"""A robot never keeps driving on an old command: planners that stall, are killed, or lose MPI, for real."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from file_publisher import FILE_PUBLISHER

from mp2a import launch
from mp2a.exceptions import DependencyError
from mp2a.robots import watchdog
from mp2a.robots.robot_config import ROBOT_CONFIGS
from mp2a.robots.sender import Sender, WatchdogGoneError

HUSKY = ROBOT_CONFIGS["husky"]
LONG = 20.0

# A planner: starts a watchdog, says both process ids, and drives; what then, by the second argument.
PLANNER = """
import os, sys, time
import signal
from file_publisher import FILE_PUBLISHER
from mp2a.robots.sender import Sender
from mp2a.robots.robot_config import ROBOT_CONFIGS

file, what = sys.argv[1:3]
if what.startswith("mpi"):
    from mpi4py import MPI
    file += str(MPI.COMM_WORLD.rank)
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs come with it ignored
sender = Sender(ROBOT_CONFIGS["husky"], "ros1", FILE_PUBLISHER, file=file)
print(os.getpid(), sender.pid, flush=True)
begin = time.monotonic()
while time.monotonic() < begin + 0.5:
    sender.send(0.7, 0.1)
    time.sleep(0.05)
if what == "mpi":
    if MPI.COMM_WORLD.rank == 1:
        MPI.COMM_WORLD.Abort(7)
    what = "drive"
if what == "mpi-ending":
    from mp2a.robots.launcher import end_with_launcher
    end_with_launcher()
if what in ("drive", "mpi-orphaned", "mpi-ending"):
    while True:
        sender.send(0.7, 0.1)
        time.sleep(0.05)
if what == "stall":
    time.sleep(60)
if what == "raise":
    raise RuntimeError("a bug")
"""


@pytest.fixture(autouse=True)
def its_publisher_is_found(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))


def commands(path):
    """Lines of a file publisher: time, speed, turn rate."""
    return [json.loads(line) for line in Path(path).read_text().splitlines()]


def is_over(pid):
    """Whether a process has ended (one that nobody has waited for yet counts)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


def wait_for(condition, seconds=LONG):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def check_stopped(path, last_alive, patience):
    """The robot was driven, then told zero in time, and nothing else ever after."""
    sent = commands(path)
    moving = [k for k, (_, speed, turn) in enumerate(sent) if (speed, turn) != (0, 0)]
    assert len(moving) >= 5
    assert all(sent[k][1:] == [0.7, 0.1] for k in moving)
    zeros = sent[moving[-1] + 1 :]
    assert len(zeros) >= 5
    assert moving == list(range(len(moving)))
    assert zeros[0][0] < last_alive + patience + 1.0  # a second for a busy machine


@pytest.fixture
def planner(tmp_path):
    """Start planners; whatever is left of them and their watchdogs is killed in the end."""
    started = []

    def start(what):
        process = subprocess.Popen(
            [sys.executable, "-c", PLANNER, str(tmp_path / "sent"), what],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        own, guard = map(int, process.stdout.readline().split())
        started.append((process, guard))
        assert own == process.pid
        return process, guard, tmp_path / "sent"

    yield start
    for process, guard in started:
        process.kill()
        process.wait()
        process.stdout.close()
        if not is_over(guard):
            os.kill(guard, signal.SIGKILL)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGSEGV])
def test_a_killed_planner_leaves_a_robot_that_stands(planner, how):
    process, guard, path = planner("drive")
    wait_for(lambda: len(commands(path)) > 8)
    process.send_signal(how)
    killed = time.monotonic()
    wait_for(lambda: is_over(guard))
    check_stopped(path, killed, 0.0)


def test_a_stalled_planner_is_not_waited_for(planner):
    process, guard, path = planner("stall")
    wait_for(lambda: is_over(guard))
    assert process.poll() is None
    sent = commands(path)
    check_stopped(path, max(when for when, speed, _ in sent if speed), HUSKY.patience)


def test_a_stopped_planner_that_wakes_up_cannot_drive_again(planner):
    process, guard, path = planner("drive")
    wait_for(lambda: len(commands(path)) > 8)
    process.send_signal(signal.SIGSTOP)
    stopped = time.monotonic()
    wait_for(lambda: is_over(guard))
    process.send_signal(signal.SIGCONT)
    assert process.wait(LONG) == 1  # WatchdogGoneError
    check_stopped(path, stopped, HUSKY.patience)


@pytest.mark.parametrize("what", ["raise", "end"])
def test_a_planner_that_ends_without_goodbye(planner, what):
    process, guard, path = planner(what)
    assert process.wait(LONG) == (what == "raise")
    ended = time.monotonic()
    wait_for(lambda: is_over(guard))
    check_stopped(path, ended, 0.0)


def test_a_watchdog_told_to_end_stops_the_robot_first(planner):
    process, guard, path = planner("drive")
    wait_for(lambda: len(commands(path)) > 8)
    os.kill(guard, signal.SIGTERM)
    told = time.monotonic()
    wait_for(lambda: is_over(guard))
    check_stopped(path, told, 0.0)
    assert process.wait(LONG) == 1


def test_a_killed_watchdog_sends_nothing_more_and_the_planner_learns_of_it(planner):
    process, guard, path = planner("drive")
    wait_for(lambda: len(commands(path)) > 8)
    os.kill(guard, signal.SIGKILL)
    wait_for(lambda: is_over(guard))
    assert process.wait(LONG) == 1
    assert all(speed == 0.7 for _, speed, _ in commands(path))


def test_when_mpi_ends_every_robot_is_stopped(tmp_path):
    """One rank aborts; the others are killed by MPI, not their watchdogs."""
    done = launch.run(
        3, [sys.executable, "-c", PLANNER, str(tmp_path / "sent"), "mpi"], timeout=120,
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    ended = time.monotonic()
    assert done.returncode
    guards = [int(line.split()[1]) for line in done.stdout.splitlines() if len(line.split()) == 2]
    assert len(guards) == 3
    wait_for(lambda: all(map(is_over, guards)))
    for rank in range(3):
        check_stopped(tmp_path / f"sent{rank}", ended, HUSKY.patience)


@pytest.mark.parametrize("what", ["mpi-orphaned", "mpi-ending"])
@pytest.mark.parametrize("wrapped", [False, True])
def test_when_mpirun_itself_is_killed_every_robot_is_stopped(what, wrapped, tmp_path):
    """Its ranks go on driving (orphaned), or end with it; a shell between it and the planner changes nothing."""
    program = [sys.executable, "-c", PLANNER, str(tmp_path / "sent"), what]
    if wrapped:
        program = ["sh", "-c", f"{shlex.join(program)}; true"]
    started = launch.mpirun_command(2, program)
    # Not reaped until the end: what is left of a process that nobody waits for must not pass for mpirun.
    mpirun = subprocess.Popen(started.command, env=started.environment, stdout=subprocess.PIPE, text=True)
    lines = [mpirun.stdout.readline().split() for _ in range(2)]
    planners, guards = ([int(line[k]) for line in lines] for k in (0, 1))
    try:
        files = [tmp_path / f"sent{rank}" for rank in range(2)]
        wait_for(lambda: all(file.exists() and len(commands(file)) > 8 for file in files))
        os.kill(mpirun.pid, signal.SIGKILL)
        killed = time.monotonic()
        wait_for(lambda: all(map(is_over, guards)))
        for file in files:
            check_stopped(file, killed, 0.0)
            stopped = next(when for when, *command in commands(file) if command == [0, 0])
            assert stopped - killed < 0.25
        wait_for(lambda: all(map(is_over, planners)))  # of themselves, or since nobody takes their commands
    finally:
        for pid in (*planners, *guards):
            if not is_over(pid):
                os.kill(pid, signal.SIGKILL)
        mpirun.wait(LONG)
        mpirun.stdout.close()


def test_ranks_of_a_killed_mpirun_end_with_it(tmp_path):
    """Robots that exchange no messages while they drive, as real ones do not, notice by nothing else."""
    scenario = tmp_path / "long.txt"
    scenario.write_text("robots R1 R2\nrow R1,R2 0 1.2" + 20 * "\nmove 10000 0")
    program = [
        sys.executable, "-m", "mp2a", "drive", str(scenario), "--quiet", "--longest", "1e6",
        "--record", str(tmp_path / "record"), "--bag", "none",
    ]  # fmt: skip
    started = launch.mpirun_command(2, program)
    mpirun = subprocess.Popen(
        started.command, env=started.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    wait_for(lambda: len(list((tmp_path / "record").glob("R*.csv"))) == 2)
    ranks = children(mpirun.pid)
    assert len(ranks) == 2
    os.kill(mpirun.pid, signal.SIGKILL)
    try:
        wait_for(lambda: all(map(is_over, ranks)))
    finally:
        for pid in ranks:
            if not is_over(pid):
                os.kill(pid, signal.SIGKILL)
        mpirun.wait(LONG)


def children(pid):
    """Processes that a process has started, by any of its threads."""
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return [int(text) for task in tasks for text in (task / "children").read_text().split()]


# ---- while all is well -----------------------------------------------------------------------------------------


def test_commands_are_repeated_at_the_rate_cut_to_the_limits_and_end_with_zeros(tmp_path):
    sender = Sender(HUSKY, "ros1", FILE_PUBLISHER, file=str(tmp_path / "sent"))
    for speed in (0.3, 5.0):
        for _ in range(8):
            sender.send(speed, -9.0)
            time.sleep(0.1)
    sender.close()
    sent = commands(tmp_path / "sent")
    assert {tuple(row[1:]) for row in sent} == {(0.3, -2.0), (1.0, -2.0), (0.0, 0.0)}
    assert sent[-1][1:] == [0, 0]
    # Ten commands a second came in; twice as many went out, evenly.
    driven = [row[0] for row in sent if row[1]]
    assert len(driven) > 1.5 * 16
    with pytest.raises(WatchdogGoneError, match="takes no more commands"):
        for _ in range(3):
            sender.send(0.1, 0.0)


def test_nothing_is_sent_before_the_first_command(tmp_path):
    sender = Sender(HUSKY, "ros1", FILE_PUBLISHER, file=str(tmp_path / "sent"))
    time.sleep(HUSKY.patience + 0.2)
    assert commands(tmp_path / "sent") == []
    sender.send(0.2, 0.0)
    wait_for(lambda: commands(tmp_path / "sent"))
    sender.close()


def test_while_a_human_drives_nothing_is_sent(tmp_path):
    file = tmp_path / "sent"
    sender = Sender(HUSKY, "ros1", FILE_PUBLISHER, file=str(file))

    def drive(seconds):
        for _ in range(round(seconds / 0.05)):
            sender.send(0.4, 0.0)
            time.sleep(0.05)

    drive(0.3)
    human = Path(f"{file}.human")
    human.touch()
    drive(0.1)
    before = len(commands(file))
    drive(0.3)
    assert len(commands(file)) == before > 0
    human.unlink()
    drive(0.3)
    assert len(commands(file)) > before
    sender.close()


def test_a_watchdog_that_cannot_reach_its_robot_says_why(monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    with pytest.raises(DependencyError, match=r"no watchdog: .*ROS"):
        Sender(replace(HUSKY, rate=10), "ros1", role="R1")


def test_a_command_is_two_doubles():
    assert watchdog.COMMAND.size == 16
