"""One robot's loop: sense, decide, shape the command, send it."""

from collections.abc import Callable, Sequence

import numpy as np

from mp2a.robots import limits, slip, sound
from mp2a.robots.interface import NO_POSE, Pace, Robot, Sensed
from mp2a.robots.planner import Decision, Planner, origin_of
from mp2a.robots.steps import Step
from mp2a.robots.table import RobotInterface
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
    interface
        Its limits and rate.
    planner
        Decides.
    in_place
        Whether the robot stands at its place at the first tick at which its pose is known, and its fixed frame may lie
        anywhere; else its fixed frame is the planner's ground frame.
    """

    def __init__(
        self, role: str, robot: Robot, interface: RobotInterface, planner: Planner, in_place: bool = True
    ) -> None:
        self.role, self.robot = role, robot
        self._planner, self._dt = planner, 1.0 / interface.rate
        model = interface.model
        self._fastest = np.array([model.max_speed, model.max_turn_rate])
        self._most = np.array([model.max_acceleration, model.max_turn_acceleration])
        self._place = planner.place()
        self._origin: Array | None = None if in_place else np.zeros(3)
        self._sent: Array = _ZERO
        self._slip = slip.NO_SLIP_SEEN
        self._sound = sound.CLEAR

    def tick(self, t: float) -> Step:
        """Sense, decide and send, at ``t`` s after the start."""
        known = self.robot.sense()
        if known.points is not None:
            # As a PointCloud2 holds them: a record then has to the bit what the planner saw.
            known = known._replace(points=known.points.astype(np.float32))
        if self._origin is None and np.isfinite(known.pose).all():
            self._origin = origin_of(self._place, known.pose)
        sensed = known._replace(pose=NO_POSE if self._origin is None else compose(self._origin, known.pose))
        decision = self._planner.decide(t, sensed._replace(twist=np.nan_to_num(sensed.twist)))
        command = self._shape(sensed, decision)
        self.robot.send(command)
        self._sent = command
        self._make_sound(t, decision.blocked and not sensed.human)
        share = slip.share(self._slip, sensed.twist[0])
        return Step(
            t, known, sensed.pose, self._planner.leader(), command, share,
            decision.blocked, decision.error, decision.done,
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
        self._sound = sound.sound(self._sound, blocked, t)
        if self._sound.say is not None:
            self.robot.warn(self._sound.say)
        if self._sound.beep:
            self.robot.warn(None)


def run(
    drivers: Sequence[Driver], pace: Pace, longest: float, tell: Callable[[Driver, Step], None] | None = None
) -> bool:
    """Drive until all are through.

    Parameters
    ----------
    drivers
        Of this process.
    pace
        The clock; its time 0 is the start.
    longest
        s after the start at which to end in any case.
    tell
        Called with every tick of every driver, which must not wait: the robots would.

    Returns
    -------
    bool
        Whether all came to the end without an error.

    Notes
    -----
    Robots are closed, and so stopped, however this ends.
    """
    over = good = False
    try:
        while pace.now() < 0:
            pace.wait(False)
        while not over:
            t = pace.now()
            steps = [driver.tick(t) for driver in drivers]
            if tell is not None:
                for driver, step in zip(drivers, steps, strict=True):
                    tell(driver, step)
            done = all(step.done for step in steps)
            good = done and not any(step.error for step in steps)
            over = pace.wait(done or t >= longest)
    finally:
        for driver in drivers:
            driver.robot.close()
    return good
