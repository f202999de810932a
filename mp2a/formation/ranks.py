"""The exchange of a formation with one robot a rank."""

import numpy as np

from mp2a.distributed import DistributedModel
from mp2a.exceptions import InputError
from mp2a.formation.exchange import Bodies, bodies, state
from mp2a.formation.plane import Motion
from mp2a.results import InverseDynamics
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
            done = rnea(q, v, a, forces, bodies=True)
        rotation, position = done.rotation, done.position
        assert rotation is not None and position is not None
        own = InverseDynamics(*(x[:, None] for x in (done.velocity, done.acceleration, done.force, done.torque)))
        return bodies(own, rotation[:, None], position[:, None])
