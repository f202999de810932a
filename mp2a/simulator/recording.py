"""What happened in a run, tick by tick, in memory and in files."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.exceptions import InputError
from mp2a.formation.robot_models import RobotModel
from mp2a.simulator.observation import Event, Observation
from mp2a.simulator.simulation import Collision, Simulation
from mp2a.simulator.world import World
from mp2a.spatial import Array

_FORMAT = 2
_ARRAYS = 8  # fields of a recording that are arrays


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
    events
        In the order of time.
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
    events: tuple[Event, ...]
    models: tuple[RobotModel, ...]
    world: World

    @property
    def gaps(self) -> Array:
        """``(T, n)`` m from each robot to what it followed; nan: nothing."""
        out: Array = np.hypot(*np.moveaxis(self.leaders[..., :2] - self.poses[..., :2], -1, 0))
        return out

    @cached_property
    def _starts(self) -> NDArray[np.int64]:
        return np.concatenate(([0], np.cumsum(self.counts.reshape(-1))))

    def new_points(self, tick: int, robot: int) -> NDArray[np.float32]:
        """Points ``(k, 2)`` that reached a robot at a tick."""
        k = tick * len(self.models) + robot
        return self.points[self._starts[k] : self._starts[k + 1]]

    def save(self, path: str | Path) -> Path:
        """Write it to a file whose ending tells the kind: ``.npz`` for numpy, ``.mcap`` for Foxglove.

        Parameters
        ----------
        path
            Its folder is created.

        Returns
        -------
        Path
            The same.

        Raises
        ------
        InputError
            If the ending is another.
        DependencyError
            If it is ``.mcap`` and foxglove-sdk is not installed.
        """
        out = Path(path)
        if out.suffix not in (".npz", ".mcap"):
            raise InputError(f"path: got '{out.name}', expected a name that ends in .npz or .mcap")
        out.parent.mkdir(parents=True, exist_ok=True)
        if out.suffix == ".mcap":
            from mp2a.simulator.mcap import write

            write(self, out)
        else:
            with out.open("wb") as file:
                np.savez_compressed(file, format=_FORMAT, **self._arrays())
        return out

    @classmethod
    def load(cls, path: str | Path) -> "Recording":
        """Read what `save` wrote as ``.npz``.

        Raises
        ------
        InputError
            If the file cannot be read or is no recording.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                return cls._from_arrays(file)
        except Exception as error:  # there is no end to what zipfile and numpy raise for a broken file
            raise InputError(f"{path}: cannot be read as a recording ({error})") from error

    def _arrays(self) -> dict[str, Any]:
        plain = {f.name: getattr(self, f.name) for f in fields(self)[:_ARRAYS]}
        outlines = [*self.world.walls, *self.world.obstacles]
        names, *figures = zip(*map(astuple, self.models), strict=True)
        return {
            **plain,
            "event_times": np.array([event.time for event in self.events], dtype=float),
            "event_robots": np.array([event.robot for event in self.events], dtype=int),
            "event_places": np.array([event.place for event in self.events], dtype=float).reshape(-1, 2),
            "event_texts": np.array([event.text for event in self.events], dtype=str),
            "model_names": np.array(names, dtype=str),
            "model_figures": np.array(figures, dtype=float).T,
            "world_name": np.array(self.world.name),
            "world_walls": len(self.world.walls),
            "world_sizes": np.array([len(line) for line in outlines], dtype=int),
            "world_corners": np.concatenate([np.empty((0, 2)), *outlines]),
        }

    @classmethod
    def _from_arrays(cls, file: Any) -> "Recording":
        if int(file["format"]) != _FORMAT:
            raise ValueError(f"format {int(file['format'])}, expected {_FORMAT}")
        plain = {f.name: file[f.name] for f in fields(cls)[:_ARRAYS]}
        ticks, n = plain["stamps"].shape
        shapes = [plain[name].shape for name in ("times", "poses", "twists", "commands", "counts", "leaders")]
        if shapes != [(ticks,), (ticks, n, 3), (ticks, n, 2), (ticks, n, 2), (ticks, n), (ticks, n, 3)]:
            raise ValueError(f"arrays of {ticks} times and {n} robots have shapes {shapes}")
        if plain["points"].shape != (plain["counts"].sum(), 2):
            raise ValueError(f"{plain['counts'].sum()} points have shape {plain['points'].shape}")
        columns = [file[f"event_{name}"].tolist() for name in ("times", "robots", "places", "texts")]
        events = tuple(Event(t, i, (x, y), text) for t, i, (x, y), text in zip(*columns, strict=True))
        figures = zip(file["model_names"].tolist(), file["model_figures"].tolist(), strict=True)
        models = tuple(RobotModel(name, *row) for name, row in figures)
        if len(models) != n:
            raise ValueError(f"{len(models)} models of {n} robots")
        ends, walls = np.cumsum(file["world_sizes"]), int(file["world_walls"])
        outlines = np.split(file["world_corners"], ends)[: len(ends)]
        world = World(outlines[:walls], outlines[walls:], str(file["world_name"]))
        return cls(**plain, events=events, models=models, world=world)


class Recorder:
    """Collects a run, and makes a recording of it.

    Parameters
    ----------
    simulation
        Whose run.
    points
        Whether to keep what the LIDARs see, which is most of a recording.

    Attributes
    ----------
    events : list of Event
        For what else is worth telling; collisions come by themselves.
    """

    def __init__(self, simulation: Simulation, *, points: bool = True) -> None:
        self._simulation = simulation
        self._keep_points = points
        self._rows: list[tuple[Observation, Array]] = []
        self.events: list[Event] = []

    def add(self, sensed: Observation, commands: ArrayLike | None) -> None:
        """Add a tick: what the robots knew, and the commands ``(n, 2)`` given then (None: none)."""
        given = np.full((len(self._simulation), 2), np.nan) if commands is None else np.array(commands, dtype=float)
        self._rows.append((sensed, given))

    def recording(self, leaders: ArrayLike | None = None, events: Sequence[Event] = ()) -> Recording:
        """Make a recording of all ticks so far; at least one.

        Parameters
        ----------
        leaders
            ``(T, n, 3)`` of the first T ticks, see `Recording`.
        events
            That are not in `events`.
        """
        if not self._rows:
            raise InputError("recording: got no tick, expected at least one")
        sensed, commands = zip(*self._rows, strict=True)
        stamps = np.array([row.stamps for row in sensed])
        fresh = (np.diff(stamps, axis=0, prepend=-np.inf) > 0) & self._keep_points
        counts = np.zeros(stamps.shape, dtype=np.int64)
        kept = [np.empty((0, 2), dtype=np.float32)]
        for k, i in np.argwhere(fresh):
            kept.append(sensed[k].points[i].astype(np.float32))
            counts[k, i] = len(kept[-1])
        followed = np.full((*stamps.shape, 3), np.nan)
        if leaders is not None and len(given := np.asarray(leaders)):
            followed[: len(given)] = given[: len(followed)]
        return Recording(
            times=np.array([row.time for row in sensed]),
            poses=np.array([row.poses for row in sensed]),
            twists=np.array([row.twists for row in sensed]),
            commands=np.array(commands),
            stamps=stamps,
            counts=counts,
            points=np.concatenate(kept),
            leaders=followed,
            events=tuple(sorted([*self.events, *events, *_told(self._simulation.collisions)])),
            models=self._simulation.models,
            world=self._simulation.world,
        )


def _told(collisions: Sequence[Collision]) -> list[Event]:
    return [Event(found.time, found.robot, found.place, str(found)) for found in collisions]
