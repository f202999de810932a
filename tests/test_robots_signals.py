"""Stop signals: what a robot's points amount to is published, and what other programs signal is obeyed."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.robot_models import HUSKY
from mp2a.robots import robots_file, sound
from mp2a.robots.cloud import content, points
from mp2a.robots.driver import Driver, run
from mp2a.robots.dry import DryRobot, VirtualPace
from mp2a.robots.outlets import Wire, outlets
from mp2a.robots.planner import ChoreographyPlanner
from mp2a.robots.table import INTERFACES

AHEAD = parse("robots R1\nrow R1 0 0\nmove 6 0")
POINTS = arrays(float, st.tuples(st.integers(0, 20), st.just(2)), elements=st.floats(-3, 3, width=32))
NAMES = ["header", "height", "width", "fields", "is_bigendian", "point_step", "row_step", "data", "is_dense"]


def field(name, offset, datatype, count):
    return SimpleNamespace(name=name, offset=offset, datatype=datatype, count=count)


def recorder():
    """A wire that remembers, and what it remembers by topic."""
    heard = {}

    def writer(topic, kind):
        heard[topic] = []
        return lambda *content: heard[topic].append((kind, content))

    return Wire(writer, lambda frame: frame, "Bool", "SoundRequest", "PointCloud2", field), heard


def read(message):
    return points(SimpleNamespace(**dict(zip(NAMES, message, strict=True))))


@given(POINTS)
def test_a_cloud_that_is_written_reads_back(flat):
    back = read(content(flat, None, field))
    assert back[:, :2].tolist() == flat.tolist()
    assert not back[:, 2].any()


@given(POINTS)
def test_what_is_published_is_what_the_choreography_obeys(cloud):
    dance = Choreography(AHEAD, HUSKY)
    dance.step(0.0, dance.slot_poses(), [[0, 0]], [cloud])
    wire, heard = recorder()
    outlets(INTERFACES["husky"], wire, None).show(cloud)
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
    wire, heard = recorder()
    told = outlets(INTERFACES["husky"], wire, None)
    told.show(np.array([[0.8, 0.0], [-0.8, 0.0]]))
    assert [heard[f"/stop_{end}"][-1][1] for end in ("front", "rear")] == [(True,), (True,)]
    told.close()
    assert [heard[f"/stop_{end}"][-1][1] for end in ("front", "rear")] == [(False,), (False,)]


def names(more=""):
    found = robots_file.parse(f'[robots.R1]\nmodel="husky"\n{more}', ["R1"]).interfaces["R1"]
    wire, heard = recorder()
    outlets(found, wire, None)
    return set(heard)


def test_names_of_topics():
    signals = {"/stop_front", "/stop_rear", "/obstacles"}
    assert names() == signals | {"/robotsound"}
    assert names('namespace="R1"') == {f"/R1{name}" for name in signals | {"/robotsound"}}
    assert names('namespace="R1"\nobstacles_topic="/near"') >= {"/near", "/R1/stop_front"}
    assert names('stop_front_topic=""\nstop_rear_topic=""\nobstacles_topic=""\nsound_topic=""') == set()


class Told(DryRobot):
    """An ideal robot that other programs forbid to drive forward or backward."""

    def __init__(self, front, rear):
        super().__init__(HUSKY, np.array([-0.5, 0.0, 0.0]))
        self.ticks, self.sent, self.warnings = 0, [], []
        self.front, self.rear = front, rear

    def sense(self):
        self.ticks += 1
        return super().sense()._replace(stop_front=self.front(self.ticks), stop_rear=self.rear(self.ticks))

    def send(self, command):
        super().send(command)
        self.sent.append(tuple(command))

    def warn(self, text):
        self.warnings.append((self.ticks, text))


def drive(front=lambda _: False, rear=lambda _: False, scenario=AHEAD):
    robot = Told(front, rear)
    planner = ChoreographyPlanner(Choreography(scenario, HUSKY), "R1", False)
    driver = Driver("R1", robot, INTERFACES["husky"], planner, False)
    steps = []
    good = run([driver], VirtualPace(0.05, [robot]), 30, lambda _, step: steps.append(step))
    return good, robot, steps


def test_a_robot_without_lidar_stops_at_once_when_told_and_goes_on_when_it_may():
    good, robot, steps = drive(front=lambda tick: 60 <= tick < 140)
    ahead = [speed for speed, _ in robot.sent]
    assert good
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


def test_a_robot_that_is_held_lets_the_scenario_end():
    good, robot, steps = drive(front=lambda tick: tick > 60)
    assert good
    assert steps[-1].done
    assert steps[-1].time < 25
    assert max(speed for speed, _ in robot.sent[60:]) <= 0


def test_a_robot_that_is_held_may_turn():
    _, robot, _ = drive(front=lambda _: True, scenario=parse("robots R1\nrow R1 0 0\nmove 3 90"))
    assert max(abs(turn) for _, turn in robot.sent) > 0.1
    assert max(speed for speed, _ in robot.sent) <= 0
