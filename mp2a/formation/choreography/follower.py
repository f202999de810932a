"""The robot's controller: follow the path of one's virtual leader at one's distance (thesis, section 4.3).

Each robot keeps a queue of where its leader has been, moved sideways to the robot's own lane. `Queues` holds all n.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.formation.choreography.force_field import avoidance
from mp2a.formation.choreography.leader import Leaders
from mp2a.formation.constants import (
    GAP_GAIN,
    LEADER_SPEED_SHARE,
    QUEUE_RESET_RATIO,
    STEER_GAIN,
    TARGET_AHEAD,
    TARGET_TOLERANCE,
)
from mp2a.spatial import Array


class Queues(NamedTuple):
    """Queues of n robots: columns ``head`` to ``tail`` of ``points``.

    Attributes
    ----------
    points
        ``(n, capacity, 2)`` m, in the ground frame.
    head
        ``(n,)``: the next point of each robot.
    tail
        One past the newest point, the same for all.
    behind
        ``(n,)``: the point where each robot is to be; for `mp2a.formation.choreography.teammates`.
    """

    points: Array
    head: NDArray[np.intp]
    tail: int
    behind: NDArray[np.intp]

    @property
    def lengths(self) -> NDArray[np.intp]:
        """Points in each queue, ``(n,)``."""
        return self.tail - self.head


def empty(n: int, capacity: int = 256) -> Queues:
    """Return queues without a point."""
    return Queues(np.empty((n, capacity, 2)), np.zeros(n, dtype=np.intp), 0, np.zeros(n, dtype=np.intp))


def enqueue(queues: Queues, points: Array) -> Queues:
    """Add a point ``(n, 2)`` to the end of every queue; points nobody needs any more make room."""
    store, head, tail, behind = queues
    if tail == store.shape[1]:
        oldest = min(int(head.min()), int(behind.min()))
        kept = store[:, oldest:tail]
        capacity = store.shape[1] if 2 * kept.shape[1] <= store.shape[1] else 2 * store.shape[1]
        store = np.empty((len(store), capacity, 2))
        store[:, : kept.shape[1]] = kept
        head, tail, behind = head - oldest, tail - oldest, behind - oldest
    store[:, tail] = points
    return Queues(store, head, tail + 1, behind)


def targets(queues: Queues, leaders: Leaders, poses: Array) -> tuple[Queues, Array, Array]:
    """Choose what each robot drives to, after points it has reached have left its queue.

    A point that is reached takes those before it along: on the inside of a corner that is sharper than the robot is far
    from its leader, the lane runs back in a loop, which a robot that took point after point would drive in reverse, and
    often stay turned round.

    Parameters
    ----------
    queues
        Of all robots.
    leaders
        At this tick.
    poses
        Where the robots are, ``(n, 3)``.

    Returns
    -------
    tuple
        The queues; the targets ``(n, 2)`` in the ground frame; how much farther than wanted each robot is from its
        leader, ``(n,)`` m.
    """
    own = leaders.points
    wanted = -leaders.slot[:, 0]
    gap = np.hypot(*(own - poses[:, :2]).T)
    rows = np.arange(len(poses))
    ahead = np.minimum(queues.head[:, None] + np.arange(TARGET_AHEAD), queues.tail)
    points = queues.points[rows[:, None], np.minimum(ahead, max(queues.tail - 1, 0))]
    reached = np.hypot(*np.moveaxis(points - poses[:, None, :2], -1, 0)) < TARGET_TOLERANCE
    reached &= ahead < queues.tail
    popped = np.where(reached, np.arange(1, TARGET_AHEAD + 1), 0).max(axis=1)
    head = np.where(gap > QUEUE_RESET_RATIO * wanted, queues.tail, queues.head + popped)
    queued = head < queues.tail
    next_points = queues.points[rows, np.minimum(head, max(queues.tail - 1, 0))]
    return queues._replace(head=head), np.where(queued[:, None], next_points, own), gap - wanted


def commands(target: Array, gap_error: Array, stands: NDArray[np.bool_], force: Array, max_speed: float) -> Array:
    """Return the speeds that eq. 4.4 asks for, before any limit.

    Differs from the print in two places: a robot that is more than 1/3 m too close stands instead of driving on
    ever faster (the text says it slows down), and while the leader stands the robot goes to its place and stops there
    (the print drives on at the leader's usual speed).

    Parameters
    ----------
    target
        G, ``(n, 2)`` in the robots' frames, m.
    gap_error
        d_act - d_req, ``(n,)`` m.
    stands
        ``(n,)``: whose leader stands.
    force
        ``(n, 2, 2)``, of `mp2a.formation.choreography.force_field`.
    max_speed
        v_max, of the slowest robot, m/s.

    Returns
    -------
    numpy.ndarray
        ``(n, 2)``, m/s and rad/s.
    """
    side = np.where(target[:, 0] < 0, -1.0, 1.0)
    scale = np.maximum(np.where(stands, 0.0, 1.0) + GAP_GAIN * gap_error, 0.0)
    linear = side * LEADER_SPEED_SHARE * max_speed * scale
    angle = np.arctan2(target[:, 1], np.abs(target[:, 0]))
    angular = STEER_GAIN * side * angle + avoidance(force)
    return np.stack((linear, angular), axis=-1)
