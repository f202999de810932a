"""Robots of a simulation that follow a choreography."""

import numpy as np

from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.constants import QUEUE_RESET_RATIO, TICK
from mp2a.simulator.driver import Ending, SimulationDriver
from mp2a.simulator.observation import Observation
from mp2a.spatial import Array

_STILL = 0.02
"""m/s"""


class ChoreographySimulationDriver(SimulationDriver):
    """Drives the robots of a choreography that are here, all of them or those of one rank.

    Every robot has a copy of the choreography; of the others it knows what its LIDAR sees, and of the leaders what the
    choreography's exchange tells.

    Parameters
    ----------
    choreography
        One that has not begun yet.
    """

    def __init__(self, choreography: Choreography) -> None:
        self.choreography = choreography
        super().__init__(choreography.here)
        self._stands = False
        self._leader_places: list[Array] = []

    @property
    def done(self) -> bool:
        """Whether the robots here have come to their end and stand."""
        dance = self.choreography
        return dance.state.tick >= 0 and self._stands and bool((dance.ended & dance.settled)[self.robots].all())

    @property
    def ending(self) -> Ending:
        """Where the robots here stand with their choreography."""
        dance, mine = self.choreography, self.robots
        direction = np.sign(dance.state.raw_command[mine, 0]).astype(np.intp)
        return Ending(
            dance.state.expected[-1, mine],  # on their lanes, which bend where the leader has turned
            dance.ended[mine],
            tuple(map(dance.state.errors.cause, mine)),
            np.where(dance.blocked[mine], direction, 0),
            np.array(self.leaders),
            self._leader_paths(),
            self.events,
        )

    def _leader_paths(self) -> list[Array]:
        """Return the ways ``(k, 2)`` m of the virtual leaders so far; a new leader begins a new line."""
        if not self._leader_places:
            return []
        ways = np.moveaxis(np.array(self._leader_places), 1, 0)
        lines = []
        for way in np.unique(ways, axis=0):
            line = way[np.append(True, (np.diff(way, axis=0) != 0).any(axis=1))]
            steps = np.hypot(*np.diff(line, axis=0).T)
            lines += np.split(line, np.flatnonzero(steps > 2 * self.choreography.max_speed * TICK) + 1)
        return lines

    def step(self, sensed: Observation) -> Array:
        """Return the commands ``(m, 2)`` of the robots here for what they know; m/s and rad/s."""
        dance, mine = self.choreography, self.robots
        self._stands = bool((np.abs(sensed.twists[:, 0]) < _STILL).all())
        commands = dance.step(sensed.time, sensed.poses, sensed.twists, sensed.news or None, sensed.stamps)
        state, leaders = dance.state, dance.state.leaders
        behind, fine = -leaders.slot[:, 0], ~state.errors.failed
        self.leaders.append(np.column_stack((leaders.points, behind))[mine])
        self._leader_places.append(leaders.pose[:, :2])
        far = state.gap_error > (QUEUE_RESET_RATIO - 1) * behind
        states = (~fine, dance.blocked & fine, np.zeros_like(fine), far & fine)
        self.events += self._changes.events(sensed.time, sensed.poses, [which[mine] for which in states])
        return commands
