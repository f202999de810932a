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
        self.robots = np.array([ranks.transport.first])

    def send_to_children(self, values: Array) -> Array:
        """Send the values to the ranks of those that hang on this one, and receive from the parent's."""
        told = self.ranks.send_to_children(values[0])
        return np.zeros_like(values) if told is None else told[None]

    def run(self, joints: Motion, external: Array, wrong: InputError | None) -> Bodies:
        """Run this rank's part of the scan."""
        q, v, a, forces = (x[:, 0] for x in state(joints, external))
        done = self.ranks.rnea(q, v, a, forces, wrong=wrong)
        placement = self.ranks.placement(q) if self.ranks.method == "kogge-stone" else done.placement
        velocity, acceleration, force = (x[:, None] for x in (done.velocity, done.acceleration, done.force))
        own = Placement(*(x[:, None] for x in placement))
        return bodies(InverseDynamics(velocity, acceleration, force, done.torque, own))
