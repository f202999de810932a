"""Robots drive scenarios behind the interface of real ones: ideal, simulated, failing."""

import csv
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from file_publisher import FILE_PUBLISHER
from hypothesis import given
from hypothesis import strategies as st
from ideal_robot import IdealRobot

from mp2a import launch
from mp2a.cli import main
from mp2a.exceptions import InputError
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.outcome import exit_status
from mp2a.formation.robot_models import HUSKY
from mp2a.robots import drive_setup, robots_file, sound
from mp2a.robots import simulated as simulated_module
from mp2a.robots.adapters import AdapterResult
from mp2a.robots.clock import VirtualClock
from mp2a.robots.driver import Driver, run_drivers
from mp2a.robots.interface import NO_POSE, Sensed
from mp2a.robots.planner import ChoreographyPlanner, origin_of
from mp2a.robots.robot_config import ROBOT_CONFIGS
from mp2a.robots.sender import Sender
from mp2a.robots.simulated import SimulatedRobot, SimulationClock
from mp2a.se2 import compose
from mp2a.simulator import NO_SLIP, PHYSICS_ENGINE_SLIP, Simulation, World
from mp2a.simulator.scenario_run import run as ideal_run

SCENARIOS = Path(__file__).parents[1] / "examples" / "scenarios"
TWO = parse((SCENARIOS / "listing_7_1.txt").read_text())
AHEAD = parse("robots R1\nrow R1 0 0\nmove 6 0")
POSE = st.tuples(*[st.floats(-5, 5)] * 3)


def simulated(scenario, world=None, slip=NO_SLIP):
    """Drivers of simulated robots, in one process."""
    configs = [ROBOT_CONFIGS["husky"]] * len(scenario.robots)
    places = Choreography(scenario, HUSKY).slot_poses()
    simulation = Simulation(World() if world is None else world, HUSKY, places, slip=slip)
    clock = SimulationClock(simulation, 0.05, range(len(places)))
    drivers = [
        Driver(role, robot, config, ChoreographyPlanner(Choreography(scenario, HUSKY, here=[i]), True), False)
        for i, (role, robot, config) in enumerate(zip(scenario.robots, clock.robots, configs, strict=True))
    ]
    return drivers, clock


def steps_of(drivers, clock, longest=100):
    """Drive; returns whether all went well, and the steps by role, without the last one that stops the robot."""
    steps = {driver.role: [] for driver in drivers}
    run_drivers(drivers, clock, longest, lambda driver, step: steps[driver.role].append(step))
    last = [driven.pop() for driven in steps.values()]
    assert all(step.stands and not step.command.any() for step in last)
    return not exit_status(driver.outcome() for driver in drivers), steps


def test_each_robot_alone_does_what_all_together_do():
    """Nobody needs to know the others: ideal robots drive as in one choreography that knows all."""
    found = robots_file.robots_of({"robots": {"R1": {"model": "husky"}, "R2": {"model": "husky"}}}, TWO.robots)
    setup = drive_setup.set_up_drive(TWO, found, TWO.robots, None)
    good, steps = steps_of(setup.drivers, setup.clock)
    assert good
    together = ideal_run(Choreography(TWO, HUSKY))
    for i, role in enumerate(TWO.robots):
        last = steps[role][-1]
        assert last.time == pytest.approx(together.time[-1], abs=0.5)
        np.testing.assert_allclose(last.pose, together.poses[-1, i], atol=0.15)


@pytest.mark.parametrize("slip", [NO_SLIP, PHYSICS_ENGINE_SLIP])
def test_commands_keep_to_speeds_and_accelerations(slip):
    drivers, clock = simulated(TWO, slip=slip)
    good, steps = steps_of(drivers, clock)
    assert good
    assert not clock.simulation.collisions
    for driven in steps.values():
        commands = np.array([step.command for step in driven])
        assert (np.abs(commands) <= [HUSKY.max_speed, HUSKY.max_turn_rate]).all()
        change = np.abs(np.diff(commands, axis=0, prepend=[[0, 0]])) / 0.05
        most = np.array([HUSKY.max_acceleration, HUSKY.max_turn_acceleration]) + 1e-9
        assert ((change <= most) | (commands == 0)).all()  # what a point forbids ends at once


def test_learning_slip_brings_slipping_robots_closer_to_their_path(monkeypatch):
    def error():
        drivers, clock = simulated(TWO, slip=PHYSICS_ENGINE_SLIP)
        good, steps = steps_of(drivers, clock)
        worst = 0.0
        for driven in steps.values():
            track = np.array([step.pose[:2] for step in driven])
            leader = np.array([step.leader for step in driven])
            line = np.concatenate((np.linspace(track[0], leader[0], 50), leader))
            worst = max(worst, np.min(np.hypot(*(track[:, None] - line).transpose(2, 0, 1)), axis=1).max())
        return good, worst

    arrived, learning = error()
    monkeypatch.setattr("mp2a.robots.slip.learn", lambda slip, *_: slip)
    assert arrived
    assert learning < error()[1]


class Failing(IdealRobot):
    """An ideal robot whose sensors fail from a time on."""

    def __init__(self, pose, what, lidar):
        super().__init__(HUSKY, pose)
        self.what, self.has_lidar = what, lidar

    def sense(self):
        sensed = super().sense()
        failed = self.what(self.ticks)
        pose = NO_POSE if failed == "pose" else sensed.pose
        seen = [[0.9, 0.0]] if failed == "wall" else np.empty((0, 2))
        points = None if failed == "points" or not self.has_lidar else np.array(seen)
        return Sensed(pose, sensed.twist, points)


def fail(what, lidar=True):
    robot = Failing([-0.5, 0, 0], what, lidar)
    planner = ChoreographyPlanner(Choreography(AHEAD, HUSKY), lidar)
    driver = Driver("R1", robot, ROBOT_CONFIGS["husky"], planner, False)
    good, steps = steps_of([driver], VirtualClock(0.05, [robot]), 30)
    return good, robot, steps["R1"]


def test_a_stop_signal_stops_at_once_and_is_heard_until_the_way_is_clear():
    good, robot, _ = fail(lambda tick: "wall" if 60 <= tick < 140 else None)
    speeds = [speed for speed, _ in robot.sent]
    assert good
    assert speeds[58] > 0.5
    assert all(speed <= 0 for speed in speeds[59:139])
    assert speeds[59] == 0
    assert max(speeds[150:]) > 0.5
    assert robot.warnings == [(60, sound.TEXT), (120, None)]


def test_three_lost_poses_in_a_row_are_an_error_for_good():
    good, robot, steps = fail(lambda tick: "pose" if 40 <= tick < 43 else None)
    assert not good
    assert robot.sent[38] != (0, 0)
    assert set(robot.sent[39:]) == {(0, 0)}
    assert [step.error for step in steps].index(True) == 41


def test_two_lost_poses_in_a_row_are_not():
    good, robot, steps = fail(lambda tick: "pose" if tick % 20 in (0, 1) else None)
    assert good
    assert not any(step.error for step in steps)
    assert robot.sent[39] == (0, 0)


def test_a_pose_that_is_lost_at_the_start_does_not_lose_the_place():
    """The frames are tied at the first pose that is known, wherever the robot's own frame lies."""
    robot = Failing([3.0, -2.0, 1.0], lambda tick: "pose" if tick < 3 else None, False)
    planner = ChoreographyPlanner(Choreography(AHEAD, HUSKY), False)
    good, steps = steps_of(
        [Driver("R1", robot, ROBOT_CONFIGS["husky"], planner, True)], VirtualClock(0.05, [robot]), 30
    )
    assert good
    assert np.isnan(steps["R1"][1].pose).all()
    np.testing.assert_allclose(steps["R1"][2].pose, [-0.5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(steps["R1"][-1].pose[1:], 0, atol=1e-3)


def test_lidar_that_is_silent_for_longer_than_300_ms_is_an_error_for_good():
    good, robot, steps = fail(lambda tick: "points" if 40 <= tick < 60 else None)
    assert not good
    first = [step.error for step in steps].index(True)
    assert steps[first].time - steps[38].time == pytest.approx(0.35)
    assert set(robot.sent[first:]) == {(0, 0)}


def test_lidar_that_is_silent_for_a_little_less_is_not():
    good, _, steps = fail(lambda tick: "points" if 40 <= tick < 45 else None)
    assert good
    assert not any(step.error for step in steps)


def test_a_robot_is_closed_whatever_happens():
    class Broken(IdealRobot):
        closed = False

        def sense(self):
            raise RuntimeError("no")

        def close(self):
            self.closed = True

    robot = Broken(HUSKY, np.zeros(3))
    planner = ChoreographyPlanner(Choreography(AHEAD, HUSKY), False)
    with pytest.raises(RuntimeError, match="no"):
        run_drivers([Driver("R1", robot, ROBOT_CONFIGS["husky"], planner, False)], VirtualClock(0.05, [robot]), 30)
    assert robot.closed


@given(POSE, POSE)
def test_origin_takes_the_pose_to_the_place(place, pose):
    origin = origin_of(np.array(place), np.array(pose))
    np.testing.assert_allclose(compose(origin, pose), place, atol=1e-9)


@given(POSE)
def test_where_the_fixed_frame_lies_does_not_matter(frame):
    """A robot that starts in place drives the same commands whatever its own frame is."""

    def commands(origin):
        start = compose(origin, [-0.5, 0.0, 0.0])
        robot = IdealRobot(HUSKY, start)
        scenario = parse("robots R1\nrow R1 0 0\nmove 1 40")
        planner = ChoreographyPlanner(Choreography(scenario, HUSKY), False)
        driver = Driver("R1", robot, ROBOT_CONFIGS["husky"], planner, True)
        _, steps = steps_of([driver], VirtualClock(0.05, [robot]), 2)
        return np.array([step.command for step in steps["R1"]])

    np.testing.assert_allclose(commands(np.array(frame)), commands(np.zeros(3)), atol=1e-6)


# ---- the command -----------------------------------------------------------------------------------------------


def test_dry_run_prints_what_would_be_sent_and_records_it(tmp_path, capsys):
    path = str(SCENARIOS / "listing_7_1.txt")
    assert main(["drive", path, "--robots", "R1=husky,R2=tradr", "--record", str(tmp_path), "--bag", "none"]) == 0
    printed = capsys.readouterr().out
    assert "/nav/cmd_vel  linear.x" in printed
    assert printed.count("would be sent  done") == 4  # at its end, and the zero that stops it
    assert sorted(file.name for file in tmp_path.iterdir()) == ["R1.csv", "R2.csv"]
    with (tmp_path / "R2.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert max(float(row["linear_x"]) for row in rows) <= 0.5
    assert float(rows[1]["time"]) == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--robots", "robot"], "--robots: robots.R1: model: got 'robot'"),
        (["--robots", "R1=husky,tradr"], "--robots: got no table [robots.R2], expected one for each of R1, R2"),
        (["--robots", "none.toml"], "none.toml: cannot be read as a robots file"),
        (["--armed"], "--armed: got adapter dry, expected one of ros1, ros2"),
        (["--role", "R7"], "--role: got 'R7', expected one of R1, R2"),
        (["--adapter", "ros1"], "--role: got none, expected one of R1, R2, or mpirun -n 2"),
        (["--adapter", "simulator", "--role", "R1"], "--role: got the adapter simulator"),
        (["--bag", "ros1"], "--bag: got ros1 without --record"),
        (["--adapter", "recording"], "recording: got none, expected --recording PATH"),
        (["--adapter", "dry", "--recording", "x"], "--recording: got adapter dry, expected recording"),
        (["--begin", "3"], "--begin: got adapter dry, expected recording"),
    ],
)
def test_mistakes_on_the_command_line(options, message, capsys):
    assert main(["drive", str(SCENARIOS / "listing_7_1.txt"), *options]) == 2
    assert message in capsys.readouterr().err


def test_the_example_drives_in_the_simulator():
    robots = str(SCENARIOS.parent / "robots.toml")
    options = ["--robots", robots, "--adapter", "simulator", "--quiet"]
    assert main(["drive", str(SCENARIOS / "listing_7_1.txt"), *options]) == 0


WALL = "[[wall]]\npoints = [[3, -5], [3, 5]]\n"


def behind_a_wall(tmp_path):
    """Options of a drive of one robot to a place behind a wall."""
    (tmp_path / "ahead.txt").write_text("robots R1\nrow R1 0 0\nmove 6 0")
    (tmp_path / "wall.toml").write_text(WALL)
    (tmp_path / "robots.toml").write_text('adapter = "simulator"\nworld = "wall.toml"\n[robots.R1]\nmodel = "husky"\n')
    return ["drive", str(tmp_path / "ahead.txt"), "--robots", str(tmp_path / "robots.toml")]


def test_a_robot_that_is_blocked_short_of_its_place_has_not_arrived(tmp_path, capsys):
    assert main([*behind_a_wall(tmp_path), "--record", str(tmp_path / "r"), "--bag", "none"]) == 3
    printed = capsys.readouterr().out.splitlines()
    assert re.fullmatch(
        r"R1 did not arrive, [34]\.\d\d m from its place: blocked by something in front of it", printed[-1]
    )
    last = [line for line in printed if "angular.z" in line][-1]
    assert "linear.x  0.000 m/s  angular.z  0.000 rad/s" in last
    with (tmp_path / "r" / "R1.csv").open() as file:
        row = list(csv.DictReader(file))[-1]
    assert (row["linear_x"], row["angular_z"]) == ("0", "0")
    assert float(row["time"]) < 30, "it gives up some seconds after its leader has come to the end"


def test_robots_in_a_column_arrive_on_their_leaders_path_round_corners(tmp_path, capsys):
    """Where they are to be is on the path, not where a stiff formation would have them."""
    scenario = tmp_path / "column.txt"
    scenario.write_text("robots R1 R2 R3 R4\ncolumn R1;R2;R3;R4 2 0\nmove 3 0\nmove 3 -60\nmove 3 60")
    assert main(["drive", str(scenario), "--quiet"]) == 0
    assert capsys.readouterr().out.count(" yes ") == 4


def test_under_mpirun_all_ranks_tell_one_outcome(tmp_path):
    scenario = tmp_path / "row.txt"
    scenario.write_text("robots R1 R2\nrow R1,R2 0 4\nmove 6 0")
    (tmp_path / "wall.toml").write_text("[[wall]]\npoints = [[3, 1], [3, 5]]\n")
    robots = tmp_path / "robots.toml"
    robots.write_text(
        'adapter = "simulator"\nworld = "wall.toml"\n[robots.R1]\nmodel = "husky"\n[robots.R2]\nmodel = "husky"\n'
    )
    program = [sys.executable, "-m", "mp2a", "drive", str(scenario), "--robots", str(robots), "--quiet"]
    done = launch.run(2, program, timeout=120, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 3
    assert done.stdout.count("R1 did not arrive, ") == done.stdout.count("2 robots, ") == 1
    assert "R2 did not" not in done.stdout


def test_a_drive_that_takes_too_long_or_loses_its_pose_says_so(monkeypatch, capsys):
    path = str(SCENARIOS / "listing_7_1.txt")
    assert main(["drive", path, "--longest", "3", "--quiet"]) == 3
    assert "m from its place: time was up" in capsys.readouterr().out
    monkeypatch.setattr(SimulatedRobot, "sense", lambda self: Sensed(NO_POSE, np.zeros(2), None))
    assert main(["drive", path, "--quiet"]) == 3
    assert "R1 did not arrive: in its error state, its pose was lost" in capsys.readouterr().out


def test_a_planner_that_stalls_is_told_in_a_line(tmp_path, monkeypatch, capsys):
    """The watchdog has stopped the robot; the command says so, how far the robot came, and ends with 2."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    interface = ROBOT_CONFIGS["husky"]

    class Watched(IdealRobot):
        def __init__(self, pose):
            super().__init__(HUSKY, pose)
            self.sender = Sender(interface, "ros1", FILE_PUBLISHER, file=str(tmp_path / "sent"))

        def send(self, command):
            super().send(command)
            self.sender.send(*command)
            if self.simulated.now() > 1:
                time.sleep(3 * interface.patience)

        def close(self):
            self.sender.close()

    def make(config):
        robots = [Watched(config.places[0])]
        return AdapterResult(robots, VirtualClock(config.period, robots))

    monkeypatch.setattr(simulated_module, "make", make)
    scenario = tmp_path / "ahead.txt"
    scenario.write_text("robots R1\nrow R1 0 0\nmove 6 0")
    assert main(["drive", str(scenario), "--quiet"]) == 2
    said = capsys.readouterr()
    assert re.search(
        r"R1 did not arrive, \d\.\d\d m from its place: in its error state, the watchdog takes no", said.out
    )
    assert said.err.strip().endswith(
        "the watchdog takes no more commands (it has got no command for too long); the robot stands"
    )
    assert "Traceback" not in said.err


def test_a_scenario_that_is_not_there(capsys):
    assert main(["drive", "nowhere.txt"]) == 2
    assert "nowhere.txt: cannot be read as a scenario: it is not there" in capsys.readouterr().err


def test_unequal_rates_need_real_time():
    found = robots_file.robots_of(
        {"robots": {"R1": {"model": "husky", "rate": 25}, "R2": {"model": "husky"}}}, TWO.robots
    )
    with pytest.raises(InputError, match="rate: got 20, 25 Hz, expected one for all"):
        drive_setup.set_up_drive(TWO, found, TWO.robots, None)


def test_a_wrong_number_of_ranks_ends_all():
    program = [sys.executable, "-m", "mp2a", "drive", str(SCENARIOS / "listing_7_1.txt")]
    done = launch.run(3, program, timeout=120, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode
    assert "mpirun: got 3 ranks, expected 2, one for each of R1, R2" in done.stdout
    assert "Traceback" not in done.stdout
