"""What robots tell each other in a tick: the scan, and a word to those behind; here with all robots in one process.

`mp2a.formation.ranks` has the same for a robot a rank. Either serves the march arrays of the m robots of its process,
m = n or 1.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from mp2a.chain import Chain
from mp2a.dynamics import placements, rnea
from mp2a.exceptions import InputError
from mp2a.formation.plane import Motion, coordinates
from mp2a.methods.result import InverseDynamics
from mp2a.spatial import Array

SAMPLES = 2
"""Of a scan: the motion with all forces, and the same places at rest with the obstacles' forces alone."""


class Scan(NamedTuple):
    """What the scan tells the m robots of this process."""

    motion: Motion
    """In the ground frame, ``(m, 3)`` each."""
    force: Array
    """F that the virtual joint passes to the robot, in its frame, ``(m, 3)``, N, N, N m (paper, eq. 6)."""
    obstacles: Array
    """What obstacles press on the joint with, own and those of all robots behind, in the robot's frame, ``(m, 3)``."""


class Exchange(Protocol):
    """How the robots of this process reach the others."""

    robots: NDArray[np.intp]
    """Numbers of the robots of this process, ``(m,)``."""

    def hand_on(self, values: Array) -> Array:
        """Tell each robot's values ``(m, k)`` to those that hang on it; what own parents told, the leader's own 0."""
        ...

    def scan(self, joints: Motion, external: Array, wrong: InputError | None) -> Scan:
        """Inverse dynamics of all robots for joints ``(m, 3)`` and forces ``(m, 3)`` at the centres of mass."""
        ...


class OneProcess:
    """All n robots here.

    Parameters
    ----------
    chain
        Planar joints.
    method
        One of `mp2a.methods.METHODS` or "serial".
    """

    def __init__(self, chain: Chain, method: str = "sweep") -> None:
        self.chain = chain
        self.method = method
        self.robots = np.arange(len(chain))

    def hand_on(self, values: Array) -> Array:
        """Look the parents' values up."""
        return np.where(self.chain.parents[:, None] < 0, 0.0, values[self.chain.parents])

    def scan(self, joints: Motion, external: Array, wrong: InputError | None) -> Scan:
        """Run the scan with all robots in this process."""
        if wrong is not None:
            raise wrong
        q, v, a, forces = samples(joints, external)
        flat = (SAMPLES, -1)
        done = rnea(
            self.chain, q.reshape(flat), v.reshape(flat), a.reshape(flat), forces, method=self.method, bodies=True
        )
        if done.rotation is None or done.position is None:
            rotation, position = placements(self.chain, q[0].reshape(-1))
        else:
            rotation, position = done.rotation[0], done.position[0]
        return read_off(done, rotation, position)


def samples(joints: Motion, external: Array) -> tuple[Array, Array, Array, Array]:
    """Coordinates, velocities, accelerations and forces of both samples, ``(2, m, …)``."""
    q = coordinates(joints)
    force = np.zeros((len(q), 6))
    force[:, 2:5] = external[:, [2, 0, 1]]
    still = np.zeros_like(joints.velocity)
    return (
        np.stack((q, q)),
        np.stack((joints.velocity, still)),
        np.stack((joints.rate, still)),
        np.stack((force, force)),
    )


def read_off(done: InverseDynamics, rotation: Array, position: Array) -> Scan:
    """Plane motion and forces from ``(2, m, 6)`` spatial vectors."""
    velocity, acceleration = done.velocity[0][:, [3, 4, 2]], done.acceleration[0][:, [3, 4, 2]]
    # The classical acceleration of the origin less what its velocity turns with the frame.
    rate = acceleration + velocity[:, 2:] * np.stack((velocity[:, 1], -velocity[:, 0], np.zeros(len(velocity))), -1)
    heading = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    pose = np.concatenate((position[:, :2], heading[:, None]), axis=-1)
    force = done.force[..., [3, 4, 2]]
    # At rest a joint bears what the obstacles press with, and the weight, which has no part in the plane.
    return Scan(Motion(pose, velocity, rate), force[0], -force[1])
