"""Stop signals: what a robot's points amount to is published, and what other programs signal is obeyed."""

import time
from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from ideal_robot import IdealRobot

from mp2a.dependencies import parse_toml
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.robot_models import HUSKY
from mp2a.robots import robots_file, sound
from mp2a.robots.clock import VirtualClock
from mp2a.robots.cloud import cloud_fields, read_cloud
from mp2a.robots.driver import Driver, run_drivers
from mp2a.robots.planner import HELD_PATIENCE, ChoreographyPlanner
from mp2a.robots.robot_config import ROBOT_CONFIGS
from mp2a.robots.ros_backend import TopicWriter
from mp2a.robots.ros_robot import RosRobot

AHEAD = parse("robots R1\nrow R1 0 0\nmove 6 0")
POINTS = arrays(float, st.tuples(st.integers(0, 20), st.just(2)), elements=st.floats(-3, 3, width=32))
NAMES = ["header", "height", "width", "fields", "is_bigendian", "point_step", "row_step", "data", "is_dense"]


def field(name, offset, datatype, count):
    return SimpleNamespace(name=name, offset=offset, datatype=datatype, count=count)


class Node:
    """A node of no ROS, which remembers what is published by topic."""

    clock = staticmethod(time.time)

    def __init__(self):
        self.heard = {}

    def message(self, kind):
        return field if kind.endswith("PointField") else kind

    def header(self, frame):
        return frame

    def writer(self, topic, kind, *, depth=10, kept=False):
        self.heard[topic] = []
        return TopicWriter(lambda *content: self.heard[topic].append((kind.rpartition("/")[2], content)), lambda: 1)

    def reader(self, topic, kind, *, depth=1, kept=False, reliable=False, own=True):
        return list


def told(config=ROBOT_CONFIGS["husky"]):
    """A robot, and what it publishes by topic."""
    node = Node()
    return RosRobot(node, config, None), node.heard


def read(message):
    return read_cloud(SimpleNamespace(**dict(zip(NAMES, message, strict=True))))


@given(POINTS)
def test_a_cloud_that_is_written_reads_back(flat):
    spatial = np.column_stack((flat, np.ones(len(flat))))
    assert read(cloud_fields(spatial, None, field)).tolist() == spatial.tolist()


@given(POINTS)
def test_what_is_published_is_what_the_choreography_obeys(cloud):
    dance = Choreography(AHEAD, HUSKY)
    dance.step(0.0, dance.slot_poses(), [[0, 0]], [cloud])
    robot, heard = told()
    robot.show(cloud)
    assert heard["/stop_front"] == [("Bool", (bool(dance.state.signals.front[0]),))]
    assert heard["/stop_rear"] == [("Bool", (bool(dance.state.signals.rear[0]),))]
    ((kind, message),) = heard["/obstacles"]
    near = read(message)[:, :2]
    assert (kind, message[0]) == ("PointCloud2", "base_link")
    # Nothing that counts is missing, nothing is there that does not: the robot is pushed alike.
    again = Choreography(AHEAD, HUSKY)
    again.step(0.0, again.slot_poses(), [[0, 0]], [near])
    assert again.state.force.tolist() == dance.state.force.tolist()
    assert len(near) == sum(abs(x) < 2 and abs(y) < 2 for x, y in cloud)


def test_stop_signals_are_taken_back_at_the_end():
    robot, heard = told()
    robot.show(np.array([[0.8, 0.0], [-0.8, 0.0]]))
    assert [heard[f"/stop_{end}"][-1][1] for end in ("front", "rear")] == [(True,), (True,)]
    robot.close()
    assert [heard[f"/stop_{end}"][-1][1] for end in ("front", "rear")] == [(False,), (False,)]


def names(more=""):
    found = robots_file.robots_of(parse_toml(f'[robots.R1]\nmodel="husky"\n{more}', "robots"), ["R1"]).configs["R1"]
    _, heard = told(found)
    return set(heard)


def test_names_of_topics():
    signals = {"/stop_front", "/stop_rear", "/obstacles"}
    assert names() == signals | {"/robotsound"}
    assert names('namespace="R1"') == {f"/R1{name}" for name in signals | {"/robotsound"}}
    assert names('namespace="R1"\nobstacles_topic="/near"') >= {"/near", "/R1/stop_front"}
    assert names('stop_front_topic=""\nstop_rear_topic=""\nobstacles_topic=""\nsound_topic=""') == set()


class Told(IdealRobot):
    """An ideal robot that other programs forbid to drive forward or backward."""

    def __init__(self, front, rear):
        super().__init__(HUSKY, np.array([-0.5, 0.0, 0.0]))
        self.front, self.rear = front, rear

    def sense(self):
        sensed = super().sense()
        return sensed._replace(stop_front=self.front(self.ticks), stop_rear=self.rear(self.ticks))


def drive(front=lambda _: False, rear=lambda _: False, scenario=AHEAD):
    robot = Told(front, rear)
    planner = ChoreographyPlanner(Choreography(scenario, HUSKY), False)
    driver = Driver("R1", robot, ROBOT_CONFIGS["husky"], planner, False)
    steps = []
    run_drivers([driver], VirtualClock(0.05, [robot]), 60, lambda _, step: steps.append(step))
    return driver.outcome(), robot, steps


def test_a_robot_without_lidar_stops_at_once_when_told_and_goes_on_when_it_may():
    outcome, robot, steps = drive(front=lambda tick: 60 <= tick < 140)
    ahead = [speed for speed, _ in robot.sent]
    assert outcome.good
    assert ahead[58] > 0.5
    assert ahead[59] == 0
    assert max(ahead[59:139]) <= 0
    assert max(ahead[150:]) > 0.5
    assert robot.warnings == [(60, sound.TEXT), (120, None)]
    assert [step.blocked for step in steps[57:60]] == [False, False, True]


def test_a_stop_behind_does_not_keep_a_robot_from_driving_forward():
    free, held = (drive(rear=rear)[1].sent for rear in (lambda _: False, lambda _: True))
    assert free == held
    assert min(speed for speed, _ in held) >= 0


def test_a_robot_that_is_held_at_its_end_waits_before_it_gives_up():
    """It has not arrived, and says how far off it is and why."""
    outcome, robot, steps = drive(front=lambda tick: tick > 60)
    assert str(outcome).startswith("R1 did not arrive, ")
    assert outcome.distance > 3
    assert outcome.reason == "blocked by another program's stop signal"
    assert steps[-2].done
    over = next(step.time for step in steps if step.time > 1 and (step.leader == steps[-1].leader).all())
    assert steps[-1].time - over < HELD_PATIENCE + 2
    assert max(speed for speed, _ in robot.sent[60:]) <= 0


def test_a_robot_that_is_held_at_its_end_for_a_while_arrives():
    outcome, _, steps = drive(front=lambda tick: 60 < tick < 240)
    over = next(step.time for step in steps if step.time > 1 and (step.leader == steps[-1].leader).all())
    assert over < 12 - 1, "its leader was through before it was let go"
    assert outcome.good


def test_a_robot_that_is_held_may_turn():
    _, robot, _ = drive(front=lambda _: True, scenario=parse("robots R1\nrow R1 0 0\nmove 3 90"))
    assert max(abs(turn) for _, turn in robot.sent) > 0.1
    assert max(speed for speed, _ in robot.sent) <= 0
