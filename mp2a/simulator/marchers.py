"""Robots of a simulation that march by dynamics: LIDAR points go into the scan, setpoints are driven to."""

from typing import Any

import numpy as np

from mp2a.formation import tracking
from mp2a.formation.choreography import obstacles
from mp2a.formation.march import March
from mp2a.formation.odometry import Odometry, into_frame, onto_ground
from mp2a.formation.plane import Complex, point, turn
from mp2a.formation.record import Record, row
from mp2a.formation.robot_models import RobotModel
from mp2a.formation.sensing import pack
from mp2a.simulator.observation import Changes, Event, Observation
from mp2a.spatial import Array

_NEAREST = 8
"""Fellow robots of a rigid shape that may be near enough to be taken for obstacles."""
_NOWHERE = 1e9
"""m"""
_LOST = 1.0
"""m off its setpoint from which on it is told that a robot is far behind."""
_SLACK = 0.15
"""m that a fellow robot may be off the place where it is to be, and is still not taken for an obstacle."""


class Marchers:
    """Some robots of a march, all of them or the one of a rank.

    Each knows its own pose, what its LIDAR sees and what the scan tells it. Where its fellow robots are to be it knows
    from the shape, or of its predecessor from the scan; points of theirs are no obstacles, but stop a robot like any
    other point (thesis, 5.2).

    Parameters
    ----------
    march
        That has not begun yet.
    model
        Of all robots.

    Attributes
    ----------
    events : list of Event
        Stop signals, error states and obstacles that came inside a robot so far.
    leaders : list of ndarray
        ``(m, 3)`` of every step: where each robot was to be, and 0, the distance it was to have from there, m.
    """

    done = False
    """A march goes on until its time is up."""

    def __init__(self, march: March, model: RobotModel) -> None:
        self.march = march
        self.robots = march.exchange.robots
        self.events: list[Event] = []
        self.leaders: list[Array] = []
        m = len(self.robots)
        self._model = model
        self._odometry, self._fellows = Odometry(m), [Odometry(m) for _ in range(len(self._known().T))]
        self._changes = Changes(self.robots)
        self._rows: list[tuple[Any, ...]] = []

    @property
    def record(self) -> Record:
        """Setpoints, forces and displacements of all steps so far."""
        return Record(*(np.array(column) for column in zip(*self._rows, strict=True)))

    def step(self, sensed: Observation) -> Array:
        """Commands ``(m, 2)`` of the robots here for what they know; m/s and rad/s."""
        here, model = sensed.poses, self._model
        self._odometry.add(sensed.time, here)
        for memory, place in zip(self._fellows, self._known().T, strict=True):
            memory.add(sensed.time, np.stack((place.real, place.imag, np.zeros(len(place))), axis=-1))
        then = self._odometry.at(sensed.stamps)
        whose = np.repeat(np.arange(len(here)), [len(points) for points in sensed.points])
        ground = onto_ground(np.concatenate(sensed.points), then[whose])
        sizes = np.full(len(here), model.length), np.full(len(here), model.width)
        seen = obstacles.look(into_frame(ground, here[whose]), whose, *sizes)

        strange = np.ones(len(ground), dtype=bool)
        for memory in self._fellows:
            known = point(memory.at(sensed.stamps))[whose]
            strange &= ~(np.abs(ground - known) < np.hypot(model.length, model.width) / 2 + _SLACK)
        local = into_frame(ground, self.march.state.pose[whose])
        clouds = [local[strange & (whose == k)] if sensed.new[k] else None for k in range(len(here))]
        setpoints = self.march.step(pack(clouds))
        report = self.march.report
        assert report is not None
        self._rows.append(row(sensed.time, self.march, setpoints))

        asked = tracking.commands(setpoints.pose, report.scan.motion.velocity, here)
        stopped = (seen.front & (asked[:, 0] > 0)) | (seen.rear & (asked[:, 0] < 0))
        most = np.array([model.max_speed, model.max_turn_rate])
        out: Array = np.clip(asked, -most, most)
        out[stopped, 0] = 0.0
        out[(seen.left & (out[:, 1] > 0)) | (seen.right & (out[:, 1] < 0)), 1] = 0.0
        out[self.march.state.failed] = 0.0
        self.leaders.append(np.column_stack((setpoints.pose[:, :2], np.zeros(len(here)))))
        failed = self.march.state.failed
        distance = np.full(len(here), np.inf)
        np.minimum.at(distance, whose, np.abs(ground - point(here)[whose]))
        touched, lost = distance < self.march.law.radius, np.abs(point(setpoints.pose) - point(here)) > _LOST
        self.events += self._changes.tell(sensed, failed, stopped & ~failed, touched, lost & ~failed)
        return out

    def _known(self) -> Complex:
        """Where fellow robots are to be, ``(m, k)``, m: the nearest of a rigid shape, in a line the one before.

        Out of the world where there is none.
        """
        state, layout = self.march.state, self.march.formation.layout
        if layout.follows:
            away = state.predecessor[:, None]
        else:
            places = point(layout.poses(np.zeros(3)))
            away = places - places[self.robots][:, None]
            nearest = np.argsort(np.abs(away), axis=1)[:, 1 : 1 + _NEAREST]
            away = np.take_along_axis(away, nearest, axis=1)
        away = np.where(np.isfinite(away), away, _NOWHERE)
        out: Complex = point(state.pose)[:, None] + turn(state.pose[:, 2])[:, None] * away
        return out
