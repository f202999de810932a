"""What is left of a commanded turn once the wheels have slipped, learned while driving.

A skid-steer robot turns by dragging its wheels sideways, and turns less than it is told: Clearpath's HUSKY in a physics
engine makes 0.417 rad/s of 0.5 on the spot and 0.161 at 0.5 m/s. So a turn is commanded larger by the share that
odometry shows to be left. The share is learned at two speeds, standing and `FULL_SPEED`, and taken as linear between
them, by normalised least mean squares (Haykin, Adaptive Filter Theory, chapter 6), a rule of one line that no single
wrong measurement throws off. The command is looked at as it was when the robot can have begun to answer it, both go
through the same low-pass, and learning is slow beside both, so that the robot's lag is not taken for slip. Why not an
integral of the error: it would know one speed at a time, and wind up while the turn rate is at its limit; the share
does neither. What is learned is right at the speed driven; at another one it is a first guess, the better the more both
were driven.
"""

import math
from typing import NamedTuple

import numpy as np

from mp2a.spatial import Array

FULL_SPEED = 0.5
"""m/s from which on the share stays what it is there."""
SMOOTHING = 0.3
"""s, of the low-pass."""
LAG = 0.2
"""s after which a new turn rate begins to show in odometry; two thirds of it show after half a second (HUSKY in the
physics engine)."""
LEARNING = 3.0
"""s of turning in which two thirds of a wrong share are put right. Within 0.5 s and without a lag, turns into a corner
were enlarged so much that robots in a column overshot it, backed, and most often touched the next one."""
LEAST_TURN = 0.05
"""rad/s below which a turn teaches nothing."""
LEAST_SHARE, MOST_SHARE = 0.2, 1.2
"""What a share is taken to be at least and at most, so that one bad sensor cannot multiply a turn by more than five."""


class Slip(NamedTuple):
    """What has been learned of one robot."""

    shares: Array
    """``(2,)``: of a commanded turn that is left, standing and at `FULL_SPEED`."""
    sent: Array
    """``(2,)`` rad/s: commanded turn rate, smoothed, weighted with how much it is one of standing and of driving."""
    turned: float
    """rad/s: measured turn rate, smoothed."""
    waiting: tuple[float, ...]
    """rad/s: turn rates commanded during the last `LAG`, oldest first."""


NO_SLIP_SEEN = Slip(np.ones(2), np.zeros(2), 0.0, ())
"""Before the first turn: all of it is left."""


def _weights(speed: float) -> Array:
    driving = min(abs(speed) / FULL_SPEED, 1.0)
    return np.array([1.0 - driving, driving])


def remaining_share(slip: Slip, speed: float) -> float:
    """Return what share of a commanded turn is left at a speed, m/s."""
    return float(_weights(speed) @ slip.shares)


def compensate(slip: Slip, command: Array, speed: float) -> Array:
    """Enlarge the turn of a command ``(2,)`` at ``speed``, m/s, so that after slip it is as wanted."""
    return np.array([command[0], command[1] / remaining_share(slip, speed)])


def learn(slip: Slip, sent: float, twist: Array, dt: float) -> Slip:
    """Take in what came of a command.

    Parameters
    ----------
    slip
        Known so far.
    sent
        Turn rate that was in force for the last ``dt`` s, rad/s.
    twist
        ``(2,)`` measured now, m/s and rad/s; not a number teaches nothing.
    dt
        s

    Returns
    -------
    Slip
        Known now.
    """
    late = round(LAG / dt)
    waiting = (*slip.waiting, sent)[-late - 1 :]
    if not np.isfinite(twist).all():
        return slip._replace(sent=np.zeros(2), turned=0.0, waiting=waiting)
    answered = waiting[0] if len(waiting) > late else 0.0
    new = 1.0 - math.exp(-dt / SMOOTHING)
    smooth = slip.sent + new * (_weights(twist[0]) * answered - slip.sent)
    turned = slip.turned + new * (float(twist[1]) - slip.turned)
    if abs(smooth.sum()) < LEAST_TURN:
        return Slip(slip.shares, smooth, turned, waiting)
    error = turned - float(slip.shares @ smooth)
    step = (1.0 - math.exp(-dt / LEARNING)) * error / float(smooth @ smooth)
    return Slip(np.clip(slip.shares + step * smooth, LEAST_SHARE, MOST_SHARE), smooth, turned, waiting)
