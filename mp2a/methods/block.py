"""Blocks: a node that holds several consecutive bodies of a serial chain, the first of them its head.

A block is a composite body. What it presses on its head with is a segment as that of one body is, and so is the path
from head to head: ``compose(Q, J)``, with Q from the head of the block before to its tail and J across the own head's
joint. Q comes from the rank before, in a round of its own. After it every method runs on blocks as on bodies; then
each block works out its bodies: those behind the head are a chain whose base moves as the head does and whose last body
bears what is behind the tail.
"""

from typing import NamedTuple

import numpy as np

from mp2a.algebra import motion
from mp2a.joint_kinematics import BaseMotion, joint_torque
from mp2a.methods.node import Method, Nodes, single_bodies, unknown_placement
from mp2a.model import Model
from mp2a.results import InverseDynamics
from mp2a.schedule import SHIFT, TAIL, Schedule
from mp2a.serial import reduce_block, rnea
from mp2a.spatial import Array, force_to_child
from mp2a.transport.base import Transport
from mp2a.transport.steps import Operation, Register, Use
from mp2a.validation import JointState

DOUBLES = {TAIL: motion.DOUBLES}

_LAYOUT = {"tail": Register({"tail": motion.DOUBLES}), "path": Register({"path": motion.DOUBLES})}
_USES = {TAIL: Use("tail", after=(Operation("compose", "path", ("<tail", "path")),))}


class Block(NamedTuple):
    """Consecutive bodies of a serial chain."""

    bodies: Model
    head: Model
    """The first alone."""
    rest: Model | None
    """The others, if there are any."""


def block_of(bodies: Model) -> Block:
    """Take a block apart."""
    rest = bodies.block(range(1, len(bodies))) if len(bodies) > 1 else None
    return Block(bodies, bodies.body(0), rest)


def solve(
    method: Method, block: Block, state: JointState, gravity: Array, schedule: Schedule, transport: Transport
) -> InverseDynamics:
    """Inverse dynamics of the block of bodies that is this process's node.

    Parameters
    ----------
    method
        What to do between blocks.
    block
        m bodies.
    state, gravity
        Of these bodies; ``(3,)`` m/s².
    schedule
        Of the blocks, with a shift in front.
    transport
        Has one node here.

    Returns
    -------
    InverseDynamics
        With arrays ``(m, T, 6)``, and ``(T, nv)``.
    """
    bodies, head, rest = block
    first, behind = single_bodies(head, part(bodies, state, range(1))), part(bodies, state, range(1, len(bodies)))
    across, behind_head = reduce_block(rest, behind, loaded=method.loaded) if rest else (_at_rest(state.samples), None)

    def load() -> Array:
        own = first.load()
        return own if behind_head is None else own + behind_head

    def force(velocity: Array, acceleration: Array) -> Array:
        own = first.force(velocity, acceleration)
        return own + rnea(rest, behind, BaseMotion(velocity[0], acceleration[0])).base_force if rest else own

    path = _shift(across, first.path[0], schedule, transport)
    scan = method.scan(Nodes(path, load, force, blocks=True), gravity, schedule, transport)
    velocity, acceleration, force_on = scan.velocity, scan.acceleration, scan.force
    torque = joint_torque(head, force_on)
    if rest:
        assert scan.behind is not None
        turn, shift, _, _ = motion.view(across)
        tip = -force_to_child(turn, shift, scan.behind[0])
        found = rnea(rest, behind, BaseMotion(velocity[0], acceleration[0]), tip, bodies=True)
        assert found.bodies is not None
        rows = found.bodies.swapaxes(0, 1)
        velocity, acceleration, force_on = (
            np.concatenate((x, rows[..., k : k + 6]))
            for x, k in ((velocity, 0), (acceleration, 6), (force_on, 12))
        )  # fmt: skip
        torque = np.concatenate((torque, found.torque), axis=1)
    return InverseDynamics(velocity, acceleration, force_on, torque, unknown_placement)


def _at_rest(samples: int) -> Array:
    """Paths of no length, ``(T, 24)``."""
    out = np.zeros((samples, motion.DOUBLES))
    motion.view(out).rotation[:] = np.eye(3)
    return out


def _shift(across: Array, joint: Array, schedule: Schedule, transport: Transport) -> Array:
    """Path from the head of the block before to the own one, ``(1, T, 24)``."""
    registers = transport.registers(_LAYOUT, len(joint))
    registers["tail"][:], registers["path"][:] = across, joint
    transport.run(schedule.recurrence(SHIFT), _USES, registers)
    return registers["path"].copy()


def share(bodies: int, ranks: int) -> tuple[int, ...]:
    """Cut a chain into blocks as even as possible: the number of bodies of each rank, the larger ones first."""
    each, more = divmod(bodies, ranks)
    return (each + 1,) * more + (each,) * (ranks - more)


def part(model: Model, state: JointState, bodies: range) -> JointState:
    """JointState of consecutive bodies."""
    q, v = (slice(starts[bodies.start], starts[bodies.stop]) for starts in (model.q_starts, model.v_starts))
    external = None if state.external is None else state.external[bodies.start : bodies.stop]
    return JointState(state.q[:, q], state.v[:, v], state.a[:, v], external, state.single)
