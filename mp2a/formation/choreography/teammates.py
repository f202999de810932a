"""Where fellow robots are to be, so that points of theirs push nobody.

A robot knows the leaders of all, and with that where each fellow drives: on its lane, at its distance behind its own
leader. Points there are most likely the fellow. They stop a robot like any other point; but a robot that the force
field turned away from the one in front would leave the column. A robot that is itself off its place, to catch up or
because its wheels slip, minds everybody.
"""

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.choreography.constants import TARGET_TOLERANCE, WINDOW
from mp2a.formation.choreography.follower import Queues, lanes, push, spots
from mp2a.formation.choreography.leader import Leaders
from mp2a.formation.choreography.places import seen_from
from mp2a.spatial import Array

MEMORY = 5
"""Ticks for which expected places are remembered: LIDAR data are 0.3 s old (thesis, chapter 2), and up to a period."""
_WAY = 64
"""Points of the way to where a leader starts."""
_NEAREST = 8
"""Fellows that are looked for among a robot's points."""


def begin(queues: Queues, leaders: Leaders) -> Queues:
    """Add the way from where robots stand to where their own leaders start: part of their lanes, but no targets."""
    share = np.arange(_WAY)[:, None] / _WAY
    still, own = spots(leaders)[:, None, :2], lanes(leaders)[:, None]
    for point in np.moveaxis(still + share * (own - still), 1, 0):
        queues = push(queues, point)
    return queues._replace(head=np.full(len(still), queues.tail))


def expected(queues: Queues, leaders: Leaders) -> tuple[Queues, Array]:
    """Where robots are to be: on their lanes, at their distance from their leaders.

    Along its lane a robot goes on as long as it is as far from its leader as asked; one that is too close stands, and
    nobody goes back.

    Returns
    -------
    tuple
        The queues, and ``(n, 2)`` m in the ground frame.
    """
    if not queues.tail:
        return queues, spots(leaders)[:, :2]
    rows, own, asked = np.arange(len(leaders.place)), lanes(leaders), -leaders.place[:, 0]

    def far(k: NDArray[np.intp]) -> NDArray[np.bool_]:
        out: NDArray[np.bool_] = np.hypot(*(queues.points[rows, k] - own).T) >= asked
        return out

    behind, last = queues.behind, queues.tail - 1
    while (on := (behind < last) & far(np.minimum(behind + 1, last))).any():
        behind = behind + on
    return queues._replace(behind=behind), queues.points[rows, behind]


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
