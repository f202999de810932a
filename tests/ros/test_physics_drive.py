"""Robots in a physics engine drive in the engine's own time, without ROS: no machine is too busy for that.

Commands take effect up to a period of the watchdog late, points are 0.3 s old, and robots do not tick together.
"""

import itertools
from pathlib import Path

import numpy as np
import pytest
from paths import COLUMN, ideal, path_error

from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.robot_models import HUSKY
from mp2a.robots.driver import Driver
from mp2a.robots.interface import Sensed
from mp2a.robots.planner import ChoreographyPlanner
from mp2a.robots.robot_config import ROBOT_CONFIGS

pytestmark = pytest.mark.ros
BESIDE = (Path(__file__).parents[2] / "examples" / "scenarios" / "listing_7_1.txt").read_text()
PERIOD = 12  # steps of 1/240 s
HERE = ROBOT_CONFIGS["husky"]


class InPhysics:
    """A robot of the physics engine behind the interface of real ones."""

    def __init__(self, husky, has_lidar, rng):
        self.has_lidar = has_lidar
        self._husky, self._rng = husky, rng
        self._command, self._next, self._wait, self._points = np.zeros(2), np.zeros(2), 0, None
        self.track = []

    def sense(self):
        points, self._points = self._points, None
        place, _, heading, forward, turn = self._husky.state()
        return Sensed(np.array([place[0], place[1], heading]), np.array([forward, turn]), points)

    def send(self, command):
        self._next, self._wait = command, int(self._rng.integers(1, PERIOD))

    def advance(self):
        """Drive for a step."""
        self._wait -= 1
        self._command = self._next if self._wait <= 0 else self._command
        self._husky.drive(self._command)
        self.track.append(self._husky.state()[0][:2])

    def scan(self):
        points = self._husky.scan()
        self._points = self._points if points is None else points[:, :2]

    def warn(self, text):
        pass

    def close(self):
        pass


def drive(text, lidar, seed, longest=60.0):
    """Drive a scenario; returns the true tracks of the robots, ``(steps, 2)`` m, and their path errors, m."""
    pytest.importorskip("pybullet", reason="no physics engine: pip install pybullet")
    import pybullet
    from husky import SCAN, STEP, Husky, open_world

    rng = np.random.default_rng(seed)
    scenario = parse(text)
    open_world()
    robots = [InPhysics(Husky(*place), lidar, rng) for place in Choreography(scenario, HUSKY).slot_poses()]
    drivers = [
        Driver(role, robot, HERE, ChoreographyPlanner(Choreography(scenario, HUSKY, here=[i]), lidar, HERE.points_age))
        for i, (role, robot) in enumerate(zip(scenario.robots, robots, strict=True))
    ]
    ticks = {role: [] for role in scenario.robots}
    began, done = round(1 / STEP), set()  # a second to come to rest on the floor, and for points
    turns = [began + int(late) for late in rng.integers(0, PERIOD, len(robots))]
    for step in range(began + round(longest / STEP)):
        for robot in robots:
            robot.advance()
        pybullet.stepSimulation()
        if lidar and step % SCAN == 0:
            for robot in robots:
                robot.scan()
        for driver, turn in zip(drivers, turns, strict=True):
            if step >= turn and (step - turn) % PERIOD == 0:
                ticks[driver.role].append(driver.tick((step - began) * STEP))
                if ticks[driver.role][-1].done:
                    done.add(driver.role)
        if len(done) == len(drivers):
            break
    assert len(done) == len(drivers)
    assert not any(tick.error for each in ticks.values() for tick in each)
    errors = np.array([
        path_error(*(np.array([getattr(tick, name)[:2] for tick in each]) for name in ("pose", "leader")))
        for each in ticks.values()
    ])  # fmt: skip
    print(f"{'LIDAR' if lidar else 'blind'}, seed {seed}: path errors {errors.round(2)} m")
    return [np.array(robot.track) for robot in robots], errors


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("lidar", [False, True])
def test_a_column_does_not_run_into_itself(lidar, seed):
    """Robots end where ideal ones do, also if each sees the one in front."""
    tracks, errors = drive(COLUMN, lidar, seed)
    last, least = ideal(COLUMN)
    nearest = min(np.hypot(*(a - b).T).min() for a, b in itertools.pairwise(tracks))
    gaps, wanted = (np.hypot(*np.diff(ends, axis=0).T) for ends in ([track[-1] for track in tracks], last))
    print(f"nearest two {nearest:.2f} m, gaps {gaps.round(2)} m, ideal robots {wanted.round(2)} m")
    assert nearest > HUSKY.length
    assert (errors < least + 0.2).all()
    np.testing.assert_allclose(gaps, wanted, atol=0.3)


@pytest.mark.parametrize("seed", [1, 2])
def test_robots_side_by_side_keep_their_distance(seed):
    (first, second), errors = drive(BESIDE, True, seed)
    together = min(len(first), len(second))
    apart = np.hypot(*(first[:together] - second[:together]).T)
    print(f"distance {apart.min():.2f} to {apart.max():.2f} m of 1.2")
    assert np.abs(apart - 1.2).max() < 0.6
    assert (errors < ideal(BESIDE)[1] + 0.6).all()
