"""The simulated robots: what they sense, and what their commands do to them."""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.checks import array, between, count, positive
from mp2a.exceptions import InputError
from mp2a.formation.robot_models import Fleet, RobotModel
from mp2a.simulator.contacts import Contacts
from mp2a.simulator.events import SOLID, EventKind, RobotEvent
from mp2a.simulator.lidar import Lidar, ranges, scan_points
from mp2a.simulator.observation import Observation
from mp2a.simulator.vehicle import TurnSlip, drive_arcs, respond
from mp2a.simulator.world import FARTHEST, World
from mp2a.spatial import Array

HUSKY_TIMEOUT = 0.25
"""s after which Clearpath's controller stops a HUSKY that hears no more commands (ROS Noetic)."""

_LONGEST_STEP = 0.02  # s, as of HUSKY's own controller, which runs at 50 Hz
_SPEEDS, _SIZES, _STEPS = (1e-6, 100.0), (0.01, 100.0), (1e-6, 60.0)  # m/s, m and s; beyond is taken for a mistake
_SAME_CONTACT = 1.0  # s: who meets the same thing again sooner has not been free of it
_DIGITS = 9  # time is told in whole ns, so that ticks do not add up to 0.30000000000000004
_SLACK = 1e-9  # s, rounding of sums of times


class _Scan(NamedTuple):
    number: int
    time: float
    poses: Array
    heard: NDArray[np.bool_]


class Simulation:
    """Skid-steer robots in a world, on plain arrays; the same calls give the same numbers.

    Parameters
    ----------
    world
        Walls and obstacles.
    models
        One for all robots, or one for each.
    poses
        ``(n, 3)`` m, m, rad in the ground frame at time 0.
    lidar
        The sensor of every robot.
    slip
        How much of a commanded turn is left.
    timeout
        s after which a robot that hears no more commands stops.
    seed
        Of the noise of ranges.

    Attributes
    ----------
    time : float
        s
    poses, twists
        ``(n, 3)`` and ``(n, 2)``, as in `Observation`.
    collisions : list of RobotEvent
        All so far, of the kind ``COLLISION``. A contact that lasts, or that comes again within a second, is in it once.

    Raises
    ------
    InputError
        If an argument is not what it has to be, or a robot touches another, a wall or an obstacle from the start.
    """

    def __init__(
        self,
        world: World,
        models: RobotModel | Sequence[RobotModel],
        poses: ArrayLike,
        *,
        lidar: Lidar | None = None,
        slip: TurnSlip | None = None,
        timeout: float = HUSKY_TIMEOUT,
        seed: int = 0,
    ) -> None:
        self.poses: Array = array("poses", poses, (None, 3))
        if (far := np.abs(self.poses[:, :2]) > FARTHEST).any():
            given = self.poses[:, :2][far][0]
            raise InputError(f"poses: got {given:g} m, expected coordinates of at most {FARTHEST:g} m")
        n = count("number of poses", len(self.poses))
        self.models = (models,) * n if isinstance(models, RobotModel) else tuple(models)
        if len(self.models) != n:
            raise InputError(f"models: got {len(self.models)} for {n} poses, expected one for each or one for all")
        for model in dict.fromkeys(self.models):
            between(f"max_speed of {model.name}", model.max_speed, *_SPEEDS, "m/s")
            between(f"length of {model.name}", model.length, *_SIZES, "m")
            between(f"width of {model.name}", model.width, *_SIZES, "m")
        self.world = world
        self.lidar, self._slip = Lidar() if lidar is None else lidar, TurnSlip() if slip is None else slip
        self.lidar.check()
        self._slip.check()
        self._timeout = positive("timeout", timeout)
        self._seed = count("seed", seed, 0)
        self.time = 0.0
        self.twists: Array = np.zeros((n, 2))
        self.collisions: list[RobotEvent] = []
        self._fleet = fleet = Fleet.of(self.models)
        # Nobody drives farther than a quarter of its narrower side in a step, so that none passes through another.
        quarter = np.minimum(fleet.length, fleet.width) / 4
        self._step = min(_LONGEST_STEP, float(np.min(quarter / fleet.max_speed)))
        self._contacts = Contacts(world, fleet.length, fleet.width)
        self._refuse_overlap()
        self._last_met: dict[tuple[int, int], float] = {}
        self._commands: Array = np.zeros((n, 2))
        self._heard: Array = np.full(n, -np.inf)
        self._stepped_from = -np.inf
        self._deaf = np.zeros(n, dtype=bool)
        self._points: list[Array] = [np.empty((0, 2))] * n
        self._stamps: Array = np.full(n, -np.inf)
        self._scans: deque[_Scan] = deque()
        # The sensor has been running before: the robots begin with a scan that has just arrived.
        self._next_scan = -int(np.ceil(self.lidar.delay / self.lidar.period - _SLACK))
        self._scan()

    def __len__(self) -> int:
        """Return the number of robots."""
        return len(self.poses)

    def silence(self, robot: int, silent: bool = True) -> None:
        """Let a robot's LIDAR fall silent from now on, or speak again; ``robot`` counts from 0."""
        if count("robot", robot, 0) >= len(self):
            raise InputError(f"robot: got {robot}, expected less than {len(self)}")
        self._deaf[robot] = silent

    def sense(self) -> Observation:
        """Return what every robot knows now."""
        arrived = []
        while self._scans and self._has_arrived(self._scans[0]):
            arrived.append(self._scans.popleft())
        missing = np.ones(len(self), dtype=bool)
        for scan in reversed(arrived):  # the newest one a robot has heard counts; ranges of older ones are not needed
            new = np.flatnonzero(missing & scan.heard)
            if len(new):
                seen = self._look(scan)
                for i in new:
                    self._points[i] = seen[i]
                self._stamps[new] = scan.time
                missing[new] = False
        arrivals = self._stamps + self.lidar.delay
        return Observation(
            time=self.time,
            poses=self.poses.copy(),
            twists=self.twists.copy(),
            points=list(self._points),
            stamps=self._stamps.copy(),
            arrivals=arrivals,
            new=arrivals > self._stepped_from + _SLACK,
        )

    def in_the_way(self, robot: int, direction: int) -> int | None:
        """Return the number of what is in a robot's stop zone, ahead (``direction`` 1) or behind it (-1).

        That of another robot, that of robots or more for a wall or an obstacle, None if nothing is there.
        """
        return self._contacts.in_the_way(self.poses, robot, direction)

    def step(self, commands: ArrayLike, dt: float = 0.1) -> None:
        """Give commands, and let time pass.

        Parameters
        ----------
        commands
            ``(n, 2)`` m/s and rad/s. With a row of nan the robot hears nothing and keeps to what it heard before, until
            that is older than the timeout.
        dt
            s

        Raises
        ------
        InputError
            If a command is infinite or half nan, or the time is not from 1 µs to 60 s.
        """
        between("dt", dt, *_STEPS, "s")
        self._hear(commands)
        self._stepped_from = self.time
        begin, parts = self.time, int(np.ceil(dt / self._step - _SLACK))
        for k in range(parts):
            self._advance(dt / parts)
            self.time = round(begin + dt * (k + 1) / parts, _DIGITS)
            self._scan()

    def _hear(self, commands: ArrayLike) -> None:
        given = array("commands", commands, (len(self), 2), finite=False)
        none = np.isnan(given)
        bad = np.isinf(given).any(axis=1) | (none[:, 0] != none[:, 1])
        if bad.any():
            i = int(np.flatnonzero(bad)[0])
            raise InputError(
                f"commands: got {given[i].tolist()} for robot {i + 1}, expected finite numbers, or nan for no command"
            )
        new = ~none[:, 0]
        self._commands[new] = given[new]
        self._heard[new] = self.time

    def _advance(self, dt: float) -> None:
        obeyed = (self.time - self._heard <= self._timeout + _SLACK)[:, None]
        targets = np.where(obeyed, np.clip(self._commands, -self._fleet.fastest, self._fleet.fastest), 0.0)
        targets[:, 1] *= self._slip.ratio(self.twists[:, 0])
        motion = respond(self.twists, targets, self._fleet.accelerations, dt)
        self.poses, blocked, pairs = self._contacts.advance(self.poses, motion.mean, dt)
        self.twists = np.where(blocked[:, None], 0.0, motion.end)
        for robot, other in pairs.tolist():
            pair = (min(robot, other), max(robot, other))
            last, self._last_met[pair] = self._last_met.get(pair, -np.inf), self.time
            if self.time - last < _SAME_CONTACT:
                continue
            x, y = self._contacts.place(self.poses, robot, other)
            partner = other if other < len(self) else None
            when, place = round(self.time + dt, _DIGITS), (float(x), float(y))
            self.collisions.append(RobotEvent(when, robot, place, EventKind.COLLISION, partner))

    def _scan(self) -> None:
        while self._next_scan * self.lidar.period <= self.time + _SLACK:
            stamp = self._next_scan * self.lidar.period
            self._scans.append(_Scan(self._next_scan, stamp, self._poses_at(stamp), ~self._deaf))
            self._next_scan += 1
        while len(self._scans) > 1 and self._scans[1].heard.all() and self._has_arrived(self._scans[1]):
            self._scans.popleft()  # nobody will ask for it

    def _has_arrived(self, scan: _Scan) -> bool:
        return scan.time + self.lidar.delay <= self.time + _SLACK

    def _poses_at(self, stamp: float) -> Array:
        """Poses at a time that may lie a fraction of a step back."""
        back = self.time - stamp
        return self.poses.copy() if back <= _SLACK or self.time <= 0 else drive_arcs(self.poses, self.twists, -back)

    def _look(self, scan: _Scan) -> list[Array]:
        measured = ranges(self.lidar, scan.poses, self._fleet.length, self._fleet.width, self.world.segments)
        if self.lidar.noise:
            # Numbered from 1 at the first scan, so that noise does not depend on who senses when.
            number = scan.number + int(np.ceil(self.lidar.delay / self.lidar.period - _SLACK))
            rng = np.random.default_rng((self._seed, number))
            measured = np.maximum(measured + self.lidar.noise * rng.standard_normal(measured.shape), 0.0)
        return scan_points(self.lidar, measured)

    def _refuse_overlap(self) -> None:
        pairs = self._contacts.touching(self.poses)
        if len(pairs):
            i, j = pairs[0]
            what = f"robot {j + 1}" if j < len(self) else SOLID
            raise InputError(f"poses: robot {i + 1} touches {what} at the start, expected robots that stand free")
