"""Robots of a simulation that dance a choreography: what they sense goes in, commands come out."""

import numpy as np
from numpy.typing import ArrayLike

from mp2a.formation.choreography.constants import CATCH_UP
from mp2a.formation.choreography.follower import lanes
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.odometry import Odometry, into_frame, onto_ground
from mp2a.simulator.observation import Changes, Event, Observation
from mp2a.spatial import Array

_STILL = 0.02
"""m/s"""


class Dance:
    """Some robots of a choreography, all of them or those of one rank.

    Every robot has a copy of the choreography; of the others it knows what its LIDAR sees, and of the leaders what the
    choreography's exchange tells.

    Parameters
    ----------
    choreography
        That has not begun yet.
    robots
        Numbers of those here; None: all.

    Attributes
    ----------
    events : list of Event
        Stop signals, error states and catching up so far.
    leaders : list of ndarray
        ``(m, 3)`` of every step: where each robot's own leader was, and the distance it was to be behind, m.
    """

    def __init__(self, choreography: Choreography, robots: ArrayLike | None = None) -> None:
        n = len(choreography.robots)
        self.choreography = choreography
        self.robots = np.arange(n) if robots is None else np.asarray(robots)
        self.events: list[Event] = []
        self.leaders: list[Array] = []
        self._odometry = Odometry(len(self.robots))
        self._stands = False
        self._changes = Changes(self.robots)

    @property
    def done(self) -> bool:
        """Whether the robots here have come to their end and stand."""
        dance = self.choreography
        return dance.state.tick >= 0 and self._stands and bool((dance.ended & dance.settled)[self.robots].all())

    def step(self, sensed: Observation) -> Array:
        """Commands ``(m, 2)`` of the robots here for what they know; m/s and rad/s."""
        dance, mine = self.choreography, self.robots
        n = len(dance.robots)
        self._odometry.add(sensed.time, sensed.poses)
        self._stands = bool((np.abs(sensed.twists[:, 0]) < _STILL).all())
        then = self._odometry.at(sensed.stamps)
        points: list[Array | None] = [np.empty((0, 2))] * n
        for k, i in enumerate(mine):
            seen = onto_ground(sensed.points[k], then[k])
            points[i] = into_frame(seen, sensed.poses[k]) if sensed.new[k] else None
        poses, twists = np.full((n, 3), np.nan), np.zeros((n, 2))
        poses[mine], twists[mine] = sensed.poses, sensed.twists
        commands = dance.step(sensed.time, poses, twists, points)
        leaders = dance.state.leaders
        self.leaders.append(np.column_stack((lanes(leaders), -leaders.place[:, 0]))[mine])
        state, behind = dance.state, -leaders.place[:, 0]
        fine = ~state.error
        far = state.excess > (CATCH_UP - 1) * behind
        now = (state.error, dance.blocked & fine, np.zeros(n, dtype=bool), far & fine)
        self.events += self._changes.tell(sensed, *(x[mine] for x in now))
        return commands[mine]
