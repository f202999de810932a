"""What robots tell each other in a tick: the scan, a word to those behind, and a word of the leader to all.

Either exchange serves arrays of the m robots of its process: all n in one process, or one a rank.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from mp2a.dynamics import rnea
from mp2a.model import Model
from mp2a.results import InverseDynamics, Placement
from mp2a.se2 import PlanarMotion
from mp2a.spatial import Array

if TYPE_CHECKING:
    from mp2a.distributed import DistributedModel


class PlanarDynamics(NamedTuple):
    """What inverse dynamics of T samples says of the m robots of this process."""

    motion: PlanarMotion
    """In the ground frame, ``(T, m, 3)`` each."""
    force: Array
    """F that the virtual joint passes to the robot, in its frame, ``(T, m, 3)``, N, N, N m (paper, eq. 6)."""


RunDynamics: TypeAlias = Callable[[PlanarMotion, Array], PlanarDynamics]
"""`Exchange.run`, or what `Exchange.together` makes of it."""
Broadcast: TypeAlias = Callable[[Array], Array]
"""`Exchange.broadcast`, or what `Exchange.together` makes of it."""
Shared = TypeVar("Shared", bound=Callable[..., Any])


class Exchange(Protocol):
    """How the robots of this process reach the others. All methods are collective."""

    robots: NDArray[np.intp]
    """Numbers of the robots of this process, ``(m,)``."""

    def send_to_children(self, values: Array) -> Array:
        """Send each robot's values ``(m, k)`` to its children, and return those of its parent; zeros to the leader."""
        ...

    def broadcast(self, values: Array) -> Array:
        """Return the values ``(k,)`` of the leader's process in every process; others give any k numbers."""
        ...

    def run(self, joints: PlanarMotion, external: Array) -> PlanarDynamics:
        """Run inverse dynamics of all robots for T samples in the same messages.

        Parameters
        ----------
        joints
            Those of the robots here, ``(T, m, 3)`` each; T is the same in every process.
        external
            ``(T, m, 3)`` forces at their centres of mass, in their frames, N, N, N m.
        """
        ...

    def together(self, call: Shared) -> AbstractContextManager[Shared]:
        """Return a context that gives a method of this exchange, to be called once in it.

        What is raised in the context before the call, in any process, is raised in all that make the call.
        """
        ...


class LocalExchange:
    """All n robots in this process.

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

    def broadcast(self, values: Array) -> Array:
        """Return the values, which are the leader's."""
        return values

    def run(self, joints: PlanarMotion, external: Array) -> PlanarDynamics:
        """Run the scan with all robots in this process."""
        q, v, a, forces = _joint_state(joints, external)
        samples = len(q)
        q, v, a = (x.reshape(samples, -1) for x in (q, v, a))
        return _in_the_plane(rnea(self.model, q, v, a, forces, method=self.method, bodies=True))

    def together(self, call: Shared) -> AbstractContextManager[Shared]:
        """Return the call itself: an error here is nobody else's."""
        return nullcontext(call)


class MPIExchange:
    """One robot a rank.

    Parameters
    ----------
    ranks
        The formation's model over the communicator.
    """

    def __init__(self, ranks: "DistributedModel") -> None:
        self.ranks = ranks
        self.robots = np.array([ranks.bodies.start])

    def send_to_children(self, values: Array) -> Array:
        """Send the values to the children's ranks, and receive from the parent's."""
        return self.ranks.send_to_children(values[0])[None]

    def broadcast(self, values: Array) -> Array:
        """Send the first rank's values along the chain."""
        return self.ranks.broadcast(values)

    def run(self, joints: PlanarMotion, external: Array) -> PlanarDynamics:
        """Run this rank's part of the scan."""
        return _on_this_rank(self.ranks.rnea, joints, external)

    @contextmanager
    def together(self, call: Shared) -> Iterator[Shared]:
        """Share an error of any rank before `run` or `broadcast` with all."""
        if call == self.broadcast:
            with self.ranks.together(self.ranks.broadcast) as shared:
                yield cast("Shared", shared)
        else:
            with self.ranks.together(self.ranks.rnea) as shared:
                yield cast("Shared", partial(_on_this_rank, shared))


class FormationScan(NamedTuple):
    """What the scan tells the m robots of this process."""

    motion: PlanarMotion
    """In the ground frame, ``(m, 3)`` each."""
    force: Array
    """F that the virtual joint passes to the robot, in its frame, ``(m, 3)``, N, N, N m (paper, eq. 6)."""
    obstacles: Array
    """What obstacles press on the joint with, own and those of all robots behind, in the robot's frame, ``(m, 3)``."""


def scan_formation(run: RunDynamics, joints: PlanarMotion, external: Array) -> FormationScan:
    """Run inverse dynamics for joints ``(m, 3)`` and obstacles' forces ``(m, 3)``; collective.

    Two samples: the motion with all forces, and the same places at rest with the obstacles' forces alone.
    """
    pairs = zip(joints, PlanarMotion.at_rest(joints.pose), strict=True)
    result = run(PlanarMotion(*map(np.stack, pairs)), np.stack((external, external)))
    # At rest a joint bears what the obstacles press with, and the weight, which has no part in the plane.
    return FormationScan(PlanarMotion(*(x[0] for x in result.motion)), result.force[0], -result.force[1])


def _joint_state(joints: PlanarMotion, external: Array) -> tuple[Array, Array, Array, Array]:
    """Return coordinates ``(T, m, 4)``, velocities, accelerations ``(T, m, 3)`` and spatial forces ``(T, m, 6)``."""
    force = np.zeros((*external.shape[:-1], 6))
    force[..., 2:5] = external[..., [2, 0, 1]]
    return joints.coordinates(), joints.velocity, joints.rate, force


def _on_this_rank(call: Callable[..., InverseDynamics], joints: PlanarMotion, external: Array) -> PlanarDynamics:
    result = call(*(x[:, 0] for x in _joint_state(joints, external)), bodies=True)
    velocity, acceleration, force = (x[:, None] for x in (result.velocity, result.acceleration, result.force))
    placement = Placement(*(x[:, None] for x in result.placement))
    return _in_the_plane(InverseDynamics(velocity, acceleration, force, result.torque, placement))


def _in_the_plane(result: InverseDynamics) -> PlanarDynamics:
    """Return plane motion and forces from spatial vectors ``(T, m, 6)`` and placements ``(T, m, …)``."""
    rotation, position = result.placement
    velocity, acceleration = result.velocity[..., [3, 4, 2]], result.acceleration[..., [3, 4, 2]]
    # The classical acceleration of the origin less what its velocity turns with the frame.
    across = np.stack((velocity[..., 1], -velocity[..., 0], np.zeros_like(velocity[..., 0])), axis=-1)
    heading = np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])
    pose = np.concatenate((position[..., :2], heading[..., None]), axis=-1)
    motion = PlanarMotion(pose, velocity, acceleration + velocity[..., 2:] * across)
    return PlanarDynamics(motion, result.force[..., [3, 4, 2]])
