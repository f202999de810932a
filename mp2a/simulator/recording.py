"""What happened in a run, tick by tick; `mp2a.simulator.recording_file` has the files."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.exceptions import InputError
from mp2a.formation.robot_models import RobotModel
from mp2a.simulator.events import RobotEvent, numbered
from mp2a.simulator.observation import Observation
from mp2a.simulator.simulation import Simulation
from mp2a.simulator.world import World
from mp2a.spatial import Array


@dataclass(frozen=True, eq=False)
class Recording:
    """A run of n robots at T times.

    Attributes
    ----------
    times
        ``(T,)`` s.
    poses, twists, commands
        ``(T, n, 3)``, ``(T, n, 2)`` and ``(T, n, 2)`` at those times, as in `Observation`; nan: no command.
    stamps
        ``(T, n)`` s: when the scan was taken that a robot had then.
    counts
        ``(T, n)`` numbers of points of those scans; 0 where a robot still had the one of the row above.
    points
        ``(P, 2)`` m, single precision: all points, by time and robot, in the robot's own frame when the scan was taken.
    leaders
        ``(T, n, 3)`` m: place of what each robot followed, its own virtual leader or its setpoint, in the ground frame,
        and how far it was to be from it; nan: nothing.
    leader_paths
        Lines ``(k, 2)`` m in the ground frame: the leader's path in a march by dynamics, the ways of the virtual
        leaders in a choreography.
    events
        In the order of time.
    roles
        Names of the n robots.
    models
        n robots.
    world
        Where they drove.
    """

    times: Array
    poses: Array
    twists: Array
    commands: Array
    stamps: Array
    counts: NDArray[np.int64]
    points: NDArray[np.float32]
    leaders: Array
    leader_paths: tuple[Array, ...]
    events: tuple[RobotEvent, ...]
    roles: tuple[str, ...]
    models: tuple[RobotModel, ...]
    world: World

    @property
    def gaps(self) -> Array:
        """The distance ``(T, n)`` m from each robot to what it followed; nan: nothing."""
        out: Array = np.hypot(*np.moveaxis(self.leaders[..., :2] - self.poses[..., :2], -1, 0))
        return out

    @cached_property
    def _starts(self) -> NDArray[np.int64]:
        return np.concatenate(([0], np.cumsum(self.counts.reshape(-1))))

    def new_points(self, tick: int, robot: int) -> NDArray[np.float32]:
        """Return the points ``(k, 2)`` that reached a robot at a tick."""
        k = tick * len(self.models) + robot
        return self.points[self._starts[k] : self._starts[k + 1]]


class RunRecorder:
    """Collects a run, and makes a recording of it.

    Parameters
    ----------
    simulation
        The robots that run.
    roles
        Their names; None: R1, R2, …
    points
        Whether to keep what the LIDARs see, which is most of a recording.

    Raises
    ------
    InputError
        If there is not a name for each robot.
    """

    def __init__(self, simulation: Simulation, roles: Sequence[str] | None = None, *, points: bool = True) -> None:
        self._simulation = simulation
        self._roles = numbered(len(simulation)) if roles is None else tuple(roles)
        if len(self._roles) != len(simulation):
            raise InputError(f"roles: got {len(self._roles)} for {len(simulation)} robots, expected one for each")
        self._keep_points = points
        self._rows: list[tuple[Observation, Array]] = []

    def add(self, sensed: Observation, commands: ArrayLike | None) -> None:
        """Add a tick: what the robots knew, and the commands ``(n, 2)`` given then (None: none)."""
        row = np.full((len(self._simulation), 2), np.nan) if commands is None else np.array(commands, dtype=float)
        self._rows.append((sensed, row))

    def recording(
        self,
        leaders: ArrayLike | None = None,
        events: Sequence[RobotEvent] = (),
        leader_paths: Sequence[Array] = (),
    ) -> Recording:
        """Make a recording of all ticks so far.

        Parameters
        ----------
        leaders
            ``(T, n, 3)`` of the first T ticks, see `Recording`.
        events
            Those that are no collisions, which the simulation tells.
        leader_paths
            See `Recording`.

        Raises
        ------
        InputError
            If no tick has been added.
        """
        if not self._rows:
            raise InputError("recording: got no tick, expected at least one")
        sensed, commands = zip(*self._rows, strict=True)
        stamps = np.array([row.stamps for row in sensed])
        fresh = (np.diff(stamps, axis=0, prepend=-np.inf) > 0) & self._keep_points
        counts = np.zeros(stamps.shape, dtype=np.int64)
        clouds = [np.empty((0, 2), dtype=np.float32)]
        for k, i in np.argwhere(fresh):
            clouds.append(sensed[k].points[i].astype(np.float32))
            counts[k, i] = len(clouds[-1])
        followed = np.full((*stamps.shape, 3), np.nan)
        if leaders is not None and len(rows := np.asarray(leaders)):
            followed[: len(rows)] = rows[: len(followed)]
        everything = [*events, *self._simulation.collisions]
        return Recording(
            times=np.array([row.time for row in sensed]),
            poses=np.array([row.poses for row in sensed]),
            twists=np.array([row.twists for row in sensed]),
            commands=np.array(commands),
            stamps=stamps,
            counts=counts,
            points=np.concatenate(clouds),
            leaders=followed,
            leader_paths=tuple(leader_paths),
            events=tuple(sorted(everything, key=lambda event: (event.time, event.robot, event.kind.value))),
            roles=self._roles,
            models=self._simulation.models,
            world=self._simulation.world,
        )
