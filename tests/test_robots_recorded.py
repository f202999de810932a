"""Robots out of recordings: our own drives give their commands again; bags of others give what is in them."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ideal_robot import IdealRobot
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mp2a.cli import main
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.robot_models import HUSKY
from mp2a.robots.adapters import EPOCH
from mp2a.robots.clock import VirtualClock
from mp2a.robots.driver import Driver, run_drivers
from mp2a.robots.interface import NO_POSE
from mp2a.robots.planner import ChoreographyPlanner
from mp2a.robots.records.bag_writer import BagWriter, bag_path
from mp2a.robots.records.recorded import RecordedRobot, difference_report
from mp2a.robots.robot_config import ROBOT_CONFIGS
from mp2a.robots.robots_file import within
from mp2a.robots.simulated import SimulationClock
from mp2a.simulator import PHYSICS_ENGINE_SLIP, Simulation, parse_world

SCENARIO = Path(__file__).parents[1] / "examples" / "scenarios" / "listing_7_1.txt"
TWO = parse(SCENARIO.read_text())
ROUNDING = 1e-9
"""Poses go through a quaternion, whose heading comes back to rounding; speeds and points come back to the bit."""
SECOND = 1_000_000_000


def drive(scenario, robots, clock, in_place, interface=ROBOT_CONFIGS["husky"], **options):
    """Drive robots through a scenario; returns the steps of each role."""
    drivers = [
        Driver(
            role,
            robot,
            interface,
            ChoreographyPlanner(Choreography(scenario, HUSKY, here=[i], **options), robot.has_lidar),
            in_place,
        )
        for i, (role, robot) in enumerate(zip(scenario.robots, robots, strict=True))
    ]
    steps = {role: [] for role in scenario.robots}
    run_drivers(drivers, clock, 60, lambda driver, step: steps[driver.role].append(step))
    return steps


def write(folder, bag, steps, interface=ROBOT_CONFIGS["husky"]):
    for role, driven in steps.items():
        writer = BagWriter(bag_path(folder, role, bag), bag, role, interface)
        for step in driven:
            writer.add(EPOCH + round(step.time * SECOND), step)
        writer.close()


def replay(scenario, folder, interface=ROBOT_CONFIGS["husky"], **options):
    robots = [RecordedRobot(role, folder, interface) for role in scenario.robots]
    return drive(scenario, robots, VirtualClock(0.05, robots), True, interface, **options), robots


def commands(steps):
    return np.array([step.command for step in steps])


def assert_same(steps, again):
    for role, driven in steps.items():
        assert [step.flags for step in again[role]] == [step.flags for step in driven]
        np.testing.assert_allclose(commands(again[role]), commands(driven), rtol=0, atol=ROUNDING)
        apart = np.array([step.pose for step in again[role]]) - [step.pose for step in driven]
        apart[:, 2] = (apart[:, 2] + np.pi) % (2 * np.pi) - np.pi  # a quaternion does not count turns
        np.testing.assert_allclose(apart[np.isfinite(apart)], 0, atol=ROUNDING)


@pytest.fixture(scope="module")
def simulated():
    """A drive with slip in the simulator, past something that pushes, up to something that stops."""
    world = parse_world("[[disc]]\ncentre = [2.2, 1.6]\nradius = 0.2\n[[wall]]\npoints = [[1, -2.6], [5, -2.6]]\n")
    simulation = Simulation(world, HUSKY, Choreography(TWO, HUSKY).slot_poses(), slip=PHYSICS_ENGINE_SLIP)
    clock = SimulationClock(simulation, 0.05, range(2))
    return drive(TWO, clock.robots, clock, False)


@pytest.mark.parametrize("bag", ["mcap", "ros1", "ros2"])
def test_a_simulated_drive_gives_its_commands_again(bag, simulated, tmp_path):
    assert any(step.blocked for driven in simulated.values() for step in driven)
    write(tmp_path, bag, simulated)
    again, robots = replay(TWO, tmp_path)
    assert_same(simulated, again)
    for robot in robots:
        driven = simulated[robot.role]
        for step, once_more in zip(driven, again[robot.role], strict=True):
            assert (step.sensed.points is None) == (once_more.sensed.points is None)
            if step.sensed.points is not None:
                np.testing.assert_array_equal(once_more.sensed.points, step.sensed.points)
        assert robot.difference.compared == len(driven) - 1  # the last one stops it
        assert (robot.difference.largest <= ROUNDING).all()


def test_points_and_speed_limit_make_a_difference(simulated, tmp_path):
    """So that the law above says something: without the points, or with another v_max, commands are others."""
    blind = {role: [_without_points(step) for step in driven] for role, driven in simulated.items()}
    write(tmp_path, "mcap", blind)
    _, robots = replay(TWO, tmp_path)
    assert max(robot.difference.largest[0] for robot in robots) > 0.1
    write(tmp_path / "again", "mcap", simulated)
    _, robots = replay(TWO, tmp_path / "again", max_speed=0.3)
    assert min(robot.difference.largest[0] for robot in robots) > 0.1
    speed = f"linear.x {robots[0].difference.largest[0]:.3g} m/s"
    assert speed in difference_report(robots[0], True)[0]


def _without_points(step):
    return step._replace(sensed=step.sensed._replace(points=None))


class Late(VirtualClock):
    """Time whose ticks are late, as real ones are."""

    def __init__(self, robots, delays):
        super().__init__(0.05, robots)
        self._delays = delays

    def now(self):
        return super().now() + self._delays[self._tick % len(self._delays)]


@settings(max_examples=10)
@given(
    st.lists(st.floats(0, 0.02), min_size=1, max_size=9),
    st.sampled_from(["tf", "odometry", "stamped"]),
    st.tuples(*[st.floats(-5, 5)] * 3),
)
def test_ticks_that_were_late_are_met_again(tmp_path_factory, delays, pose, frame):
    folder = tmp_path_factory.mktemp("late")
    scenario = parse("robots R1\nrow R1 0 0\nmove 2 150")
    interface = dataclasses.replace(within(ROBOT_CONFIGS["husky"], "R1"), pose=pose)
    robot = IdealRobot(HUSKY, np.array(frame))
    steps = drive(scenario, [robot], Late([robot], delays), True, interface)
    write(folder, "mcap", steps, interface)
    again, robots = replay(scenario, folder, interface)
    assert len(commands(steps["R1"])) - 1 == robots[0].difference.compared
    assert_same(steps, again)


def test_lost_poses_and_a_human_are_met_again(tmp_path):
    class Disturbed(IdealRobot):
        def sense(self):
            sensed = super().sense()
            sensed = sensed._replace(human=20 <= self.ticks < 40)
            return sensed._replace(pose=NO_POSE) if self.ticks in (50, 51, 80, 81, 82) else sensed

    scenario = parse("robots R1\nrow R1 0 0\nmove 6 0")
    robot = Disturbed(HUSKY, [-0.5, 0, 0])
    steps = drive(scenario, [robot], VirtualClock(0.05, [robot]), False)
    write(tmp_path, "mcap", steps)
    assert {step.sensed.human for step in steps["R1"]} == {True, False}
    assert steps["R1"][-1].error
    again, _ = replay(scenario, tmp_path)
    assert_same(steps, again)


# ---- the command -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [[], ["--bag", "ros1"]])
def test_the_command_records_and_plays_back(options, tmp_path, capsys):
    record = ["--adapter", "simulator", "--record", str(tmp_path / "a"), *options]
    assert main(["drive", str(SCENARIO), "--quiet", *record]) == 0
    robots = tmp_path / "robots.toml"
    robots.write_text(
        'adapter = "recording"\nrecording = "a"\n[robots.R1]\nmodel = "husky"\n[robots.R2]\nmodel = "husky"\n'
    )
    assert main(["drive", str(SCENARIO), "--quiet", "--robots", str(robots), "--record", str(tmp_path / "b")]) == 0
    told = capsys.readouterr().out
    assert told.count("largest difference to the recorded commands: linear.x") == 2
    for role in ("R1", "R2"):
        one, two = ((tmp_path / name / f"{role}.csv").read_text() for name in "ab")
        assert one.count("\n") == two.count("\n") > 100
    assert main(["drive", str(SCENARIO), "--recording", str(tmp_path / "b"), "--role", "R2", "--quiet"]) == 0
    assert "R2       largest" in capsys.readouterr().out


def test_a_recording_that_ends_too_soon_is_told(tmp_path, capsys):
    record = ["--adapter", "simulator", "--longest", "3", "--quiet", "--record", str(tmp_path)]
    assert main(["drive", str(SCENARIO), *record]) == 3
    assert main(["drive", str(SCENARIO), "--quiet", "--recording", str(tmp_path)]) == 3
    assert "R1       its recording is over before the scenario" in capsys.readouterr().out


# ---- a bag of a real robot, as its own software records it -----------------------------------------------------


class Foreign:
    """Writes a bag as rosbag does on a HUSKY: transforms in a chain, from two nodes; a LIDAR turned and raised."""

    def __init__(self, path):
        self.store = get_typestore(Stores.ROS1_NOETIC)
        self.store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
        self.writer = Writer(path)
        self.writer.open()
        self.connections = {}

    def put(self, t, topic, kind, node="/a", **values):
        if (topic, node) not in self.connections:
            self.connections[topic, node] = self.writer.add_connection(topic, kind, typestore=self.store, callerid=node)
        raw = self.store.serialize_ros1(self.new(kind, **values), kind)
        self.writer.write(self.connections[topic, node], round(t * SECOND), raw)

    def new(self, kind, **values):
        return self.store.types[kind](**values)

    def header(self, frame, t):
        sec, nanosec = divmod(round(t * SECOND), SECOND)
        time = self.new("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        return self.new("std_msgs/msg/Header", seq=0, stamp=time, frame_id=frame)

    def vector(self, x, y, z, kind="Vector3"):
        return self.new(f"geometry_msgs/msg/{kind}", x=float(x), y=float(y), z=float(z))

    def turned(self, yaw):
        return self.new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2))

    def twist(self, speed, turn):
        angular = self.vector(0, 0, turn)
        return self.new("geometry_msgs/msg/Twist", linear=self.vector(speed, 0, 0), angular=angular)

    def command(self, t, topic, speed, turn):
        angular = self.vector(0, 0, turn)
        self.put(t, topic, "geometry_msgs/msg/Twist", linear=self.vector(speed, 0, 0), angular=angular)

    def transform(self, t, topic, parent, child, at, yaw, node):
        moved = self.new("geometry_msgs/msg/Transform", translation=self.vector(*at), rotation=self.turned(yaw))
        found = self.new(
            "geometry_msgs/msg/TransformStamped", header=self.header(parent, t), child_frame_id=child, transform=moved
        )
        self.put(t, topic, "tf2_msgs/msg/TFMessage", node, transforms=[found])

    def odometry(self, t, x, speed):
        place = self.new("geometry_msgs/msg/Pose", position=self.vector(x, 0, 0, "Point"), orientation=self.turned(0))
        pose = self.new("geometry_msgs/msg/PoseWithCovariance", pose=place, covariance=np.zeros(36))
        twist = self.new("geometry_msgs/msg/TwistWithCovariance", twist=self.twist(speed, 0), covariance=np.zeros(36))
        header = self.header("odom", t)
        self.put(
            t, "/odometry/filtered", "nav_msgs/msg/Odometry", header=header, child_frame_id="b", pose=pose, twist=twist
        )

    def cloud(self, t, frame, points):
        fields = [
            self.new("sensor_msgs/msg/PointField", name=name, offset=8 * k, datatype=8, count=1)
            for k, name in enumerate("xyz")
        ]
        data = np.asarray(points, "<f8")
        self.put(
            t, "/points_filtered", "sensor_msgs/msg/PointCloud2", header=self.header(frame, t), height=1,
            width=len(data), fields=fields, is_bigendian=False, point_step=24, row_step=24 * len(data),
            data=data.reshape(-1).view(np.uint8), is_dense=True,
        )  # fmt: skip


@pytest.fixture(scope="module")
def husky(tmp_path_factory):
    """10 s: it stands for 3 s, then drives at 0.5 m/s; a human takes over at 6 s; odom is turned by 90° in the map."""
    path = tmp_path_factory.mktemp("husky") / "husky.bag"
    bag, begin = Foreign(path), 1_700_000_000.0
    bag.transform(begin, "/tf_static", "base_link", "velodyne", (0.2, 0.0, 0.5), np.pi / 2, "/state")
    for k in range(500):
        t = 0.02 * k
        x = max(t - 3, 0) * 0.5
        bag.odometry(begin + t, x, 0.5 if t > 3 else 0.0)
        bag.transform(begin + t, "/tf", "odom", "base_link", (x, 0, 0), 0.0, "/ekf")
        if k % 5 == 0:
            bag.transform(begin + t, "/tf", "map", "odom", (1.0, 2.0, 0), np.pi / 2, "/slam")
            bag.cloud(begin + t, "velodyne", [[1.0, 0.0, 0.0], [0.0, -2.0, 0.3], [0.0, 0.0, 9.0]])
        if k % 5 == 2 and t > 3:
            bag.put(
                begin + t,
                "/nav/cmd_vel",
                "geometry_msgs/msg/Twist",
                linear=bag.vector(0.5, 0, 0),
                angular=bag.vector(0, 0, 0.25),
            )
    bag.command(begin + 6, "/cmd_vel", 0.1, 0.0)
    bag.writer.close()
    return path


def test_a_bag_of_a_robot_gives_its_pose_speeds_and_points(husky):
    robot = RecordedRobot("R1", husky, ROBOT_CONFIGS["husky"], begin=3.0)
    assert robot.has_lidar
    assert robot.epoch == 1_700_000_003 * SECOND
    for k in range(120):
        robot.advance(0.05 * k)
        pose, twist, points, human, *_ = robot.sense()
        t = 0.02 * round(0.05 * k / 0.02 + 1e-6)
        np.testing.assert_allclose(pose, [1.0, 2.0 + 0.5 * t, np.pi / 2], atol=0.011)
        np.testing.assert_allclose(twist, [0.5 if k else 0.0, 0.0], atol=1e-12)
        assert human == (60 <= k <= 70)
        if points is not None:  # above the floor, below the ceiling, turned and raised as the sensor is
            np.testing.assert_allclose(points, [[0.2, 1.0], [2.2, 0.0]], atol=1e-12)
    robot.close()


def test_a_bag_of_a_robot_begins_as_soon_as_its_pose_is_known(husky):
    robot = RecordedRobot("R1", husky, ROBOT_CONFIGS["husky"])
    assert robot.epoch == 1_700_000_000 * SECOND
    np.testing.assert_allclose(robot.sense().pose, [1, 2, np.pi / 2])


def test_commands_are_compared_with_those_in_force(husky):
    robot = RecordedRobot("R1", husky, ROBOT_CONFIGS["husky"], begin=2.0)
    for k in range(160):
        robot.advance(0.05 * k)
        robot.send(np.array([0.4, 0.25 if k != 100 else 1.0]))
    compared, largest, times = robot.difference
    assert 135 <= compared <= 139  # from 1.04 s on, when the first one was recorded
    np.testing.assert_allclose(largest, [0.1, 0.75])
    assert times[1] == pytest.approx(5.0)


def test_points_that_nobody_can_place_are_told(husky):
    lidar = dataclasses.replace(ROBOT_CONFIGS["husky"], body_frame="base_link2", pose="odometry")
    robot = RecordedRobot("R1", husky, lidar)
    robot.advance(0.0)
    assert robot.sense().points is None
    assert "points in velodyne not used: no transform to base_link2" in difference_report(robot, True)[1]
