"""The virtual leaders, one a robot, and the controllers that drive them (thesis, section 4.2).

They follow from the scenario and the clock alone. So either every robot works out its own, and robots with the same
clock agree without a message, as in the thesis; or one robot does, and `mp2a.formation.choreography.leader_broadcast`
takes their motion to the others. Here all n are arrays; nothing depends on where the robots really are.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.choreography.program import CIRCLE, END, MEET, MOVE, SHAPE, LeaderProgram
from mp2a.formation.constants import (
    ARC_GAIN,
    LEADER_LEAD,
    LEADER_LEAST_SPEED,
    LEADER_MOST_TURN,
    LEADER_SPEED_GAIN,
    LEADER_SPEED_SHARE,
    LEADER_TURN_GAIN,
    NEW_LEADER_PAUSE,
    TICK,
    WAYPOINT_TOLERANCE,
)
from mp2a.se2 import act, act_inverse, compose, drive, mean_heading, wrap
from mp2a.spatial import Array


class Leaders(NamedTuple):
    """What robots know of their virtual leaders at a tick.

    Attributes
    ----------
    pose
        ``(n, 3)`` in the ground frame.
    twist
        ``(n, 2)`` forward speed and turn rate until the next tick, m/s and rad/s; zero while it stands.
    step
        ``(n,)`` of the program.
    slot
        ``(n, 2)``: where the robot is to be, seen from its leader, m.
    """

    pose: Array
    twist: Array
    step: NDArray[np.intp]
    slot: Array

    @property
    def stands(self) -> NDArray[np.bool_]:
        """Which leaders do not move until the next tick."""
        out: NDArray[np.bool_] = ~np.logical_or.reduce(self.twist != 0, axis=1)
        return out

    @property
    def points(self) -> Array:
        """Each robot's own leader: its virtual leader, moved sideways to the robot's lane, ``(n, 2)`` m."""
        side = np.zeros_like(self.slot)
        side[:, 1] = self.slot[:, 1]
        return act(self.pose, side)

    @property
    def slot_poses(self) -> Array:
        """Poses of the robots' slots in the ground frame, ``(n, 3)`` m and rad."""
        return _with_heading(act(self.pose, self.slot), self.pose[:, 2])


class Course(NamedTuple):
    """What is remembered of the leaders from tick to tick by who works them out.

    Attributes
    ----------
    leaders
        At this tick.
    frame
        ``(n, 3)``: where the present step of the scenario begins if everything goes as written.
    swept
        ``(n,)`` rad of the present arc that are done.
    since
        ``(n,)`` s: when the present step began.
    """

    leaders: Leaders
    frame: Array
    swept: Array
    since: Array


def waypoint_twist(target: Array, max_speed: float) -> Array:
    """Return the twist towards a waypoint (eq. 4.1).

    Parameters
    ----------
    target
        ``(..., 2)`` in the leader's frame, m.
    max_speed
        Of the slowest robot, m/s.

    Returns
    -------
    numpy.ndarray
        ``(..., 2)``, m/s and rad/s.
    """
    x, y = target[..., 0], target[..., 1]
    speed = np.clip(LEADER_SPEED_GAIN * x, LEADER_LEAST_SPEED, LEADER_SPEED_SHARE * max_speed)
    # A waypoint straight behind is turned to on the left; rounding shall not choose the side.
    angle = np.arctan2(np.where(np.abs(y) < 1e-9, 0.0, y), x)
    return np.stack((speed, np.clip(LEADER_TURN_GAIN * angle, -LEADER_MOST_TURN, LEADER_MOST_TURN)), axis=-1)


def arc_rate(radius: Array, rate: Array, max_speed: float) -> Array:
    """Return the turn rate of an arc, halved until the leader's speed is within its limit (chapter 6, eq. 6.1)."""
    excess = np.maximum(np.abs(rate * radius) / (LEADER_SPEED_SHARE * max_speed), 1.0)
    out: Array = rate * 0.5 ** np.ceil(np.log2(excess) - 1e-9)  # rounding shall not halve it
    return out


def arc_twist(radius: Array, rate: Array, distance: Array) -> Array:
    """Return the twist along an arc (eq. 4.3), with the size of the radius where the thesis prints the signed one.

    Parameters
    ----------
    radius
        ``(...,)`` m, positive to the left.
    rate
        ``(...,)`` turn rate the leader can keep, rad/s.
    distance
        ``(...,)`` to the centre of the arc at present, m.

    Returns
    -------
    numpy.ndarray
        ``(..., 2)``, m/s and rad/s.
    """
    size = np.abs(radius)
    turn = np.sign(radius) * rate * (1.0 - ARC_GAIN * (size - distance))
    return np.stack((rate * size, np.clip(turn, -LEADER_MOST_TURN, LEADER_MOST_TURN)), axis=-1)


def start(program: LeaderProgram, poses: Array | None) -> Course:
    """Return the leaders before the scenario begins: at the origin, or in front of robots at ``poses`` ``(n, 3)``."""
    n = len(program)
    slot = program.values[:, 0, :2].copy()
    pose = np.zeros((n, 3))
    if poses is not None:
        # The robots of one leader stand where they stand; it is in the mean of where each of them sees it.
        own = _with_heading(poses[:, :2], mean_heading(poses[:, 2]))
        pose[:] = _with_heading(act(own, -slot), own[:, 2]).mean(axis=0)
    zero = np.zeros(n)
    leaders = Leaders(pose, np.zeros((n, 2)), np.zeros(n, dtype=np.intp), slot)
    return Course(leaders, pose.copy(), zero, zero)


def advance(program: LeaderProgram, course: Course, time: float, max_speed: float) -> Course:
    """Return the leaders one tick on.

    Parameters
    ----------
    program
        What they do.
    course
        At the tick before; the leaders' twist takes them here.
    time
        Of the tick, s.
    max_speed
        Of the slowest robot, m/s.

    Returns
    -------
    Course
        At ``time``, with the twist for the tick to come.
    """
    leaders = course.leaders
    leaders = leaders._replace(pose=compose(leaders.pose, drive(leaders.twist, TICK)))
    swept = _swept(program, course, leaders.pose)
    course = _finish_steps(program, course._replace(leaders=leaders, swept=swept), time)
    twist = _twist(program, course, max_speed)
    return course._replace(leaders=course.leaders._replace(twist=twist))


def _with_heading(points: Array, heading: Array | float) -> Array:
    """Return poses ``(n, 3)`` at points ``(n, 2)``."""
    return np.column_stack((points, np.broadcast_to(heading, len(points))))


def _now(program: LeaderProgram, step: NDArray[np.intp]) -> tuple[NDArray[np.intp], Array]:
    robots = np.arange(len(program))
    return program.kind[robots, step], program.values[robots, step]


def _ends(kind: NDArray[np.intp], values: Array, frame: Array) -> Array:
    """Return where the present steps end as written, ``(n, 3)``; as they began, of those that do not move."""
    distance, angle = values[:, 0], values[:, 1]
    straight = np.stack((distance * np.cos(angle), distance * np.sin(angle), angle), axis=-1)
    side = np.sign(distance)
    bend = np.stack((np.abs(distance) * np.sin(angle), distance * (1 - np.cos(angle)), side * angle), axis=-1)
    moving = np.where((kind == MOVE)[:, None], straight, np.where((kind == CIRCLE)[:, None], bend, 0.0))
    return compose(frame, moving)


def _from_centre(frame: Array, radius: Array, pose: Array) -> tuple[Array, Array]:
    """Return the distance to the centre of an arc, and how far along it, rad in [-π, π)."""
    inner = act_inverse(frame, pose[:, :2])
    across, ahead = inner[:, 1] - radius, inner[:, 0]
    # Seen from the centre the arc begins at -radius on the y axis and runs forward.
    along = np.arctan2(ahead, -across * np.sign(radius))
    return np.hypot(ahead, across), along


def _swept(program: LeaderProgram, course: Course, pose: Array) -> Array:
    kind, values = _now(program, course.leaders.step)
    _, along = _from_centre(course.frame, np.where(kind == CIRCLE, values[:, 0], 1.0), pose)
    return np.where(kind == CIRCLE, course.swept + wrap(along - course.swept), 0.0)


def _finish_steps(program: LeaderProgram, course: Course, time: float) -> Course:
    """Go on to the next step wherever one is done, as often as needed."""
    for _ in range(program.kind.shape[1]):
        kind, values = _now(program, course.leaders.step)
        end = _ends(kind, values, course.frame)
        near = np.hypot(*(end - course.leaders.pose)[:, :2].T) <= WAYPOINT_TOLERANCE
        moved = ((kind == MOVE) & near) | ((kind == CIRCLE) & (course.swept >= values[:, 1]))
        shaped = kind == SHAPE
        course, met = _meet(program, course, kind, time)
        done = moved | shaped | met
        if not done.any():
            break
        leaders = course.leaders
        slot = np.where((shaped | met)[:, None], values[:, :2], leaders.slot)
        course = Course(
            leaders._replace(step=leaders.step + done, slot=slot),
            frame=np.where(moved[:, None], end, course.frame),
            swept=np.where(done, 0.0, course.swept),
            since=np.where(done, time, course.since),
        )
    return course


def _meet(
    program: LeaderProgram, course: Course, kind: NDArray[np.intp], time: float
) -> tuple[Course, NDArray[np.bool_]]:
    """Give new leaders to the formations whose robots are all there and have stood long enough."""
    met = np.zeros(len(program), dtype=bool)
    waiting = kind == MEET
    if not waiting.any():
        return course, met
    leaders = course.leaders
    meeting = np.where(waiting, program.meeting[np.arange(len(program)), leaders.step], -1)
    pose, frame = leaders.pose.copy(), course.frame.copy()
    for which in np.unique(meeting[waiting]):
        members = program.members[which]
        ready = (meeting[members] == which).all() and time - course.since[members].max() >= NEW_LEADER_PAUSE - 1e-9
        if ready:
            met[members] = True
            pose[members] = frame[members] = new_leader(course, members, program.first_rows[which])
    return course._replace(leaders=leaders._replace(pose=pose), frame=frame), met


def new_leader(course: Course, members: NDArray[np.intp], first_row: NDArray[np.intp]) -> Array:
    """Return the pose of a new leader: in front of the first row it is to have, in the middle of all (chapter 6).

    Robots count where they should be, which every one of them knows of all. The heading is the scenario's, so that an
    angle left over from the last waypoint does not turn what follows.
    """
    leaders = course.leaders
    old = _with_heading(leaders.pose[:, :2], course.frame[:, 2])
    turned = np.array([0.0, 0.0, mean_heading(course.frame[members, 2])])
    inner = act_inverse(turned, act(old, leaders.slot))
    ahead = inner[first_row, 0].max() + LEADER_LEAD
    across = (inner[members, 1].max() + inner[members, 1].min()) / 2
    return compose(turned, np.array([ahead, across, 0.0]))


def _twist(program: LeaderProgram, course: Course, max_speed: float) -> Array:
    kind, values = _now(program, course.leaders.step)
    end = _ends(kind, values, course.frame)
    straight = waypoint_twist(act_inverse(course.leaders.pose, end[:, :2]), max_speed)
    radius = np.where(kind == CIRCLE, values[:, 0], 1.0)
    distance, _ = _from_centre(course.frame, radius, course.leaders.pose)
    bend = arc_twist(radius, arc_rate(radius, values[:, 2], max_speed), distance)
    moving = np.where((kind == MOVE)[:, None], straight, bend)
    return np.where(((kind == END) | (kind == MEET))[:, None], 0.0, moving)
