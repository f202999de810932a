"""What a method is given of each node, and what it finds out: the same for single bodies and for blocks."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from mp2a.algebra import inertia, motion
from mp2a.exceptions import InputError
from mp2a.joint_kinematics import joint_motion, joint_torque
from mp2a.model import Model
from mp2a.results import InverseDynamics, Placement
from mp2a.schedule import Formation, Schedule
from mp2a.serial import reduce_block
from mp2a.spatial import Array, body_force
from mp2a.transport.base import Transport
from mp2a.validation import JointState


class Nodes(NamedTuple):
    """What the nodes of a process know by themselves; a node is a body, or a block of which the first is its head."""

    path: Array
    """From the parent's head to the own one, ``(nodes, T, 24)``."""
    load: Callable[[], Array]
    """Work out how the node presses on its head, ``(nodes, T, 28)``."""
    force: Callable[[Array, Array], Array]
    """Force that the node takes at its head for the head's velocity and classical acceleration, ``(nodes, T, 6)``."""
    blocks: bool
    """Whether a node may have more than one body, so that it has to know what lies behind it."""


class Scan(NamedTuple):
    """What the nodes know after the exchanges, ``(nodes, T, 6)``, at their heads."""

    velocity: Array
    acceleration: Array
    """Classical."""
    force: Array
    """That the joint passes to the head."""
    behind: Array | None
    """The part of it that goes to what is behind the node; None unless nodes are blocks. It comes from what was
    received, not from a difference, in which digits would be lost."""
    path: Array | None = None
    """From the base to the heads, ``(nodes, T, 24)``, where the method has it."""


def single_bodies(bodies: Model, state: JointState) -> Nodes:
    """Make each body a node."""

    def leaf() -> Array:
        return inertia.from_body(bodies.masses, bodies.coms, bodies.origin_inertias, state.external, state.samples)

    def force(velocity: Array, acceleration: Array) -> Array:
        mass, com = bodies.masses[:, None], bodies.coms[:, None]
        out = body_force(mass, com, bodies.origin_inertias[:, None], velocity, acceleration)
        if state.external is not None:
            out -= state.external
        return out

    path = (
        reduce_block(bodies, state, loaded=False)[0][None]
        if len(bodies) == 1
        else motion.from_joint(joint_motion(bodies, state))
    )
    return Nodes(path, leaf, force, blocks=False)


class Work(NamedTuple):
    """Arithmetic of one robot in one round, as measured on one core; it weighs methods against each other."""

    call: float
    """s, whatever the number of samples, of a recorded round"""
    sample: float
    """s a sample"""

    def seconds(self, samples: int) -> float:
        """Time of a round for some samples."""
        return self.call + samples * self.sample


class Method(NamedTuple):
    """A distributed method: who talks to whom, and what each robot does."""

    schedule: Callable[[Formation], Schedule]
    """Schedule for the parents of a formation."""
    doubles: Mapping[str, int]
    """Numbers a sample in each kind of message."""
    work: Work
    """Mean over the rounds."""
    scan: Callable[[Nodes, Array, Schedule, Transport], Scan]
    """``(nodes of this process, gravity, schedule, transport)`` to what they know after the exchanges."""
    loaded: bool
    """Whether it asks nodes for their load."""

    def solve(
        self, bodies: Model, state: JointState, gravity: Array, schedule: Schedule, transport: Transport
    ) -> InverseDynamics:
        """Inverse dynamics of the bodies this process holds, each a node."""
        velocity, acceleration, force, _, path = self.scan(single_bodies(bodies, state), gravity, schedule, transport)
        placement = unknown_placement if path is None else Placement(*motion.view(path)[:2])
        return InverseDynamics(velocity, acceleration, force, joint_torque(bodies, force), placement)


def unknown_placement() -> Placement:
    """Say that a method does not tell it."""
    raise InputError(
        "placement: not known to this rank from 'kogge-stone' or for blocks of bodies, "
        "expected a call of mp2a.DistributedModel.placement"
    )
