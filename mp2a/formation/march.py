r"""The march: what every robot does at a tick, and the one place where it hears of the others.

1. Where to. The leader: its path at this time. In a rigid shape the others: their place from the one they hang on. In a
   line: the place a spacing back on the queue of where the predecessor went (`mp2a.formation.trail`). To this the
   displacement of the robot's own virtual joint is added.
2. The scan: inverse dynamics of all planar joints. It gives each robot its pose, velocity and acceleration in the
   ground frame, the force F in its joint, and the part of it that obstacles cause.
3. The joint yields to that part (`mp2a.formation.springs`); the next tick starts from there.
4. The setpoint is the scan's pose and velocity.

A joint yields to the forces on those robots that it moves at this instant. In a rigid shape these are all that hang on
it: forces add up towards the leader, motion is carried outwards. In a line it is the robot itself; those behind come
along the changed path when they get there.

In a line, joint coordinates relative to the predecessor need its place at this very tick. The scan cannot tell it in
time: it gives robot i the product of all joints up to its own, from which nothing can be learnt about the last of them
that is not known of the others, and with a value of one tick ago the headings of a long chain do not fit together (an
error of 1 mrad at its head is half a metre 500 m behind, and grows from robot to robot). So each robot hands its plan
for the tick to the one behind it, nine numbers in one message, before the scan.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.checks import array
from mp2a.exceptions import InputError
from mp2a.formation import obstacles, sensing, springs, trail
from mp2a.formation.exchange import Exchange, OneProcess, Scan, scan
from mp2a.formation.formation import Formation
from mp2a.formation.obstacles import ObstacleLaw
from mp2a.formation.paths import Path
from mp2a.formation.plane import Motion, at_rest, before, between, beyond, point, turn, wrap
from mp2a.formation.sensing import Sensed
from mp2a.formation.setpoints import Setpoints
from mp2a.formation.springs import Displacement, Springs, solve
from mp2a.formation.trail import Trail
from mp2a.spatial import Array

TICK = 0.1
"""s, the 10 Hz of the robots' sensors and queues (thesis, 4.3)."""
SILENCE = 0.3
"""s without a word from the sensor after which a robot is in its error state (thesis, 5.1)."""
CATCH_UP = 0.2
"""m/s by which a follower that is too far behind is faster than its predecessor."""
_KNOWN = 1.25
"""Points closer to the predecessor's place than this many radii of a robot are the predecessor."""


class State(NamedTuple):
    """All that the m robots of this process remember from tick to tick."""

    ticks: int
    """Done so far."""
    departure: int
    """Tick at which the leader's path began."""
    displacement: Displacement
    """Of the virtual joints, ``(m, 3)`` each, in the axes of the undisplaced places."""
    trail: Trail
    """Queues of positions; used in a line only."""
    pose: Array
    """Where the robots were told to be, ``(m, 3)``, ground frame."""
    predecessor: NDArray[np.complex128]
    """Its place in the robot's own frame, ``(m,)``, m; infinite for the leader."""
    push: Array
    """Last force of obstacles, ``(m, 2)``, N, in the robot's frame."""
    silent: NDArray[np.intp]
    """Ticks since the sensor said something, ``(m,)``."""
    failed: NDArray[np.bool_]
    """``(m,)``: in the error state, for good."""


class Report(NamedTuple):
    """What is known of a tick besides the setpoints, for the m robots of this process."""

    scan: Scan
    """Motion, force in the joint, and the obstacles' part of it."""
    push: Array
    """Force of obstacles on the robot itself, ``(m, 2)``, N, in its frame."""
    contact: NDArray[np.bool_]
    """``(m,)``: whether an obstacle is inside the robot's radius. The push is finite all the same; whether to stop is
    for the robot's own safety to say, since one that stands does not get away."""
    work: Array
    """Of the forces on the virtual joints over the tick to come, ``(m,)``, J."""


class March:
    """A formation on the march, tick by tick; the same in one process and on each of many ranks.

    Parameters
    ----------
    formation
        Shape and robots, the same on every rank.
    path
        What the leader is to drive; known to the leader's process alone, and ignored in others. None: it stands until
        `lead` gives it one.
    exchange
        How the robots of this process reach the others. None: all are here.
    springs
        Virtual joints.
    law
        Force of obstacles.
    tick
        s between steps.
    start
        Poses ``(n, 3)`` at the beginning, the same on every rank. None: in shape, the leader at the path's start. In a
        line any place will do, see `mp2a.formation.trail.begin`; else robots go to their places as their springs pull.

    Attributes
    ----------
    state
        What the robots of this process remember. Assign one from before to go back to it.
    report
        Of the last step, or None.

    Raises
    ------
    InputError
        If ``tick`` or ``start`` is not what it has to be.

    Examples
    --------
    >>> from mp2a.formation import Formation, March, waypoints
    >>> march = March(Formation.of("line", 3), waypoints([[0, 0], [10, 0]]))
    >>> for _ in range(300):
    ...     setpoints = march.step()
    >>> setpoints.pose.round(6).tolist()
    [[10.0, 0.0, 0.0], [8.0, 0.0, 0.0], [6.0, 0.0, 0.0]]
    """

    def __init__(
        self,
        formation: Formation,
        path: Path | None = None,
        exchange: Exchange | None = None,
        *,
        springs: Springs | None = None,
        law: ObstacleLaw | None = None,
        tick: float = TICK,
        start: ArrayLike | None = None,
    ) -> None:
        if not 0 < tick < np.inf:
            raise InputError(f"tick: got {tick!r}, expected a positive number of seconds")
        self.formation = formation
        self.path = path
        self.exchange = exchange or OneProcess(formation.model)
        self.springs = springs or Springs()
        self.law = law or ObstacleLaw()
        self.tick = float(tick)
        self.report: Report | None = None
        robots = self.exchange.robots
        self._leads = formation.layout.parents[robots] < 0
        self._places = formation.layout.places[robots]
        self._spacings = formation.spacings[robots]
        self._step = solve(self.springs, self.tick)
        places = None if start is None else array("start", start, (len(formation), 3))
        self._post = np.zeros(3) if places is None else places[0]
        self.state = self._begin(places)

    @property
    def time(self) -> float:
        """Of the next step, s."""
        return self.state.ticks * self.tick

    def lead(self, path: Path) -> None:
        """Give the leader a path that begins at the next step; to be called in its process alone, when it stands.

        The path may begin somewhere else than where the leader is: its virtual joint takes up the difference.
        """
        self.path = path
        away = between(at_rest(path.at(0.0).pose), at_rest(self.state.pose)).pose
        rest = springs.none(len(away))._replace(value=self._loose(away))
        mixed = (np.where(self._leads[:, None], x, y) for x, y in zip(rest, self.state.displacement, strict=True))
        self.state = self.state._replace(departure=self.state.ticks, displacement=Displacement(*mixed))

    def step(self, sensed: Sensed | None = None) -> Setpoints:
        """Do a tick; collective where the robots are on ranks.

        Parameters
        ----------
        sensed
            Points that the robots of this process have sensed since the last tick, each in its own frame. None: all
            sensors see nothing. A sensor that says nothing leaves the last force in place; after `SILENCE` its robot is
            in the error state: its setpoint is to stand where it is, for good, and nothing pushes it any more. The
            formation goes on as if it were there.

        Returns
        -------
        Setpoints
            Of the robots of this process, for this tick's time.

        Raises
        ------
        InputError
            On every rank, if what a robot has sensed is malformed.
        """
        state, m = self.state, len(self._leads)
        wrong: InputError | None = None
        try:
            given = sensing.nothing(m) if sensed is None else sensing.check(sensed, m)
        except InputError as error:
            given, wrong = sensing.nothing(m), error
        silent = np.where(given.heard, 0, state.silent + 1)
        failed = state.failed | (silent * self.tick > SILENCE - 1e-9)
        push, contact = self._push(given, failed)

        target, queue = self._target()
        own = beyond(target, Motion(*springs.joint(state.displacement)))
        joints = own
        if self.formation.layout.follows:
            told = self.exchange.send_to_children(np.concatenate(own, axis=-1))
            joints = between(Motion(told[:, :3], told[:, 3:6], told[:, 6:]), own)
        external = np.concatenate((push, np.zeros((m, 1))), axis=-1)
        found = scan(self.exchange, joints, external, wrong)

        load = found.obstacles
        if self.formation.layout.follows:
            load, queue = external, trail.extend(queue, before(found.motion, joints))
        displacement, work = self._yield(load)
        pose = np.where(failed[:, None], state.pose, found.motion.pose)
        self.state = State(
            state.ticks + 1,
            state.departure,
            displacement,
            queue,
            pose,
            self._seen(joints),
            push,
            silent,
            failed,
        )
        self.report = Report(found, push, contact, work)
        goes = ~failed
        return Setpoints(
            pose,
            found.motion.velocity[:, 0] * goes,
            found.motion.velocity[:, 2] * goes,
            found.motion.rate[:, [0, 2]] * goes[:, None],
            failed,
        )

    def _begin(self, start: Array | None) -> State:
        """Poses of the first tick, from a scan of the formation at rest."""
        layout, robots = self.formation.layout, self.exchange.robots
        m = len(robots)
        rest = self._at_path(at_rest(self._places), 0.0)
        places = at_rest(rest.pose)
        if start is not None:
            parents = layout.parents[robots]
            ground = np.where(self._leads[:, None], 0.0, start[parents])
            places = between(at_rest(ground), at_rest(start[robots]))
        found = scan(self.exchange, places, np.zeros((m, 3)), None)
        pose = found.motion.pose
        away = self._loose(between(at_rest(rest.pose), places).pose)
        free = self._leads if layout.follows else np.ones(m, dtype=bool)
        displacement = springs.none(m)._replace(value=np.where(free[:, None], away, 0.0))
        return State(
            ticks=0,
            departure=0,
            displacement=displacement,
            trail=trail.begin(pose, before(found.motion, places).pose, self._reach()),
            pose=pose,
            predecessor=self._seen(places),
            push=np.zeros((m, 2)),
            silent=np.zeros(m, dtype=np.intp),
            failed=np.zeros(m, dtype=bool),
        )

    def _loose(self, away: Array) -> Array:
        """Part of a displacement ``(m, 3)`` that the joints can have."""
        turned = np.zeros(len(away)) if np.isinf(self.springs.turning_stiffness) else wrap(away[:, 2])
        return np.column_stack((away[:, :2], turned))

    def _reach(self) -> Array:
        """Spacings; the leader, who follows nobody, has some length as well."""
        return np.where(self._leads, 1.0, self._spacings)

    def _target(self) -> tuple[Motion, Trail]:
        """Where the robots would be were there no obstacle, and what is left of their queues.

        In the ground frame; in a rigid shape in the frame of the one they hang on, except for the leader.
        """
        since = (self.state.ticks - self.state.departure) * self.tick
        if not self.formation.layout.follows:
            return self._at_path(at_rest(self._places), since), self.state.trail
        target, queue = trail.follow(self.state.trail, self._reach(), CATCH_UP, self.tick)
        return self._at_path(target, since), queue

    def _at_path(self, motion: Motion, time: float) -> Motion:
        """Put the leader on its path, if it is here."""
        if not self._leads.any():
            return motion
        leader = at_rest(self._post) if self.path is None else self.path.at(time)
        parts = (np.where(self._leads[:, None], x[None], y) for x, y in zip(leader, motion, strict=True))
        return Motion(*parts)

    def _push(self, sensed: Sensed, failed: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
        """Force of obstacles on the robots here: new where a sensor spoke, none where it has failed."""
        points, robot = sensed.points[:, 0] + 1j * sensed.points[:, 1], sensed.robot
        contact = np.zeros(len(failed), dtype=bool)
        contact[robot[np.abs(points) < self.law.radius]] = True
        near = np.abs(points) < max(self.law.ahead, self.law.beside)
        near &= np.abs(points - self.state.predecessor[robot]) > _KNOWN * self.law.radius
        points, robot = self._from_path(points[near], robot[near])
        force = obstacles.push(self.law, points, robot, self.state.displacement.value[:, 1])
        turned = force * turn(-self.state.displacement.value[:, 2])
        kept = np.where(sensed.heard[:, None], np.stack((turned.real, turned.imag), axis=-1), self.state.push)
        return np.where(failed[:, None], 0.0, kept), contact

    def _from_path(
        self, points: NDArray[np.complex128], robot: NDArray[np.intp]
    ) -> tuple[NDArray[np.complex128], NDArray[np.intp]]:
        """Points as seen along the robots' paths. What lies beyond a predecessor is the predecessor's to mind."""
        straight = points * turn(self.state.displacement.value[robot, 2])
        if not self.formation.layout.follows:
            return straight, robot
        here = point(self.state.pose)
        own, _ = trail.seen_from(self.state.trail, np.arange(len(here)), here)
        there = here[robot] + turn(self.state.pose[robot, 2]) * points
        along, beyond_ = trail.seen_from(self.state.trail, robot, there)
        leads = self._leads[robot]
        kept = leads | ~beyond_
        return np.where(leads, straight, along - own[robot])[kept], robot[kept]

    def _yield(self, load: Array) -> tuple[Displacement, Array]:
        """Displacement a tick later under a load in the robots' axes, and the load's work."""
        before_ = self.state.displacement
        turned = turn(before_.value[:, 2]) * point(load)
        force = np.stack((turned.real, turned.imag, load[:, 2]), axis=-1)
        after = springs.advance(self.springs, self._step, before_, force)
        work: Array = (force * (after.value - before_.value)).sum(-1)
        return after, work

    def _seen(self, joints: Motion) -> NDArray[np.complex128]:
        """Place of the predecessor in the robots' frames."""
        back = -point(joints.pose) * turn(-joints.pose[:, 2])
        return np.where(self._leads, np.inf, back)
