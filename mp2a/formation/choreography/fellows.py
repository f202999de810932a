"""Where fellow robots are to be, so that points of theirs push nobody.

A robot knows the leaders of all, and with that where each fellow drives: on its lane, at its distance behind its own
leader. Points there are most likely the fellow. They stop a robot like any other point; but a robot that the force
field turned away from the one in front would leave the column. A robot that is itself off its place, to catch up or
because its wheels slip, minds everybody.
"""

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.choreography.constants import LANE_KEPT, TARGET_TOLERANCE, WINDOW
from mp2a.formation.choreography.follower import Queues, lanes
from mp2a.formation.choreography.leader import Leaders
from mp2a.formation.choreography.places import compose, seen_from
from mp2a.spatial import Array

MEMORY = 5
"""Ticks for which expected places are remembered: LIDAR data are 0.3 s old (thesis, chapter 2), and up to a period."""
_NEAREST = 8
"""Fellows that are looked for among a robot's points."""


def expected(queues: Queues, leaders: Leaders) -> tuple[Queues, Array]:
    """Where robots are to be: on their lanes, at their distance from their leaders.

    Returns
    -------
    tuple
        The queues, and ``(n, 2)`` m in the ground frame: the newest point of a lane that is as far from the leader as
        asked, looked for from the one of a tick ago; without one, the place in the formation.
    """
    place = np.column_stack((leaders.place, np.zeros(len(leaders.place))))
    still = compose(leaders.pose, place)[:, :2]
    if not queues.tail:
        return queues, still
    rows, own, asked = np.arange(len(place)), lanes(leaders), -leaders.place[:, 0]

    def far(k: NDArray[np.intp]) -> NDArray[np.bool_]:
        out: NDArray[np.bool_] = np.hypot(*(queues.points[rows, k] - own).T) >= asked
        return out

    # No further back than what is kept in any case, so that a robot finds the same whomever else it knows.
    oldest = max(queues.tail - LANE_KEPT, 0)
    behind = np.maximum(queues.behind, oldest)
    while (back := ~far(behind) & (behind > oldest)).any():
        behind = behind - back
    while (on := (behind < queues.tail - 1) & far(np.minimum(behind + 1, queues.tail - 1))).any():
        behind = behind + on
    there = np.where(far(behind)[:, None], queues.points[rows, behind], still)
    return queues._replace(behind=behind), there


def strange(points: Array, whose: NDArray[np.intp], poses: Array, memory: Array, sizes: Array) -> NDArray[np.bool_]:
    """Which points are not where a fellow is to be or was a moment ago; all, for a robot that is off its own place.

    Parameters
    ----------
    points
        ``(k, 2)`` m in the frame of the robot that sees them.
    whose
        ``(k,)``: that robot.
    poses
        ``(n, 3)`` of the robots, ground frame; not a number of those that are lost, to whom all is strange.
    memory
        ``(ticks, n, 2)`` m: where robots were to be, oldest first.
    sizes
        ``(n,)`` m from the middle of a robot to its corners.

    Returns
    -------
    numpy.ndarray
        ``(k,)``.
    """
    n = len(poses)
    out = np.ones(len(points), dtype=bool)
    reach = sizes + TARGET_TOLERANCE
    there = memory[-1]
    in_place = np.hypot(*(there - poses[:, :2]).T) < TARGET_TOLERANCE
    away = np.hypot(*np.moveaxis(there[None] - poses[:, None, :2], -1, 0)) - reach
    np.fill_diagonal(away, np.inf)
    near = np.argsort(away, axis=1)[:, : min(_NEAREST, n - 1)]
    for fellow in near.T:  # (n,): a fellow of each robot
        begin, end = (seen_from(poses, memory[k, fellow]) for k in (0, -1))
        close = _distance(points, begin[whose], end[whose]) < reach[fellow[whose]]
        out &= ~(close & (in_place & (away[np.arange(n), fellow] < WINDOW))[whose])
    return out


def _distance(points: Array, begin: Array, end: Array) -> Array:
    """Between points and the straight lines from where a fellow was to where it is, ``(k,)`` m."""
    along = end - begin
    length = (along**2).sum(axis=-1)
    share = ((points - begin) * along).sum(axis=-1) / np.where(length > 0, length, 1.0)
    out: Array = np.hypot(*(points - begin - np.clip(share, 0, 1)[:, None] * along).T)
    return out
