r"""The controller of a formation by dynamics: what every robot does at a tick, and where it hears of the others.

1. Where to. The leader: its path at this time. In a rigid shape the others: their place from the one they hang on. In a
   line: the place a spacing back on the queue of where the predecessor went (`mp2a.formation.path_queue`). To this the
   displacement of the robot's own virtual joint is added.
2. The scan: inverse dynamics of all planar joints. It gives each robot its pose, velocity and acceleration in the
   ground frame, the force F in its joint, and the part of it that obstacles cause.
3. The joint yields to that part (`mp2a.formation.springs`); the next tick starts from there.
4. The setpoint is the scan's pose and velocity.

A joint yields to the forces on those robots that it moves at this instant. In a rigid shape these are all that hang on
it: forces add up towards the leader, motion is carried outwards. In a line it is the robot itself; those behind come
along the changed path when they get there.

In a line, joint coordinates relative to the predecessor need its place at this very tick. The scan cannot tell it in
time (docs/formation.md says why), so each robot sends its plan for the tick to the one behind it, nine numbers in one
message, before the scan.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.checks import array, positive
from mp2a.formation import obstacles, path_queue, sensing, springs
from mp2a.formation.constants import TICK
from mp2a.formation.exchange import Exchange, FormationScan, LocalExchange, scan_formation
from mp2a.formation.formation import Formation
from mp2a.formation.obstacles import ObstacleLaw
from mp2a.formation.path_queue import PathQueues
from mp2a.formation.paths import Path
from mp2a.formation.safety import ErrorStates
from mp2a.formation.sensing import SensedPoints, is_obstacle
from mp2a.formation.springs import Displacement, Springs, solve
from mp2a.formation.vectors import as_complex, as_vectors
from mp2a.se2 import PlanarMotion, act, inverse, relative, rotate, wrap
from mp2a.spatial import Array

_PREDECESSOR = 1.25
"""Points closer to the predecessor's place than this many radii of a robot are the predecessor."""


class Setpoints(NamedTuple):
    """Where the m robots of this process are to be and how they are to move there, in the ground frame.

    A robot that has failed keeps its last pose and has speed and turn rate zero.
    """

    pose: Array
    """x m, y m, heading rad, ``(m, 3)``"""
    speed: Array
    """Forward, along the heading, ``(m,)``, m/s."""
    turn_rate: Array
    """``(m,)``, rad/s, positive to the left."""
    acceleration: Array
    """Forward m/s² and of the turn rate rad/s², ``(m, 2)``."""
    failed: NDArray[np.bool_]
    """``(m,)``: robots in their error state."""

    @property
    def twist(self) -> Array:
        """Forward speed and turn rate, ``(m, 2)``: what a velocity command holds."""
        return np.stack((self.speed, self.turn_rate), axis=-1)


class FormationState(NamedTuple):
    """All that the m robots of this process remember from tick to tick."""

    ticks: int
    """Ticks done so far."""
    departure: int
    """Tick at which the leader's path began."""
    displacement: Displacement
    """Of the virtual joints, ``(m, 3)`` each, in the axes of the undisplaced places."""
    queues: PathQueues
    """Where the predecessors went; used in a line only."""
    pose: Array
    """Where the robots were told to be, ``(m, 3)``, ground frame."""
    predecessor: Array
    """Its place in the robot's own frame, ``(m, 2)``, m; not a number for the leader."""
    push: Array
    """Last force of obstacles, ``(m, 2)``, N, in the robot's frame."""
    errors: ErrorStates
    """Which robots have failed."""


class FormationReport(NamedTuple):
    """What is known of a tick besides the setpoints, for the m robots of this process."""

    scan: FormationScan
    """Motion, force in the joint, and the obstacles' part of it."""
    push: Array
    """Force of obstacles on the robot itself, ``(m, 2)``, N, in its frame."""
    contact: NDArray[np.bool_]
    """``(m,)``: whether an obstacle is inside the robot's radius. The push is finite all the same; whether to stop is
    for the robot's own safety to say, since one that stands does not get away."""
    work: Array
    """Of the forces on the virtual joints over the tick to come, ``(m,)``, J."""


class FormationController:
    """Drives a formation by dynamics, tick by tick; the same in one process and on each of many ranks.

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
        line any place will do, see `mp2a.formation.path_queue.begin`; else robots go to their places as their springs
        pull.

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
    >>> from mp2a.formation import Formation, FormationController, waypoints
    >>> controller = FormationController(Formation.of("line", 3), waypoints([[0, 0], [10, 0]]))
    >>> for _ in range(300):
    ...     setpoints = controller.step()
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
        self.tick = positive("tick", tick)
        self.formation = formation
        self.path = path
        self.exchange = exchange or LocalExchange(formation.model)
        self.springs = springs or Springs()
        self.law = law or ObstacleLaw()
        self.report: FormationReport | None = None
        robots = self.exchange.robots
        self._leads = formation.layout.parents[robots] < 0
        self._slots = formation.layout.slots[robots]
        # The leader, who follows nobody, has some length of queue as well.
        self._spacings = np.where(self._leads, 1.0, formation.spacings[robots])
        self._solution = solve(self.springs, self.tick)
        poses = None if start is None else array("start", start, (len(formation), 3))
        self._leader_start = np.zeros(3) if poses is None else poses[0]
        self.state = self._begin(poses)

    @property
    def time(self) -> float:
        """Time of the next step, s."""
        return self.state.ticks * self.tick

    def lead(self, path: Path) -> None:
        """Give the leader a path that begins at the next step; to be called in its process alone, when it stands.

        The path may begin somewhere else than where the leader is: its virtual joint takes up the difference.
        """
        self.path = path
        offset = self._possible(relative(path.at(0.0).pose, self.state.pose))
        rest = springs.none(len(offset))._replace(value=offset)
        mixed = (np.where(self._leads[:, None], x, y) for x, y in zip(rest, self.state.displacement, strict=True))
        self.state = self.state._replace(departure=self.state.ticks, displacement=Displacement(*mixed))

    def step(self, sensed: SensedPoints | None = None) -> Setpoints:
        """Do a tick; collective where the robots are on ranks.

        Parameters
        ----------
        sensed
            Points that the robots of this process have sensed since the last tick, each in its own frame. None: all
            sensors see nothing. A sensor that says nothing leaves the last force in place; after more than 0.3 s its
            robot is in its error state: its setpoint is to stand where it is, for good, and nothing pushes it any more.
            The formation goes on as if it were there.

        Returns
        -------
        Setpoints
            Of the robots of this process, for this tick's time.

        Raises
        ------
        InputError
            On every rank, if what a robot has sensed is malformed.
        """
        state, follows = self.state, self.formation.layout.follows
        target, queues = self._target()
        own = target.compose(springs.joint(state.displacement))
        joints = own
        if follows:
            plan = self.exchange.send_to_children(np.concatenate(own, axis=-1))
            joints = PlanarMotion(plan[:, :3], plan[:, 3:6], plan[:, 6:]).relative(own)
        with self.exchange.together(self.exchange.run) as run:
            points = sensing.nothing(len(own.pose)) if sensed is None else sensing.check_points(sensed, len(own.pose))
            errors = state.errors.after_scan(self.time, points.heard)
            push, contact = self._push(points, errors.failed)
            external = np.column_stack((push, np.zeros(len(push))))
            result = scan_formation(run, joints, external)

        load = result.obstacles
        if follows:
            load, queues = external, path_queue.extend(queues, result.motion.compose(joints.inverse()))
        displacement, work = self._yield(load)
        failed, motion = errors.failed, result.motion
        pose = np.where(failed[:, None], state.pose, motion.pose)
        self.state = FormationState(
            state.ticks + 1, state.departure, displacement, queues, pose, self._predecessor(joints), push, errors
        )
        self.report = FormationReport(result, push, contact, work)
        speed, turn_rate = np.where(failed, 0.0, motion.velocity[:, [0, 2]].T)
        return Setpoints(pose, speed, turn_rate, np.where(failed[:, None], 0.0, motion.rate[:, [0, 2]]), failed)

    def _begin(self, start: Array | None) -> FormationState:
        """Return the state before the first tick, from a scan of the formation at rest."""
        layout, robots = self.formation.layout, self.exchange.robots
        m = len(robots)
        rest = self._at_path(PlanarMotion.at_rest(self._slots), 0.0).pose
        places = rest
        if start is not None:
            places = relative(np.where(self._leads[:, None], 0.0, start[layout.parents[robots]]), start[robots])
        joints = PlanarMotion.at_rest(places)
        motion = scan_formation(self.exchange.run, joints, np.zeros((m, 3))).motion
        free = self._leads if layout.follows else np.ones(m, dtype=bool)
        offset = np.where(free[:, None], self._possible(relative(rest, places)), 0.0)
        return FormationState(
            ticks=0,
            departure=0,
            displacement=springs.none(m)._replace(value=offset),
            queues=path_queue.begin(motion.pose, motion.compose(joints.inverse()).pose, self._spacings),
            pose=motion.pose,
            predecessor=self._predecessor(joints),
            push=np.zeros((m, 2)),
            errors=ErrorStates.none(m, -self.tick),
        )

    def _possible(self, offset: Array) -> Array:
        """Return the part of a displacement ``(m, 3)`` that the joints can have."""
        turned = np.zeros(len(offset)) if np.isinf(self.springs.turning_stiffness) else wrap(offset[:, 2])
        return np.column_stack((offset[:, :2], turned))

    def _target(self) -> tuple[PlanarMotion, PathQueues]:
        """Return where the robots would be were there no obstacle, and what is left of their queues.

        In the ground frame; in a rigid shape in the frame of the one they hang on, except for the leader.
        """
        since = (self.state.ticks - self.state.departure) * self.tick
        if not self.formation.layout.follows:
            return self._at_path(PlanarMotion.at_rest(self._slots), since), self.state.queues
        target, queues = path_queue.follow(self.state.queues, self._spacings, self.tick)
        return self._at_path(target, since), queues

    def _at_path(self, motion: PlanarMotion, time: float) -> PlanarMotion:
        """Put the leader on its path, if it is here."""
        if not self._leads.any():
            return motion
        leader = PlanarMotion.at_rest(self._leader_start) if self.path is None else self.path.at(time)
        parts = (np.where(self._leads[:, None], x[None], y) for x, y in zip(leader, motion, strict=True))
        return PlanarMotion(*parts)

    def _push(self, sensed: SensedPoints, failed: NDArray[np.bool_]) -> tuple[Array, NDArray[np.bool_]]:
        """Return the force of obstacles on the robots here: new where a sensor spoke, none where it has failed."""
        points, robot, law = sensed.points, sensed.robot, self.law
        distance, displacement = np.hypot(*points.T), self.state.displacement.value
        contact = np.zeros(len(failed), dtype=bool)
        contact[robot[distance < law.radius]] = True
        predecessor = self.state.predecessor[:, None]
        reach = np.full((len(failed), 1), _PREDECESSOR * law.radius)
        near = distance < max(law.ahead, law.beside)
        near &= is_obstacle(points, robot, predecessor, predecessor, reach)
        seen, robot = self._from_path(points[near], robot[near])
        force = as_vectors(obstacles.push(law, seen, robot, displacement[:, 1]))
        force = np.where(sensed.heard[:, None], rotate(-displacement[:, 2], force), self.state.push)
        return np.where(failed[:, None], 0.0, force), contact

    def _from_path(self, points: Array, robot: NDArray[np.intp]) -> tuple[NDArray[np.complex128], NDArray[np.intp]]:
        """Return points as seen along the paths; what lies beyond a predecessor is for the predecessor to mind."""
        straight = as_complex(rotate(self.state.displacement.value[robot, 2], points))
        if not self.formation.layout.follows:
            return straight, robot
        pose, queues = self.state.pose, self.state.queues
        own, _ = path_queue.seen_from(queues, np.arange(len(pose)), as_complex(pose))
        along, beyond = path_queue.seen_from(queues, robot, as_complex(act(pose[robot], points)))
        leads = self._leads[robot]
        kept = leads | ~beyond
        return np.where(leads, straight, along - own[robot])[kept], robot[kept]

    def _yield(self, load: Array) -> tuple[Displacement, Array]:
        """Return the displacement a tick later under a load in the robots' axes, and the load's work."""
        before = self.state.displacement
        force = np.column_stack((rotate(before.value[:, 2], load[:, :2]), load[:, 2]))
        after = springs.give_way(self.springs, self._solution, before, force)
        work: Array = (force * (after.value - before.value)).sum(-1)
        return after, work

    def _predecessor(self, joints: PlanarMotion) -> Array:
        """Return the place of the predecessor in the robots' frames."""
        return np.where(self._leads[:, None], np.nan, inverse(joints.pose)[:, :2])
