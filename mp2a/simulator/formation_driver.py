"""Robots of a simulation that march by dynamics: LIDAR points go into the scan, setpoints are driven to."""

from typing import Any

import numpy as np

from mp2a.formation.constants import MOST_TEAMMATES
from mp2a.formation.controller import FormationController
from mp2a.formation.pose_history import PoseHistory
from mp2a.formation.record import FormationRecord, record_row
from mp2a.formation.robot_models import Fleet, RobotModel
from mp2a.formation.safety import safe_commands, stop_signals
from mp2a.formation.sensing import is_obstacle, pack
from mp2a.formation.tracking import track
from mp2a.se2 import act, act_inverse, compose, inverse
from mp2a.simulator.driver import Ending, SimulationDriver
from mp2a.simulator.observation import Observation
from mp2a.spatial import Array

_LOST = 1.0
"""m off its setpoint from which on it is told that a robot is far behind."""
_SLACK = 0.15
"""m that a team mate may be off the place where it is to be, and is still not taken for an obstacle."""
_DRAWN = 0.25
"""s between points of the leader's path in a recording."""


class FormationSimulationDriver(SimulationDriver):
    """Drives some robots of a march by dynamics, all of them or the one of a rank.

    Each knows its own pose, what its LIDAR sees and what the scan tells it. Where its team mates are to be it knows
    from the shape, or of its predecessor from the scan; points of theirs are no obstacles, but stop a robot like any
    other point (thesis, 5.2).

    Parameters
    ----------
    march
        One that has not begun yet.
    model
        The model of all robots.
    """

    def __init__(self, march: FormationController, model: RobotModel) -> None:
        self.march = march
        super().__init__(march.exchange.robots)
        self._fleet = Fleet.of([model] * len(self.robots))
        self._history = PoseHistory.empty(len(self.robots))
        self._mates = PoseHistory.empty(self._teammates()[..., 0].size)
        self._rows: list[tuple[Any, ...]] = []
        self._stopped = np.zeros(len(self.robots), dtype=np.intp)

    @property
    def record(self) -> FormationRecord:
        """Setpoints, forces and displacements of all steps so far."""
        return FormationRecord(*(np.array(column) for column in zip(*self._rows, strict=True)))

    @property
    def ending(self) -> Ending:
        """Where the robots here stand with their march; where the path is not known it counts as over."""
        state, path = self.march.state, self.march.path
        over = path is None or (state.ticks - state.departure) * self.march.tick >= path.duration
        here = range(len(self.robots))
        errors, over_all = tuple(map(state.errors.cause, here)), np.full(len(here), over)
        return Ending(
            self._places()[:, :2], over_all, errors, self._stopped, np.array(self.leaders), self._leader_paths(),
            self.events, self.record,
        )  # fmt: skip

    def _leader_paths(self) -> list[Array]:
        """Return the leader's path ``(k, 2)`` m, in its process."""
        path = self.march.path
        if path is None:
            return []
        times = np.append(np.arange(0.0, path.duration, _DRAWN), path.duration)
        return [np.array([path.at(time).pose[:2] for time in times])]

    def step(self, sensed: Observation) -> Array:
        """Return the commands ``(m, 2)`` of the robots here for what they know; m/s and rad/s."""
        here, fleet, m = sensed.poses, self._fleet, len(self.robots)
        mates = self._teammates()
        self._history = self._history.add(sensed.time, here)
        self._mates = self._mates.add(sensed.time, mates.reshape(-1, 3))
        whose = np.repeat(np.arange(m), [len(points) for points in sensed.points])
        ground = act(self._history.at(sensed.stamps)[whose], np.concatenate(sensed.points))
        signals = stop_signals(act_inverse(here[whose], ground), whose, fleet.length, fleet.width)

        then = self._mates.at(np.repeat(sensed.stamps, mates.shape[1])).reshape(mates.shape)[..., :2]
        reach = np.broadcast_to(fleet.radius[:, None] + _SLACK, mates.shape[:2])
        counts = is_obstacle(ground, whose, then, then, reach)
        local = act_inverse(self.march.state.pose[whose], ground)
        clouds = [local[counts & (whose == k)] if sensed.new[k] else None for k in range(m)]
        setpoints = self.march.step(pack(clouds))
        report = self.march.report
        assert report is not None
        self._rows.append(record_row(sensed.time, self.march, setpoints))

        failed = setpoints.failed
        raw = track(setpoints.pose, report.scan.motion.velocity, here)
        stopped = signals.blocked(raw)
        self._stopped = np.where(stopped, np.sign(raw[:, 0]), 0).astype(np.intp)
        self.leaders.append(np.column_stack((setpoints.pose[:, :2], np.zeros(m))))
        distance = np.full(m, np.inf)
        np.minimum.at(distance, whose, np.hypot(*(ground - here[whose, :2]).T))
        lost = np.hypot(*(setpoints.pose - here)[:, :2].T) > _LOST
        states = (failed, stopped & ~failed, distance < self.march.law.radius, lost & ~failed)
        self.events += self._changes.events(sensed.time, here, states)
        return safe_commands(raw, fleet.fastest, signals, failed)

    def _places(self) -> Array:
        """Return where the robots here were to be if obstacles did not push them, ``(m, 3)``."""
        state, report = self.march.state, self.march.report
        pose = state.pose if report is None else report.scan.motion.pose  # that of a robot that failed goes on, too
        return compose(pose, inverse(state.displacement.value))

    def _teammates(self) -> Array:
        """Return where team mates are to be, ``(m, c, 3)``: the nearest of a rigid shape, in a line the one before.

        Not a number where there is none; headings are 0.
        """
        state, layout = self.march.state, self.march.formation.layout
        if layout.follows:
            away = state.predecessor[:, None]
        else:
            slots = layout.poses(np.zeros(3))[:, :2]
            offsets = slots - slots[self.robots][:, None]
            nearest = np.argsort(np.hypot(*np.moveaxis(offsets, -1, 0)), axis=1)[:, 1 : 1 + MOST_TEAMMATES]
            away = np.take_along_axis(offsets, nearest[..., None], axis=1)
        places = act(state.pose[:, None], away)
        return np.concatenate((places, np.zeros((*places.shape[:-1], 1))), axis=-1)
