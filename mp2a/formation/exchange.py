"""What robots tell each other in a tick: the scan, and a word to those behind; here with all robots in one process.

`mp2a.formation.ranks` has the same for a robot a rank. Either serves arrays of the m robots of its process, m = n or 1.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from mp2a.dynamics import rnea
from mp2a.exceptions import InputError
from mp2a.formation.plane import Motion, coordinates
from mp2a.model import Model
from mp2a.results import InverseDynamics
from mp2a.spatial import Array


class Bodies(NamedTuple):
    """What inverse dynamics of T samples says of the m robots of this process."""

    motion: Motion
    """In the ground frame, ``(T, m, 3)`` each."""
    force: Array
    """F that the virtual joint passes to the robot, in its frame, ``(T, m, 3)``, N, N, N m (paper, eq. 6)."""


class Scan(NamedTuple):
    """What the scan of a march tells the m robots of this process."""

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

    def send_to_children(self, values: Array) -> Array:
        """Tell each robot's values ``(m, k)`` to those that hang on it; what own parents told, the leader's own 0."""
        ...

    def run(self, joints: Motion, external: Array, wrong: InputError | None) -> Bodies:
        """Inverse dynamics of all robots for T samples in the same messages; collective.

        Parameters
        ----------
        joints
            Of the robots here, ``(T, m, 3)`` each; T is the same in every process.
        external
            ``(T, m, 3)`` forces at their centres of mass, in their frames, N, N, N m.
        wrong
            An error found here that every process is to raise.

        Raises
        ------
        InputError
            In every process, if there is one in any.
        """
        ...


class OneProcess:
    """All n robots here.

    Parameters
    ----------
    model
        Planar joints.
    method
        One of `mp2a.methods.METHODS` or "serial".
    """

    def __init__(self, model: Model, method: str = "sweep") -> None:
        self.model = model
        self.method = method
        self.robots = np.arange(len(model))

    def send_to_children(self, values: Array) -> Array:
        """Look the parents' values up."""
        return np.where(self.model.parents[:, None] < 0, 0.0, values[self.model.parents])

    def run(self, joints: Motion, external: Array, wrong: InputError | None) -> Bodies:
        """Run the scan with all robots in this process."""
        if wrong is not None:
            raise wrong
        q, v, a, forces = state(joints, external)
        flat = (len(q), -1)
        q = q.reshape(flat)
        done = rnea(self.model, q, v.reshape(flat), a.reshape(flat), forces, method=self.method, bodies=True)
        return bodies(done)


def scan(exchange: Exchange, joints: Motion, external: Array, wrong: InputError | None) -> Scan:
    """Inverse dynamics of a march for joints ``(m, 3)`` and obstacles' forces ``(m, 3)``; collective.

    Two samples: the motion with all forces, and the same places at rest with the obstacles' forces alone.
    """
    still = np.zeros_like(joints.velocity)
    both = (np.stack(pair) for pair in ((joints.pose,) * 2, (joints.velocity, still), (joints.rate, still)))
    done = exchange.run(Motion(*both), np.stack((external, external)), wrong)
    # At rest a joint bears what the obstacles press with, and the weight, which has no part in the plane.
    return Scan(Motion(*(x[0] for x in done.motion)), done.force[0], -done.force[1])


def state(joints: Motion, external: Array) -> tuple[Array, Array, Array, Array]:
    """Coordinates ``(T, m, 4)``, velocities, accelerations ``(T, m, 3)`` and spatial forces ``(T, m, 6)``."""
    force = np.zeros((*external.shape[:-1], 6))
    force[..., 2:5] = external[..., [2, 0, 1]]
    return coordinates(joints), joints.velocity, joints.rate, force


def bodies(done: InverseDynamics) -> Bodies:
    """Plane motion and forces from spatial vectors ``(T, m, 6)`` and placements ``(T, m, …)``."""
    rotation, position = done.placement
    velocity, acceleration = done.velocity[..., [3, 4, 2]], done.acceleration[..., [3, 4, 2]]
    # The classical acceleration of the origin less what its velocity turns with the frame.
    across = np.stack((velocity[..., 1], -velocity[..., 0], np.zeros_like(velocity[..., 0])), axis=-1)
    heading = np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])
    pose = np.concatenate((position[..., :2], heading[..., None]), axis=-1)
    return Bodies(Motion(pose, velocity, acceleration + velocity[..., 2:] * across), done.force[..., [3, 4, 2]])
