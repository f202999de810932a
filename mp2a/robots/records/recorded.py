"""A robot out of a recording: it gives what was recorded and drives nowhere, whatever it is told."""

import math
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mp2a.exceptions import InputError
from mp2a.robots.adapters import AdapterConfig, AdapterResult
from mp2a.robots.clock import VirtualClock
from mp2a.robots.interface import NO_POSE, Sensed
from mp2a.robots.records.bag_reader import BagMessage, BagReader, bag_of
from mp2a.robots.robot_config import RobotConfig
from mp2a.robots.ticks import EVENTS
from mp2a.robots.topic_state import TopicState, speeds
from mp2a.robots.topics import bag_topics
from mp2a.robots.transforms import Transforms
from mp2a.spatial import Array

_SECOND = 1_000_000_000
_HUMAN = EVENTS[2]


def make(config: AdapterConfig) -> AdapterResult:
    """Open the recordings of this process' robots."""
    file = config.file
    if file.recording is None:
        raise InputError("recording: got none, expected --recording PATH, or recording = in the robots file")
    robots = [RecordedRobot(role, file.recording, file.configs[role], file.begin) for role in config.roles]
    return AdapterResult(
        robots,
        VirtualClock(config.period, robots),
        epochs=[robot.epoch for robot in robots],
        report=lambda good: [line for robot in robots for line in difference_report(robot, good)],
    )


class Difference(NamedTuple):
    """Between the commands computed and those recorded."""

    compared: int
    """Ticks."""
    largest: Array
    """``(2,)`` m/s and rad/s."""
    times: Array
    """``(2,)`` s: when it was that large."""


class RecordedRobot:
    """One robot of a recording, as it was recorded on a real robot, in the simulator, or anywhere.

    Time 0 is when pose and odometry are first known, or ``begin``. A tick gets what was recorded until then; it is
    moved to the recorded odometry that is nearest, if that is less than half a tick away, so that the ticks of a drive
    of ours, which are not quite at equal times, are met again.

    Parameters
    ----------
    role
        Of the robot.
    path
        A bag, or a folder with one a robot (`bag_of`).
    config
        Its topics and frames.
    begin
        s from the first message to time 0; None: as soon as pose and odometry are known.

    Attributes
    ----------
    has_lidar
        Whether there are points in the bag.
    epoch : int
        ns: the time in the bag that is time 0.
    over : bool
        Whether the recording has come to its end; after it the robot stands and sees what it saw last.
    state : TopicState
        What its topics have told so far.
    difference
        Between its commands and those that were recorded so far.

    Raises
    ------
    InputError
        If the recording cannot be read, or does not hold what is needed.
    DependencyError
        If rosbags is not installed.
    """

    def __init__(self, role: str, path: Path, config: RobotConfig, begin: float | None = None) -> None:
        self.role, self.config = role, config
        self._bag = BagReader(bag_of(path, role), bag_topics(config), role)
        self.path = self._bag.path
        self.has_lidar = bool(self._bag.counts.get("points_topic"))
        self._messages: Iterator[BagMessage] = self._bag.messages()
        self._ahead: deque[BagMessage] = deque()
        self._motion = "twist_topic" if config.pose == "stamped" else "odometry_topic"
        self._half = round(_SECOND / config.rate / 2)
        self.state = TopicState(config, Transforms(self._clock, self._clock), self._clock)
        self._moved: int | None = None  # when odometry came last
        self._cloud: BagMessage | None = None
        self._seen: Array = np.empty((0, 2))
        self._human = self.over = False
        self.difference = Difference(0, np.zeros(2), np.zeros(2))
        self._time = 0.0
        self._latest = self._now = 0
        try:
            self.epoch = self._find_start(begin)
            self._sensed = self._make()
        except InputError:
            self._bag.close()
            raise

    def advance(self, t: float) -> None:
        """Go on to ``t`` s."""
        self._time = t
        self._take_until(self._near(self.epoch + round(t * _SECOND)))
        self.over = not self._ahead and self._now > self._latest
        if self.over:
            self._sensed = self._sensed._replace(twist=np.zeros(2), points=self._seen)
        else:
            self._sensed = self._make()

    def sense(self) -> Sensed:
        """Return what was recorded last."""
        return self._sensed

    def send(self, command: Array) -> None:
        """Compare a command with the one that was recorded last; nothing else comes of it."""
        recorded = self.state.newest("command_topic", self.config.patience)
        if recorded is None or self.over:
            return
        compared, largest, times = self.difference
        apart = np.abs(command - speeds(getattr(recorded, "twist", recorded)))
        self.difference = Difference(
            compared + 1, np.fmax(apart, largest), np.where(apart > largest, self._time, times)
        )  # fmt: skip

    def warn(self, text: str | None) -> None:
        """Say nothing: nobody is there to hear it."""

    def close(self) -> None:
        """Close the recording."""
        self._bag.close()

    def _clock(self) -> float:
        return self._now / _SECOND

    def _find_start(self, begin: float | None) -> int:
        if not self._pull():
            raise InputError(f"recording: {self.path} has no message for {self.role}, expected some")
        start = self._ahead[0].stamp + round((begin or 0.0) * _SECOND)
        while self._ahead:
            start = max(start, self._ahead[0].stamp) if begin is None else start
            self._take_until(start)
            known = {"pose": self._pose(), "odometry": self.state.twist()}
            missing = [what for what, value in known.items() if not np.isfinite(value).all()]
            if not missing:
                return start
            if begin is not None:
                break
        when = "from begin to end" if begin is None else f"{begin:g} s after its first message"
        frames = f"; transforms: {self.state.transforms.known()}" if self.config.pose == "tf" else ""
        raise InputError(
            f"recording: {self.path}: got no {' and no '.join(missing)} of {self.role} {when}, expected them{frames}"
        )

    def _near(self, due: int) -> int:
        """Time of the odometry nearest to when a tick is due, if that is less than half a tick away."""
        while self._pull_up_to(due + self._half):
            pass
        odometry = [message.stamp for message in self._ahead if message.field == self._motion]
        if self._moved is not None:  # at the start it has been taken already
            odometry.append(self._moved)
        near = [stamp for stamp in odometry if abs(stamp - due) < self._half]
        return min(near, key=lambda stamp: abs(stamp - due), default=due)

    def _pull(self) -> bool:
        """Read a message ahead; False: there are none left."""
        message = next(self._messages, None)
        if message is not None:
            self._ahead.append(message)
        return message is not None

    def _pull_up_to(self, stamp: int) -> bool:
        return (not self._ahead or self._ahead[-1].stamp <= stamp) and self._pull()

    def _take_until(self, stamp: int) -> None:
        while self._pull_up_to(stamp):
            pass
        while self._ahead and self._ahead[0].stamp <= stamp:
            message = self._ahead.popleft()
            self._latest = message.stamp
            self._take(message)
        self._now = stamp

    def _take(self, message: BagMessage) -> None:
        if message.field == "points_topic":  # decoded only if it is the last one of a tick
            self._cloud = message
            return
        self._now = message.stamp
        content = self._bag.decode(message)
        if message.field == "events":
            texts = {f"{self.role} {text}": holds for text, holds in zip(_HUMAN, (True, False), strict=True)}
            self._human = texts.get(content.data, self._human)
            return
        if message.field == self._motion:
            self._moved = message.stamp
        self.state.put(message.field, self._clock(), content)

    def _make(self) -> Sensed:
        cloud, self._cloud = self._cloud, None
        if cloud is not None:
            self.state.put("points_topic", cloud.stamp / _SECOND, self._bag.decode(cloud))
        try:
            sensed = self.state.sensed()
        except InputError as error:
            stamp = cloud.stamp if cloud else self._now
            raise InputError(f"recording: {self.path}: points at {stamp} ns: {error}") from None
        if sensed.points is not None:
            self._seen = sensed.points
        return sensed._replace(pose=self._pose(), human=self._human or sensed.human)

    def _pose(self) -> Array:
        """Return the pose; odometry of ours says at once that it was lost, transforms that end do not."""
        odometry = self.state.newest("odometry_topic", self.config.pose_age)
        lost = odometry is not None and math.isnan(odometry.pose.pose.position.x)
        return NO_POSE if lost else self.state.pose()


def difference_report(robot: RecordedRobot, good: bool) -> list[str]:
    """Return lines that tell how a robot's commands differ from the recorded ones, and what could not be used.

    Parameters
    ----------
    robot
        At the end of its drive.
    good
        Whether all robots came to the end of the scenario.
    """
    config = robot.config
    compared, (speed, turn), (when, where) = robot.difference
    lines = [f"no commands on {config.command_topic} to compare with"]
    if compared:
        lines = [
            f"largest difference to the recorded commands: linear.x {speed:.3g} m/s at {when:.2f} s, angular.z "
            f"{turn:.3g} rad/s at {where:.2f} s; {compared} ticks compared"
        ]
    if robot.over and not good:
        lines.append("its recording is over before the scenario")
    if config.points_topic and not robot.has_lidar:
        lines.append(f"no points on {config.points_topic}: driven as a robot without LIDAR")
    if robot.state.unplaced:
        lines.append(f"points in {robot.state.unplaced} not used: no transform to {config.body_frame}")
    return [f"{robot.role:<8} {line}" for line in lines]
