"""A choreography that runs: poses and points in, commands out, ten times a second."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.checks import array, positive
from mp2a.exceptions import InputError
from mp2a.formation import sensing
from mp2a.formation.choreography import follower, force_field, leader, teammates
from mp2a.formation.choreography.leader_broadcast import broadcast_leaders, shared_leaders
from mp2a.formation.choreography.program import END, compile_program
from mp2a.formation.choreography.scenario import Instruction, Scenario
from mp2a.formation.constants import TICK
from mp2a.formation.exchange import Broadcast, Exchange
from mp2a.formation.pose_history import PoseHistory
from mp2a.formation.robot_models import Fleet, RobotModel
from mp2a.formation.safety import ErrorStates, StopSignals, safe_commands, stop_signals
from mp2a.formation.sensing import SensedPoints
from mp2a.se2 import act, act_inverse
from mp2a.spatial import Array

_LONGEST_GAP = 60.0
"""s between two calls: a caller that was away for longer has lost its formation."""
_IN_PLACE = 0.05
"""m off its distance at which a robot counts as in place once its leader has ended; ours."""


class InstructionEvent(NamedTuple):
    """A robot's leader began or ended an instruction."""

    time: float
    robot: str
    number: int
    """Of the instruction in the scenario, from 0."""
    instruction: Instruction
    what: str
    """``began`` or ``ended``."""


class ChoreographyState(NamedTuple):
    """All that changes while a choreography runs."""

    tick: int
    """Ticks since the start, -1 before."""
    course: leader.Course | None
    """What is remembered of the leaders, in a process that works them out; None where they are broadcast."""
    leaders: leader.Leaders
    queues: follower.Queues
    gap_error: Array
    """``(n,)`` m: how much farther than wanted each robot is from its leader."""
    raw_command: Array
    """``(n, 2)``: what the controller wanted before any limit, m/s and rad/s."""
    expected: Array
    """``(ticks, n, 2)``: where robots are to be and were to be a moment ago, oldest first, ground frame, m."""
    force: Array
    """``(n, 2, 2)``: what the newest points push with, of `mp2a.formation.choreography.force_field`."""
    signals: StopSignals
    """What the newest points keep robots from."""
    errors: ErrorStates
    """Which robots have failed."""
    history: PoseHistory
    """Where the robots here have been of late, if their points are late; a pose that was lost is the one before."""


class Choreography:
    r"""Drive robots through a scenario.

    Parameters
    ----------
    scenario
        From `mp2a.formation.choreography.reading.parse`.
    robots
        A model for all roles, or a model a role.
    max_speed
        v_max, which the virtual leader goes by, m/s; None: that of the slowest robot.
    poses
        Where the robots stand before the start, ``(n, 3)``: the virtual leader starts in front of them. None: the
        leader starts at the origin, heading along x.
    exchange
        How the leaders' motion gets to the robots of this process from the first one's, over
        `mp2a.formation.choreography.leader_broadcast.planar_chain`. None: every robot works them out by itself from the
        scenario and the clock, as in the thesis.
    here
        Numbers ``(m,)`` of the robots of this process: what they know goes in, their commands come out. Of the others
        nothing is known here, so here they are lost; their own processes know better. None: those of the exchange, or
        all.

    Attributes
    ----------
    state : ChoreographyState
        The present one.
    events
        What began and ended so far.

    Raises
    ------
    InputError
        If a role has no model, a model is for no role, a robot is not there, or ``max_speed`` is not positive.

    Examples
    --------
    >>> from mp2a.formation.choreography.reading import parse
    >>> from mp2a.formation.robot_models import HUSKY
    >>> dance = Choreography(parse("robots R1 R2\nrow R1,R2 0 1.2\nmove 2 0"), HUSKY)
    >>> dance.step(0.0, dance.slot_poses(), [[0, 0], [0, 0]], None).round(3).tolist()
    [[0.7, 0.0], [0.7, 0.0]]
    """

    def __init__(
        self,
        scenario: Scenario,
        robots: RobotModel | Mapping[str, RobotModel],
        max_speed: float | None = None,
        poses: ArrayLike | None = None,
        exchange: Exchange | None = None,
        here: ArrayLike | None = None,
    ) -> None:
        self.scenario = scenario
        self.program = compile_program(scenario)
        n = len(self.program)
        self.models = _models(scenario, robots)
        self.fleet = Fleet.of(self.models)
        self.max_speed = positive("max_speed", self.fleet.max_speed.min() if max_speed is None else max_speed)
        self._exchange, self._shared = exchange, shared_leaders(self.program)
        everyone = np.arange(n) if exchange is None else exchange.robots
        self.here: NDArray[np.intp] = everyone if here is None else array("here", here, (None,), whole=True)
        if not np.isin(self.here, np.arange(n)).all():
            raise InputError(f"here: got {self.here.tolist()}, expected numbers of robots, from 0 to {n - 1}")
        course = leader.start(self.program, None if poses is None else array("poses", poses, (n, 3)))
        self.state = ChoreographyState(
            tick=-1,
            course=course if exchange is None or exchange.robots[0] == 0 else None,
            leaders=course.leaders,
            queues=follower.empty(n),
            gap_error=np.zeros(n),
            raw_command=np.zeros((n, 2)),
            expected=np.stack((course.leaders.slot_poses[:, :2],) * teammates.EXPECTED_TICKS),
            force=np.zeros((n, 2, 2)),
            signals=StopSignals(*(np.zeros(n, dtype=bool) for _ in StopSignals._fields)),
            errors=ErrorStates.none(n),
            history=PoseHistory.empty(len(self.here)),
        )
        self.events: list[InstructionEvent] = []

    @property
    def robots(self) -> tuple[str, ...]:
        """Roles, in the order of every array."""
        return self.scenario.robots

    @property
    def ended(self) -> NDArray[np.bool_]:
        """Whose leader is through with the scenario, ``(n,)``."""
        return self.program.kind[np.arange(len(self.program)), self.state.leaders.step] == END

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Which robots are in place, blocked or in their error state, ``(n,)``."""
        return (self.state.gap_error < _IN_PLACE) | self.blocked | self.state.errors.failed

    @property
    def done(self) -> bool:
        """Whether all leaders are through, and every robot has settled."""
        return self.state.tick >= 0 and bool((self.ended & self.settled).all())

    @property
    def blocked(self) -> NDArray[np.bool_]:
        """Which robots a stop signal keeps from driving where they should, ``(n,)``."""
        return self.state.signals.blocked(self.state.raw_command)

    @property
    def turn_held(self) -> NDArray[np.bool_]:
        """Which robots a point keeps from turning as they should, ``(n,)``."""
        return self.state.signals.turn_held(self.state.raw_command)

    def slot_poses(self) -> Array:
        """Return the poses the robots are to have, ``(n, 3)``; before the first step where they are to start."""
        return self.state.leaders.slot_poses

    def step(
        self,
        t: float,
        poses: ArrayLike,
        twists: ArrayLike,
        points: Sequence[ArrayLike | None] | None,
        stamps: ArrayLike | None = None,
    ) -> Array:
        """Return the commands of the m robots here for the present moment.

        Parameters
        ----------
        t
            Time since the start all robots agreed on, s. Before it they stand. Virtual leaders keep ticks of 0.1 s,
            however often this is called.
        poses
            ``(m, 3)`` in the ground frame, m and rad. A pose that is not finite is a look-up that failed: the robot
            stands, and after three in a row it is in its error state.
        twists
            ``(m, 2)`` measured, m/s and rad/s. The thesis' controller does not use them; they are checked.
        points
            What came from each robot's LIDAR since the last call, ``(k, 2)`` m in its own frame; None for one of which
            nothing new has come: after more than 0.3 s that robot is in its error state. None for all, as long as
            there has been nothing else: robots without LIDAR, which watch for no obstacle.
        stamps
            ``(m,)`` s: when the points were measured; they are moved by what the robot has driven since. None: now.

        Returns
        -------
        numpy.ndarray
            ``(m, 2)`` forward speed and turn rate within the robots' limits, m/s and rad/s; zero in the error state.

        Raises
        ------
        InputError
            If an argument has the wrong shape, or time runs backwards or jumps by more than a minute. With an exchange,
            a wrong shape is an error in every process.
        """
        n, m = len(self.program), len(self.here)
        tick = self._tick(t)
        due = self._exchange is not None and tick > self.state.tick  # in every process
        with self._together(due) as broadcast:
            place = np.full((n, 3), np.nan)
            place[self.here] = array("poses", poses, (m, 3), finite=False)
            array("twists", twists, (m, 2), finite=False)
            state = self._sense(t, place, points, stamps)
            if due:
                state = self._tick_on(state, broadcast)
        if tick < 0:
            self.state = state
            return np.zeros((m, 2))
        while state.tick < tick:
            state = self._tick_on(state)
        known, failed = state.errors.lost_poses == 0, state.errors.failed
        safe = np.where(known[:, None], place, 0.0)
        queues, ground, gap_error = follower.targets(state.queues, state.leaders, safe)
        target = act_inverse(safe, ground)
        raw = follower.commands(target, gap_error, state.leaders.stands, state.force, self.max_speed)
        # A lost robot keeps its queue; one in its error state never needs it again.
        head = np.where(failed, queues.tail, np.where(known, queues.head, state.queues.head))
        gap_error = np.where(known, gap_error, state.gap_error)
        self.state = state._replace(queues=queues._replace(head=head), raw_command=raw, gap_error=gap_error)
        return safe_commands(raw, self.fleet.fastest, state.signals, failed | ~known)[self.here]

    def _together(self, due: bool) -> AbstractContextManager[Broadcast | None]:
        """Return a context that shares errors with all processes, if all are about to exchange something."""
        exchange = self._exchange
        return exchange.together(exchange.broadcast) if due and exchange is not None else nullcontext()

    def _tick(self, t: float) -> int:
        """Count ticks up to ``t``; -1 before the start."""
        now = float(t)
        last = max(self.state.tick, 0) * TICK
        if not (now < last + _LONGEST_GAP) or (self.state.tick >= 0 and now < last - TICK):
            raise InputError(f"t: got {t} s after {last:g} s, expected time to run on, in steps of less than a minute")
        return -1 if now < 0 else max(int(now / TICK + 1e-6), self.state.tick)

    def _sense(
        self, t: float, poses: Array, points: Sequence[ArrayLike | None] | None, stamps: ArrayLike | None
    ) -> ChoreographyState:
        state, here = self.state, self.here
        errors = state.errors.after_look_up(np.logical_and.reduce(np.isfinite(poses), axis=1))
        if points is None and np.isnan(errors.last_scan_time).all():
            return state._replace(errors=errors)
        sensed = sensing.pack([None] * len(here) if points is None else points, len(here), finite=False)
        history = state.history
        if stamps is not None:
            history = history.add(t, poses[here])
            sensed = _moved_to_now(sensed, history, array("stamps", stamps, (len(here),)))
        cloud, robot = sensed.points, here[sensed.robot]
        heard = np.zeros(len(poses), dtype=bool)
        heard[here] = sensed.heard
        pushing = teammates.obstacles_among(cloud, robot, poses, state.expected, self.fleet.radius)
        force = force_field.forces(cloud[pushing], robot[pushing], self.fleet.width)
        signals = stop_signals(cloud, robot, self.fleet.length, self.fleet.width)
        return state._replace(
            force=np.where(heard[:, None, None], force, state.force),
            signals=StopSignals(*(np.where(heard, *pair) for pair in zip(signals, state.signals, strict=True))),
            errors=errors.after_scan(t, heard),
            history=history,
        )

    def _tick_on(self, state: ChoreographyState, broadcast: Broadcast | None = None) -> ChoreographyState:
        tick = state.tick + 1
        time, course = tick * TICK, state.course
        if course is not None:
            course = leader.advance(self.program, course, time, self.max_speed)
        leaders = None if course is None else course.leaders
        if self._exchange is not None:
            leaders = broadcast_leaders(self._exchange, self._shared, leaders, broadcast)
        assert leaders is not None
        self._report(state.leaders, leaders, time, first=tick == 0)
        queues = state.queues
        if not leaders.stands.all():
            queues = queues if queues.tail else teammates.lead_in(queues, state.leaders)
            queues = follower.enqueue(queues, leaders.points)
        queues, there = teammates.expected_places(queues, leaders)
        expected = np.concatenate((state.expected[1:], there[None]))
        return state._replace(tick=tick, course=course, leaders=leaders, queues=queues, expected=expected)

    def _report(self, before: leader.Leaders, after: leader.Leaders, time: float, first: bool) -> None:
        for i, row in enumerate(self.program.instruction):
            begin, end = before.step[i], after.step[i]
            for k in range(begin, end + 1):
                for what in ("began",) * bool(first or k > begin) + ("ended",) * bool(k < end):
                    if row[k] >= 0:  # the end of the program is no instruction
                        instruction = self.scenario.instructions[row[k]]
                        self.events.append(InstructionEvent(time, self.robots[i], int(row[k]), instruction, what))


def _models(scenario: Scenario, robots: RobotModel | Mapping[str, RobotModel]) -> tuple[RobotModel, ...]:
    """Return the models of a scenario's robots, in their order."""
    if isinstance(robots, RobotModel):
        return (robots,) * len(scenario.robots)
    missing = [role for role in scenario.robots if role not in robots]
    unknown = [role for role in robots if role not in scenario.robots]
    if missing or unknown:
        got = f"none for {missing[0]}" if missing else f"one for unknown robot {unknown[0]}"
        raise InputError(f"robots: got {got}, expected a model for every robot of the scenario")
    return tuple(robots[role] for role in scenario.robots)


def _moved_to_now(sensed: SensedPoints, history: PoseHistory, stamps: Array) -> SensedPoints:
    """Return points as robots see them now that were measured at ``stamps``.

    They stay as they came for a robot that stands, since rounding shall not move them from cell to cell, and for one
    that has not known yet where it is.
    """
    then, now = history.at(stamps)[sensed.robot], history.poses[-1, sensed.robot]
    moved = act_inverse(now, act(then, sensed.points))
    still = ((then == now) | ~np.isfinite(then)).all(axis=1)
    return sensed._replace(points=np.where(still[:, None], sensed.points, moved))
