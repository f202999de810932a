r"""Virtual joints that yield: a mass on a spring with a damper in every direction of a planar joint.

.. math:: m \ddot δ + c \dot δ + k δ = τ_{ext}

δ is the displacement of the joint from where the formation wants it, in the axes of that place: along x and y in m, and
a turn in rad. The equation is linear, so a tick with a constant force has an exact solution; the step is stable for any
tick and stiffness, and keeps the books of energy exactly: work of the force = energy stored + energy dissipated.
Sources: the spring and damper formations of MacArthur and Crane (2007) and of Gulec and Unel (2005), refs. 9 and 10 of
the paper, whose virtual joints (I-B, III-C) these are.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mp2a.exceptions import InputError
from mp2a.se2 import PlanarMotion, rotate
from mp2a.spatial import Array


@dataclass(frozen=True)
class Springs:
    r"""What every virtual joint is made of.

    Attributes
    ----------
    mass
        m along x and y, kg. It is the joint's own, not the robot's: with the stiffness it says how quickly a robot
        makes way. The default takes √(m/k) = 1.4 s, so that a robot at 0.7 m/s swerves at less than 1 m/s.
    stiffness
        k along x and y, N/m.
    damping_ratio
        :math:`c / (2 \sqrt{k m})`; 1 is critical damping, the fastest return without overshoot.
    inertia, turning_stiffness
        The same for the turn, kg m² and N m/rad; an infinite stiffness is a joint that does not turn.

    Raises
    ------
    InputError
        If one of them is not positive.
    """

    mass: float = 200.0
    stiffness: float = 100.0
    damping_ratio: float = 1.0
    inertia: float = 20.0
    turning_stiffness: float = float("inf")

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value > 0 or (value == float("inf") and name != "turning_stiffness"):
                raise InputError(f"{name}: got {value!r}, expected a positive number")

    @property
    def masses(self) -> Array:
        """``(3,)``: for x, y and the turn."""
        return np.array([self.mass, self.mass, self.inertia])

    @property
    def stiffnesses(self) -> Array:
        """For x, y and the turn, ``(3,)``, N/m and N m/rad."""
        return np.array([self.stiffness, self.stiffness, self.turning_stiffness])

    @property
    def dampings(self) -> Array:
        """c, ``(3,)``, N s/m and N m s/rad; infinite where the stiffness is."""
        return 2 * self.damping_ratio * np.sqrt(self.stiffnesses * self.masses)


class Displacement(NamedTuple):
    """The displacement δ of joints and its derivatives, ``(..., 3)`` each: m, m, rad."""

    value: Array
    rate: Array
    acceleration: Array


class SpringSolution(NamedTuple):
    """The exact solution of a tick: what the state before contributes to the state after, ``(3,)`` each."""

    stay: Array
    """Value's part of the value."""
    drift: Array
    """Rate's part of the value, s."""
    pull: Array
    """Value's part of the rate, 1/s."""
    coast: Array
    """Rate's part of the rate."""


def none(joints: int) -> Displacement:
    """Return undisplaced joints."""
    return Displacement(*(np.zeros((joints, 3)) for _ in range(3)))


def solve(springs: Springs, tick: float) -> SpringSolution:
    """Solve the free motion over a tick in s; stiff and overdamped springs neither overflow nor ring."""
    rigid = np.isinf(springs.stiffnesses)
    frequency = np.sqrt(np.where(rigid, 1.0, springs.stiffnesses) / springs.masses)
    decay = springs.damping_ratio * frequency
    # cos and sin of an imaginary angle are cosh and sinh; the exponentials are put together before they can overflow.
    angle = np.sqrt(1 - springs.damping_ratio**2 + 0j) * frequency * tick
    ahead, behind = np.exp(1j * angle - decay * tick), np.exp(-1j * angle - decay * tick)
    cosine = ((ahead + behind) / 2).real
    small = np.abs(angle) < 1e-4
    safe = np.where(small, 1.0, angle)
    ratio = np.where(small, np.exp(-decay * tick) * (1 - angle**2 / 6).real, ((ahead - behind) / (2j * safe)).real)
    drift = ratio * tick
    step = (cosine + decay * drift, drift, -(frequency**2) * drift, cosine - decay * drift)
    return SpringSolution(*(np.where(rigid, 0.0, part) for part in step))


def give_way(springs: Springs, step: SpringSolution, before: Displacement, force: Array) -> Displacement:
    """Return the displacement after a tick under a constant force.

    Parameters
    ----------
    springs, step
        Joints, and their solution for the tick.
    before
        At the beginning of the tick.
    force
        τ_ext, ``(..., 3)``, N, N, N m, in the axes of the undisplaced joint.

    Returns
    -------
    Displacement
        Its acceleration is the one at the end of the tick, still under this force.
    """
    middle = force / springs.stiffnesses
    away = before.value - middle
    value = step.stay * away + step.drift * before.rate + middle
    rate = step.pull * away + step.coast * before.rate
    rigid = np.isinf(springs.stiffnesses)
    finite = np.where(rigid, 0.0, springs.stiffnesses), np.where(rigid, 0.0, springs.dampings)
    acceleration = np.where(rigid, 0.0, (force - finite[0] * value - finite[1] * rate) / springs.masses)
    return Displacement(value, rate, acceleration)


def energy(springs: Springs, now: Displacement) -> Array:
    """Return the kinetic energy and the energy of the springs, ``(...,)`` a joint, J."""
    stiffness = np.where(np.isinf(springs.stiffnesses), 0.0, springs.stiffnesses)
    out: Array = (springs.masses * now.rate**2 + stiffness * now.value**2).sum(-1) / 2
    return out


def joint(now: Displacement) -> PlanarMotion:
    """Return the motion of displaced joints, ``(..., 3)`` each, in their own axes."""
    angle, spin = now.value[..., 2], now.rate[..., 2:]
    velocity, pull = (rotate(-angle, x[..., :2]) for x in (now.rate, now.acceleration))
    left = np.stack((-velocity[..., 1], velocity[..., 0]), axis=-1)
    return PlanarMotion(
        now.value,
        np.concatenate((velocity, spin), axis=-1),
        np.concatenate((pull - spin * left, now.acceleration[..., 2:]), axis=-1),
    )
