"""Where the other robots of a choreography are to be, so that points of theirs push nobody.

A robot knows the leaders of all, and with that where each team mate drives: on its lane, at its distance behind its own
leader. A robot that is itself off its place, to catch up or because its wheels slip, minds everybody.
"""

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.choreography.follower import Queues, enqueue
from mp2a.formation.choreography.leader import Leaders
from mp2a.formation.constants import MOST_TEAMMATES, TARGET_TOLERANCE, WINDOW
from mp2a.formation.sensing import is_obstacle
from mp2a.se2 import act_inverse
from mp2a.spatial import Array

EXPECTED_TICKS = 5
"""Ticks for which expected places are remembered: LIDAR data are 0.3 s old (thesis, chapter 2), and up to a period."""
_WAY = 64
"""Points of the way to where a leader starts."""


def lead_in(queues: Queues, leaders: Leaders) -> Queues:
    """Add the way from where robots stand to where their own leaders start: part of their lanes, but no targets."""
    share = np.arange(_WAY)[:, None] / _WAY
    still, own = leaders.slot_poses[:, None, :2], leaders.points[:, None]
    for point in np.moveaxis(still + share * (own - still), 1, 0):
        queues = enqueue(queues, point)
    return queues._replace(head=np.full(len(still), queues.tail))


def expected_places(queues: Queues, leaders: Leaders) -> tuple[Queues, Array]:
    """Return where robots are to be: on their lanes, at their distance from their leaders.

    Along its lane a robot goes on as long as it is as far from its leader as wanted; one that is too close stands, and
    nobody goes back.

    Returns
    -------
    tuple
        The queues, and ``(n, 2)`` m in the ground frame.
    """
    if not queues.tail:
        return queues, leaders.slot_poses[:, :2]
    rows, own, wanted = np.arange(len(leaders.slot)), leaders.points, -leaders.slot[:, 0]

    def far(k: NDArray[np.intp]) -> NDArray[np.bool_]:
        out: NDArray[np.bool_] = np.hypot(*(queues.points[rows, k] - own).T) >= wanted
        return out

    behind, last = queues.behind, queues.tail - 1
    while (on := (behind < last) & far(np.minimum(behind + 1, last))).any():
        behind = behind + on
    return queues._replace(behind=behind), queues.points[rows, behind]


def obstacles_among(
    points: Array, robot: NDArray[np.intp], poses: Array, memory: Array, radius: Array
) -> NDArray[np.bool_]:
    """Return which points are no team mates; all, for a robot that is off its own place.

    Parameters
    ----------
    points
        ``(k, 2)`` m in the frame of the robot that sees them.
    robot
        ``(k,)``: which robot.
    poses
        ``(n, 3)`` of the robots, ground frame; not a number of those that are lost, to whom everything is an obstacle.
    memory
        ``(ticks, n, 2)`` m: where robots were to be, oldest first.
    radius
        ``(n,)`` m from the middle of a robot to its corners.

    Returns
    -------
    numpy.ndarray
        ``(k,)``.
    """
    places, reach = memory[-1], radius + TARGET_TOLERANCE
    in_place = np.hypot(*(places - poses[:, :2]).T) < TARGET_TOLERANCE
    free = np.hypot(*np.moveaxis(places[None] - poses[:, None, :2], -1, 0)) - reach
    np.fill_diagonal(free, np.inf)
    mates = np.argsort(free, axis=1)[:, : min(MOST_TEAMMATES, len(poses) - 1)]
    close = in_place[:, None] & (np.take_along_axis(free, mates, axis=1) < WINDOW)
    begin, end = (act_inverse(poses[:, None], then[mates]) for then in (memory[0], places))
    return is_obstacle(points, robot, begin, end, np.where(close, reach[mates], -1.0))
