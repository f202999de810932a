"""One robot's loop: sense, decide, shape the command, send it."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from mp2a.formation.outcome import Outcome, outcome
from mp2a.formation.robot_models import Fleet
from mp2a.robots import limits, slip, sound
from mp2a.robots.interface import NO_POSE, Clock, Robot, Sensed
from mp2a.robots.planner import ChoreographyPlanner, Decision, origin_of
from mp2a.robots.robot_config import RobotConfig
from mp2a.robots.ticks import DriveTick
from mp2a.se2 import compose
from mp2a.spatial import Array

_ZERO = np.zeros(2)


class Driver:
    """Drives one robot as a planner says.

    Parameters
    ----------
    role
        Of the robot.
    robot
        What takes commands.
    config
        Its limits and rate.
    planner
        Decides.
    in_place
        Whether the robot stands at its place at the first tick at which its pose is known, and its fixed frame may lie
        anywhere; else its fixed frame is the planner's ground frame.
    """

    def __init__(
        self, role: str, robot: Robot, config: RobotConfig, planner: ChoreographyPlanner, in_place: bool = True
    ) -> None:
        self.role, self.robot = role, robot
        self._planner, self._dt = planner, 1.0 / config.rate
        fleet = Fleet.of([config.model])
        [self._fastest], [self._most] = fleet.fastest, fleet.accelerations
        self._place = planner.place()
        self._origin: Array | None = None if in_place else np.zeros(3)
        self._sent: Array = _ZERO
        self._slip = slip.NO_SLIP_SEEN
        self._sound = sound.CLEAR
        self._decision = Decision(_ZERO, "", False, "", False, False)
        self._pose: Array = NO_POSE

    def tick(self, t: float) -> DriveTick:
        """Sense, decide and send, at ``t`` s after the start."""
        known, sensed = self._sense()
        self._decision = decision = self._planner.decide(t, sensed._replace(twist=np.nan_to_num(sensed.twist)))
        command = self._shape(sensed, decision)
        self.robot.send(command)
        self._sent = command
        self._make_sound(t, bool(decision.blocked) and not sensed.human)
        return self._tick(t, known, command)

    def stand(self, t: float) -> DriveTick:
        """Return the tick after the last one, at which the robot is closed: it is sent zero."""
        known, _ = self._sense()
        return self._tick(t, known, _ZERO)._replace(stands=True)

    def outcome(self, touched: Iterable[str] = (), error: str = "") -> Outcome:
        """Judge how the drive ended for this robot.

        Parameters
        ----------
        touched
            What it drove into.
        error
            What ended the drive; empty if the planner's own state says enough.
        """
        off = self._planner.destination() - self._pose[:2]
        decision = self._decision
        return outcome(
            self.role, float(np.hypot(*off)), over=decision.over, error=error or decision.error,
            blocked=decision.blocked, touched=touched,
        )  # fmt: skip

    def _sense(self) -> tuple[Sensed, Sensed]:
        """Return what the robot knows, its pose in its own fixed frame and in the ground frame."""
        known = self.robot.sense()
        if known.points is not None:
            # As a PointCloud2 holds them: a record then has to the bit what the planner saw.
            known = known._replace(points=known.points.astype(np.float32))
        if self._origin is None and np.isfinite(known.pose).all():
            self._origin = origin_of(self._place, known.pose)
        self._pose = NO_POSE if self._origin is None else compose(self._origin, known.pose)
        return known, known._replace(pose=self._pose)

    def _tick(self, t: float, known: Sensed, command: Array) -> DriveTick:
        decision = self._decision
        share = slip.remaining_share(self._slip, known.twist[0])
        return DriveTick(
            t, known, self._pose, self._planner.leader(), command, share,
            bool(decision.blocked), bool(decision.error), decision.done,
        )  # fmt: skip

    def _shape(self, sensed: Sensed, decision: Decision) -> Array:
        """Make up for slip, keep to the limits; what has to stop stops at once."""
        if sensed.human:  # what the human does is not what was commanded, and from there it goes on
            self._sent = np.nan_to_num(sensed.twist)
        elif not decision.blocked:  # what touches something does not turn, and that is not slip
            self._slip = slip.learn(self._slip, self._sent[1], sensed.twist, self._dt)
        lost = not np.isfinite(sensed.pose).all()
        if decision.error or lost or not np.isfinite(decision.command).all():
            return _ZERO
        speed = sensed.twist[0] if np.isfinite(sensed.twist).all() else self._sent[0]
        wanted = slip.compensate(self._slip, decision.command, speed)
        command = limits.approach(self._sent, limits.saturate(wanted, self._fastest), self._most, self._dt)
        # The robot brakes as hard as it can; a ramp of ours would only be slower.
        return command * (not decision.blocked, not decision.turn_held)

    def _make_sound(self, t: float, blocked: bool) -> None:
        self._sound = sound.next_sound(self._sound, blocked, t)
        if self._sound.say is not None:
            self.robot.warn(self._sound.say)
        if self._sound.beep:
            self.robot.warn(None)


def run_drivers(
    drivers: Sequence[Driver], clock: Clock, longest: float, tell: Callable[[Driver, DriveTick], None] | None = None
) -> None:
    """Drive until all are through; `Driver.outcome` then says how it ended.

    Parameters
    ----------
    drivers
        Of this process.
    clock
        Its time 0 is the start.
    longest
        s after the start at which to end in any case.
    tell
        Called with every tick of every driver, which must not wait: the robots would. The last one tells of the zero
        command that stops the robot.

    Notes
    -----
    Robots are closed, and so stopped, however this ends.
    """
    over = False
    last: list[DriveTick] = []
    try:
        while clock.now() < 0:
            clock.wait(False)
        while not over:
            t = clock.now()
            ticks = [driver.tick(t) for driver in drivers]
            _tell_all(tell, drivers, ticks)
            over = clock.wait(all(tick.done for tick in ticks) or t >= longest)
        last = [driver.stand(clock.now()) for driver in drivers]
    finally:
        for driver in drivers:
            driver.robot.close()
    _tell_all(tell, drivers, last)


def _tell_all(
    tell: Callable[[Driver, DriveTick], None] | None, drivers: Sequence[Driver], ticks: Sequence[DriveTick]
) -> None:
    if tell is not None:
        for driver, tick in zip(drivers, ticks, strict=True):
            tell(driver, tick)
