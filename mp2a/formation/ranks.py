"""The exchange of a formation with one robot a rank."""

import numpy as np

from mp2a.distributed import DistributedModel
from mp2a.exceptions import InputError
from mp2a.formation.exchange import Bodies, bodies, state
from mp2a.formation.plane import Motion
from mp2a.results import InverseDynamics, Placement
from mp2a.spatial import Array


class OverRanks:
    """One robot a rank.

    Parameters
    ----------
    ranks
        The formation's chain over the communicator.
    """

    def __init__(self, ranks: DistributedModel) -> None:
        self.ranks = ranks
        self.robots = np.array([ranks.bodies.start])

    def send_to_children(self, values: Array) -> Array:
        """Send the values to the ranks of those that hang on this one, and receive from the parent's."""
        return self.ranks.send_to_children(values[0])[None]

    def run(self, joints: Motion, external: Array, wrong: InputError | None) -> Bodies:
        """Run this rank's part of the scan."""
        with self.ranks.together(self.ranks.rnea) as rnea:
            if wrong is not None:
                raise wrong
            q, v, a, forces = (x[:, 0] for x in state(joints, external))
            result = rnea(q, v, a, forces, bodies=True)
        velocity, acceleration, force = (x[:, None] for x in (result.velocity, result.acceleration, result.force))
        placement = Placement(*(x[:, None] for x in result.placement))
        return bodies(InverseDynamics(velocity, acceleration, force, result.torque, placement))
