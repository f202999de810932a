"""A choreography that runs: poses and points in, commands out, ten times a second."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a.checks import array, numbers
from mp2a.exceptions import InputError
from mp2a.formation.choreography import fellows, follower, leader, obstacles
from mp2a.formation.choreography.constants import LOST_POSES, SILENCE, TICK
from mp2a.formation.choreography.program import END, compile_program
from mp2a.formation.choreography.scenario import Instruction, Scenario
from mp2a.formation.choreography.telling import parts, tell
from mp2a.formation.exchange import Exchange
from mp2a.formation.robot_models import RobotModel
from mp2a.spatial import Array

_LONGEST_GAP = 60.0
"""s between two calls: a caller that was away for longer has lost its formation."""
_IN_PLACE = 0.05
"""m off its distance at which a robot counts as in place once its leader has ended; ours."""


class Fleet(NamedTuple):
    """Sizes and limits of n robots as arrays ``(n,)``, m, m/s, rad/s, m/s², rad/s²."""

    length: Array
    width: Array
    max_speed: Array
    max_turn_rate: Array
    max_acceleration: Array
    max_turn_acceleration: Array


class Event(NamedTuple):
    """A robot's leader began or ended an instruction."""

    time: float
    robot: str
    number: int
    """Of the instruction in the scenario, from 0."""
    instruction: Instruction
    what: str
    """``began`` or ``ended``."""


class State(NamedTuple):
    """All that changes while a choreography runs.

    Attributes
    ----------
    tick
        Ticks since the start, -1 before.
    course
        Of `leader`, in a process that works the leaders out; None where they are told.
    leaders, queues
        Of `leader` and `follower`.
    excess
        ``(n,)`` m: how much farther than asked each robot is from its leader.
    asked
        ``(n, 2)``: what the controller asked for before any limit, m/s and rad/s.
    expected
        ``(ticks, n, 2)``: where robots are to be and were to be a moment ago, oldest first, ground frame, m.
    seen
        Force and stop signals of the newest points.
    heard
        ``(n,)`` s: when LIDAR data came last; not a number of robots without LIDAR.
    lost
        ``(n,)``: look-ups of the pose that failed in a row.
    error
        ``(n,)``: which robots are in their error state, and stay there.
    """

    tick: int
    course: leader.Course | None
    leaders: leader.Leaders
    queues: follower.Queues
    excess: Array
    asked: Array
    expected: Array
    seen: obstacles.Seen
    heard: Array
    lost: NDArray[np.intp]
    error: NDArray[np.bool_]


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
        `mp2a.formation.choreography.telling.planar_chain`. None: every robot works them out by itself from the
        scenario and the clock, as in the thesis.

    Attributes
    ----------
    state
        The present `State`.
    events
        What began and ended so far.

    Raises
    ------
    InputError
        If a role has no model, or ``max_speed`` is not positive.

    Examples
    --------
    >>> from mp2a.formation.choreography.reading import parse
    >>> from mp2a.formation.robot_models import HUSKY
    >>> dance = Choreography(parse("robots R1 R2\nrow R1,R2 0 1.2\nmove 2 0"), HUSKY)
    >>> dance.step(0.0, dance.places(), [[0, 0], [0, 0]], None).round(3).tolist()
    [[0.7, 0.0], [0.7, 0.0]]
    """

    def __init__(
        self,
        scenario: Scenario,
        robots: RobotModel | Mapping[str, RobotModel],
        max_speed: float | None = None,
        poses: ArrayLike | None = None,
        exchange: Exchange | None = None,
    ) -> None:
        self.scenario = scenario
        self.program = compile_program(scenario)
        n = len(self.program)
        self.fleet = fleet(scenario, robots)
        self.max_speed = float(self.fleet.max_speed.min() if max_speed is None else max_speed)
        if not 0 < self.max_speed < np.inf:
            raise InputError(f"max_speed: got {max_speed}, expected a positive number of m/s")
        self._exchange, self._parts = exchange, parts(self.program)
        began = leader.start(self.program, None if poses is None else array("poses", poses, (n, 3)))
        none = np.zeros(n, dtype=bool)
        unseen = obstacles.Seen(np.zeros((n, 2)), none, none, none, none)
        zero = np.zeros(n)
        queues = follower.empty(n)
        self.state = State(
            -1,
            began if exchange is None or exchange.robots[0] == 0 else None,
            began.leaders,
            queues,
            zero,
            np.zeros((n, 2)),
            np.stack((follower.spots(began.leaders)[:, :2],) * fellows.MEMORY),
            unseen,
            np.full(n, np.nan),
            np.zeros(n, dtype=np.intp),
            none,
        )
        self.events: list[Event] = []

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
        return (self.state.excess < _IN_PLACE) | self.blocked | self.state.error

    @property
    def done(self) -> bool:
        """Whether all leaders are through, and every robot has settled."""
        return self.state.tick >= 0 and bool((self.ended & self.settled).all())

    @property
    def blocked(self) -> NDArray[np.bool_]:
        """Which robots a stop signal keeps from driving where they should, ``(n,)``."""
        linear, seen = self.state.asked[:, 0], self.state.seen
        return (seen.front & (linear > 0)) | (seen.rear & (linear < 0))

    @property
    def turn_held(self) -> NDArray[np.bool_]:
        """Which robots a point keeps from turning as they should, ``(n,)``."""
        turn, seen = self.state.asked[:, 1], self.state.seen
        return (seen.left & (turn > 0)) | (seen.right & (turn < 0))

    def places(self) -> Array:
        """Poses the robots are to have at present, ``(n, 3)``; before the first step where they are to start."""
        return follower.spots(self.state.leaders)

    def step(self, t: float, poses: ArrayLike, twists: ArrayLike, points: Sequence[ArrayLike | None] | None) -> Array:
        """Commands for the present moment.

        Parameters
        ----------
        t
            Time since the start all robots agreed on, s. Before it they stand. Virtual leaders keep ticks of 0.1 s,
            however often this is called.
        poses
            ``(n, 3)`` in the ground frame, m and rad. A pose that is not finite is a look-up that failed: the robot
            stands, and after three in a row it is in its error state.
        twists
            ``(n, 2)`` measured, m/s and rad/s. The thesis' controller does not use them; they are checked.
        points
            What came from each robot's LIDAR since the last call, ``(k, 2)`` m in its own frame; None for one of which
            nothing new has come: after more than 0.3 s that robot is in its error state. None for all, as long as
            there has been nothing else: robots without LIDAR, which watch for no obstacle.

        Returns
        -------
        numpy.ndarray
            ``(n, 2)`` forward speed and turn rate within the robots' limits, m/s and rad/s; zero in the error state.

        Raises
        ------
        InputError
            If an argument has the wrong shape, or time runs backwards or jumps by more than a minute. With an exchange,
            a wrong shape is an error in every process.
        """
        n = len(self.program)
        tick = self._tick(t)
        try:
            place = _rows("poses", poses, (n, 3))
            _rows("twists", twists, (n, 2))
            state = self._sense(t, place, points)
        except InputError as wrong:
            if self._exchange is not None and tick > self.state.tick:  # the others are waiting to be told
                self._told(self.state.leaders, self.state.course, wrong)
            raise
        known = state.lost == 0
        if tick < 0:
            self.state = state
            return np.zeros((n, 2))
        while state.tick < tick:
            state = self._tick_on(state)
        safe = np.where(known[:, None], place, 0.0)
        queues, asked, excess = follower.steer(state.queues, state.leaders, safe, state.seen.force, self.max_speed)
        # A lost robot keeps its queue; one in its error state never needs it again.
        head = np.where(state.error, queues.tail, np.where(known, queues.head, state.queues.head))
        queues = queues._replace(head=head)
        excess = np.where(known, excess, state.excess)
        self.state = state._replace(queues=queues, asked=asked, excess=excess)
        return self._limited(asked, known)

    def _tick(self, t: float) -> int:
        """Count ticks up to ``t``; -1 before the start."""
        now = float(t)
        last = max(self.state.tick, 0) * TICK
        if not (now < last + _LONGEST_GAP) or (self.state.tick >= 0 and now < last - TICK):
            raise InputError(f"t: got {t} s after {last:g} s, expected time to run on, in steps of less than a minute")
        return -1 if now < 0 else max(int(now / TICK + 1e-6), self.state.tick)

    def _sense(self, t: float, poses: Array, points: Sequence[ArrayLike | None] | None) -> State:
        state = self.state
        known = np.logical_and.reduce(np.isfinite(poses), axis=1)
        lost = np.where(known, 0, state.lost + 1)
        error = state.error | (lost >= LOST_POSES)
        if points is None and np.isnan(state.heard).all():
            return state._replace(lost=lost, error=error)
        n = len(known)
        given = [None] * n if points is None else points
        cloud, whose = obstacles.flatten(given, n)
        came = np.array([one is not None for one in given])
        length, width = self.fleet.length, self.fleet.width
        strange = fellows.strange(cloud, whose, poses, state.expected, np.hypot(length, width) / 2)
        fresh = obstacles.look(cloud, whose, length, width, strange)
        seen = obstacles.Seen(
            np.where(came[:, None], fresh.force, state.seen.force),
            *(np.where(came, now, before) for now, before in zip(fresh[1:], state.seen[1:], strict=True)),
        )
        heard = np.where(came | np.isnan(state.heard) | (t < 0), t, state.heard)
        error = error | (t - heard > SILENCE + 1e-9)
        return state._replace(lost=lost, error=error, seen=seen, heard=heard)

    def _tick_on(self, state: State) -> State:
        tick = state.tick + 1
        time = tick * TICK
        course = state.course
        if course is not None:
            course = leader.advance(self.program, course, time, self.max_speed)
        leaders = self._told(state.leaders, course)
        self._report(state.leaders, leaders, time, first=tick == 0)
        queues = state.queues
        if not leaders.stands.all():
            queues = queues if queues.tail else fellows.begin(queues, state.leaders)
            queues = follower.push(queues, follower.lanes(leaders))
        queues, there = fellows.expected(queues, leaders)
        expected = np.concatenate((state.expected[1:], there[None]))
        return state._replace(tick=tick, course=course, leaders=leaders, queues=queues, expected=expected)

    def _told(
        self, before: leader.Leaders, course: leader.Course | None, wrong: InputError | None = None
    ) -> leader.Leaders:
        own = None if course is None else course.leaders
        if self._exchange is not None:
            return tell(self._exchange, self._parts, before, own, wrong)
        assert own is not None
        return own

    def _report(self, before: leader.Leaders, after: leader.Leaders, time: float, first: bool) -> None:
        changed = np.ones(len(self.program), bool) if first else before.step != after.step
        for i in np.flatnonzero(changed):
            row = self.program.instruction[i]
            for k in range(before.step[i], after.step[i]):
                if first or k > before.step[i]:
                    self._event(time, i, row[k], "began")
                self._event(time, i, row[k], "ended")
            if row[after.step[i]] >= 0:
                self._event(time, i, row[after.step[i]], "began")

    def _event(self, time: float, robot: np.intp, index: np.intp, what: str) -> None:
        self.events.append(Event(time, self.robots[robot], int(index), self.scenario.instructions[index], what))

    def _limited(self, asked: Array, known: NDArray[np.bool_]) -> Array:
        limits = np.column_stack((self.fleet.max_speed, self.fleet.max_turn_rate))
        out = np.clip(asked, -limits, limits)
        out[self.blocked, 0] = 0.0
        out[self.turn_held, 1] = 0.0
        out[self.state.error | ~known] = 0.0
        return out


def _rows(name: str, values: ArrayLike, shape: tuple[int, int]) -> Array:
    """Check an array that may hold what is not a number."""
    out = numbers(name, values)
    if out.shape != shape:
        raise InputError(f"{name}: got shape {out.shape}, expected {shape}")
    return out


def models(scenario: Scenario, robots: RobotModel | Mapping[str, RobotModel]) -> tuple[RobotModel, ...]:
    """Models of a scenario's robots, in their order.

    Raises
    ------
    InputError
        If a role has no model, or a model is for a role that is not in the scenario.
    """
    if isinstance(robots, RobotModel):
        return (robots,) * len(scenario.robots)
    missing = [role for role in scenario.robots if role not in robots]
    unknown = [role for role in robots if role not in scenario.robots]
    if missing or unknown:
        given = f"none for {missing[0]}" if missing else f"one for unknown robot {unknown[0]}"
        raise InputError(f"robots: got {given}, expected a model for every robot of the scenario")
    return tuple(robots[role] for role in scenario.robots)


def fleet(scenario: Scenario, robots: RobotModel | Mapping[str, RobotModel]) -> Fleet:
    """Sizes and limits of a scenario's robots; raises as `models` does."""
    chosen = models(scenario, robots)
    return Fleet(*(np.array([getattr(model, name) for model in chosen]) for name in Fleet._fields))
