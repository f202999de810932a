"""A robot out of a recording: it gives what was recorded and drives nowhere, whatever it is told."""

import math
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mp2a.exceptions import InputError
from mp2a.formation.safety import from_cloud
from mp2a.robots.cloud import points as cloud_points
from mp2a.robots.frames import Transforms
from mp2a.robots.interface import NO_POSE, Sensed
from mp2a.robots.odometry import heading
from mp2a.robots.records.bag_reader import BagReader, Message, bag_of
from mp2a.robots.records.bag_topics import topics
from mp2a.robots.steps import EVENTS
from mp2a.robots.table import RobotInterface
from mp2a.spatial import Array

_SECOND = 1_000_000_000
_HUMAN = EVENTS[2]
_TF_KEPT = 10.0
"""s for which a transform to a sensor is believed."""


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
    interface
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
    unplaced : str
        Frame of points that were not used since nobody knows where it is; empty: there are none.
    difference
        Between its commands and those that were recorded so far.

    Raises
    ------
    InputError
        If the recording cannot be read, or does not hold what is needed.
    DependencyError
        If rosbags is not installed.
    """

    def __init__(self, role: str, path: Path, interface: RobotInterface, begin: float | None = None) -> None:
        self.role, self.interface = role, interface
        self._bag = BagReader(bag_of(path, role), topics(interface), role)
        self.path = self._bag.path
        self.has_lidar = bool(self._bag.counts.get("points_topic"))
        self._messages: Iterator[Message] = self._bag.messages()
        self._ahead: deque[Message] = deque()
        self._motion = "twist_topic" if interface.pose == "stamped" else "odometry_topic"
        self._half = round(_SECOND / interface.rate / 2)
        self._transforms = Transforms(self._clock, self._clock)
        self._last: dict[str, tuple[int, Any]] = {}
        self._cloud: Message | None = None
        self._seen: Array = np.empty((0, 2))
        self._human = self.over = False
        self.unplaced = ""
        self.difference = Difference(0, np.zeros(2), np.zeros(2))
        self._time = 0.0
        self._latest = self._moment = self._now = 0
        try:
            self.epoch = self._find_start(begin)
            self._sensed = self._make()
        except InputError:
            self._bag.close()
            raise

    def advance(self, t: float) -> None:
        """Go on to ``t`` s."""
        self._time, self._moment = t, self._near(self.epoch + round(t * _SECOND))
        self._take_until(self._moment)
        self.over = not self._ahead and self._moment > self._latest
        if self.over:
            self._sensed = self._sensed._replace(twist=np.zeros(2), points=self._seen)
        else:
            self._sensed = self._make()

    def sense(self) -> Sensed:
        """Tell what was recorded last."""
        return self._sensed

    def send(self, command: Array) -> None:
        """Compare a command with the one that was recorded last; nothing else comes of it."""
        recorded = self._newest("command_topic", self.interface.patience)
        if recorded is None or self.over:
            return
        compared, largest, times = self.difference
        apart = np.abs(command - _speeds(getattr(recorded, "twist", recorded)))
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
            self._moment = start
            missing = [
                what for what, value in (("pose", self._pose()), ("odometry", self._twist()))
                if not np.isfinite(value).all()
            ]  # fmt: skip
            if not missing:
                return start
            if begin is not None:
                break
        when = "from begin to end" if begin is None else f"{begin:g} s after its first message"
        known = f"; transforms: {self._transforms.known()}" if self.interface.pose == "tf" else ""
        raise InputError(
            f"recording: {self.path}: got no {' and no '.join(missing)} of {self.role} {when}, expected them{known}"
        )

    def _near(self, due: int) -> int:
        """Time of the odometry nearest to when a tick is due, if that is less than half a tick away."""
        while self._pull_up_to(due + self._half):
            pass
        odometry = [message.stamp for message in self._ahead if message.field == self._motion]
        if self._motion in self._last:  # at the start it has been taken already
            odometry.append(self._last[self._motion][0])
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

    def _take(self, message: Message) -> None:
        if message.field == "points_topic":  # decoded only if it is the last one of a tick
            self._cloud = message
            return
        content = self._bag.decode(message)
        if message.field in ("tf", "tf_static"):
            self._now = message.stamp
            for transform in content.transforms:
                self._transforms.put(transform, fixed=message.field == "tf_static")
        elif message.field == "events":
            texts = {f"{self.role} {text}": holds for text, holds in zip(_HUMAN, (True, False), strict=True)}
            self._human = texts.get(content.data, self._human)
        else:
            self._last[message.field] = message.stamp, content

    def _newest(self, field: str, age: float) -> Any:
        """Newest message of a topic, None if it is older than ``age`` s."""
        stamp, content = self._last.get(field, (-math.inf, None))
        return content if self._moment - stamp <= age * _SECOND else None

    def _make(self) -> Sensed:
        by_hand = self._newest("human_topic", self.interface.human_pause) is not None
        return Sensed(self._pose(), self._twist(), self._points(), self._human or by_hand)

    def _pose(self) -> Array:
        interface = self.interface
        message = self._newest("pose_topic" if interface.pose == "stamped" else "odometry_topic", interface.pose_age)
        told = None if message is None else message.pose if interface.pose == "stamped" else message.pose.pose
        if interface.pose != "tf":
            return NO_POSE if told is None else np.array([told.position.x, told.position.y, heading(told.orientation)])
        found = self._transforms.look_up(interface.fixed_frame, interface.body_frame)
        # Odometry of ours says at once that the pose was lost; a transform that is no more sent does not.
        lost = told is not None and math.isnan(told.position.x)
        if found is None or found.age > interface.pose_age or lost:
            return NO_POSE
        return np.array([found.shift[0], found.shift[1], found.heading])

    def _twist(self) -> Array:
        message = self._newest(self._motion, self.interface.pose_age)
        if message is None:
            return np.full(2, np.nan)
        return _speeds(message.twist if self._motion == "twist_topic" else message.twist.twist)

    def _points(self) -> Array | None:
        """Points that are in the way, of the newest scan since the last tick; None if its place is not known."""
        message, self._cloud = self._cloud, None
        if message is None:
            return None
        cloud, body = self._bag.decode(message), self.interface.body_frame
        try:
            found = cloud_points(cloud)
        except InputError as error:
            raise InputError(f"recording: {self.path}: points at {message.stamp} ns: {error}") from None
        mounted = self._transforms.look_up(body, cloud.header.frame_id)
        if mounted is None or mounted.age > _TF_KEPT:
            self.unplaced = cloud.header.frame_id
            return None
        self._seen = from_cloud(mounted.apply(found))
        return self._seen


class RecordedPace:
    """Time that passes as fast as recordings are read; it ends when all of them have.

    Parameters
    ----------
    period
        s a tick.
    robots
        Whose recordings they are.
    """

    def __init__(self, period: float, robots: Sequence[RecordedRobot]) -> None:
        self._period, self._robots, self._tick = period, robots, 0

    def now(self) -> float:
        """Tell the time since the start, s."""
        return self._tick * self._period

    def wait(self, done: bool = False) -> bool:
        """Go on by a tick; returns whether there is no more to come."""
        self._tick += 1
        for robot in self._robots:
            robot.advance(self.now())
        return done or all(robot.over for robot in self._robots)


def report(robot: RecordedRobot, good: bool) -> list[str]:
    """Lines that tell how a robot's commands differ from the recorded ones, and what could not be used.

    Parameters
    ----------
    robot
        At the end of its drive.
    good
        Whether all robots came to the end of the scenario.
    """
    interface = robot.interface
    compared, (speed, turn), (when, where) = robot.difference
    lines = [f"no commands on {interface.command_topic} to compare with"]
    if compared:
        lines = [
            f"largest difference to the recorded commands: linear.x {speed:.3g} m/s at {when:.2f} s, angular.z "
            f"{turn:.3g} rad/s at {where:.2f} s; {compared} ticks compared"
        ]
    if robot.over and not good:
        lines.append("its recording is over before the scenario")
    if interface.points_topic and not robot.has_lidar:
        lines.append(f"no points on {interface.points_topic}: driven as a robot without LIDAR")
    if robot.unplaced:
        lines.append(f"points in {robot.unplaced} not used: no transform to {interface.body_frame}")
    return [f"{robot.role:<8} {line}" for line in lines]


def _speeds(twist: Any) -> Array:
    return np.array([twist.linear.x, twist.angular.z])
