"""Blocks: a node that holds several consecutive bodies of a serial chain, the first of them its head.

A block is a composite body. What it presses on its head with is a segment as that of one body is, and so is the path
from head to head: ``compose(Q, J)``, with Q from the head of the block before to its tail and J across the own head's
joint. Q comes from the rank before, in a round of its own. After it every method runs on blocks as on bodies; then
each block works out its bodies from its head's motion and from what the bodies behind its tail press with.
"""

from typing import NamedTuple

import numpy as np

from mp2a import kernels
from mp2a.chain import Chain
from mp2a.leaf import State, joint_motion, joint_torque
from mp2a.methods.node import Method, Nodes
from mp2a.methods.result import InverseDynamics
from mp2a.schedule import SHIFT, TAIL, Schedule
from mp2a.segments import load, motion
from mp2a.spatial import Array, classical_to_spatial, force_to_child, spatial_to_classical
from mp2a.transport.base import Transport
from mp2a.transport.steps import Operation, Register, Use

DOUBLES = {TAIL: motion.DOUBLES}

_LAYOUT = {"tail": Register({"tail": motion.DOUBLES}), "path": Register({"path": motion.DOUBLES})}
_USES = {TAIL: Use("tail", after=(Operation("compose", "path", ("<tail", "path")),))}


class Inside(NamedTuple):
    """Motion and force of the bodies of a block, ``(m, T, 6)``."""

    velocity: Array
    acceleration: Array
    """Spatial."""
    force: Array
    """That each joint passes to its body."""


def solve(
    method: Method, bodies: Chain, state: State, gravity: Array, schedule: Schedule, transport: Transport
) -> InverseDynamics:
    """Inverse dynamics of the block of bodies that is this process's node.

    Parameters
    ----------
    method
        What to do between blocks.
    bodies
        m bodies, a serial chain.
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
    paths = motion.leaf(joint_motion(bodies, state))
    loads = load.leaf(bodies.masses, bodies.coms, bodies.origin_inertias, state.external, state.samples)
    across = tail(paths)
    inside: list[Inside] = []

    def force(velocity: Array, acceleration: Array) -> Array:
        inside.append(expand(paths, loads, velocity[0], classical_to_spatial(acceleration[0], velocity[0])))
        return inside[0].force[:1].copy()

    nodes = Nodes(_shift(across, paths[0], schedule, transport), lambda: reduce(paths, loads)[None], force, blocks=True)
    scan = method.scan(nodes, gravity, schedule, transport)
    if not inside:
        force(scan.velocity, scan.acceleration)
    found = inside[0]
    if scan.behind is not None:
        turn, shift, _, _ = motion.view(across)
        press(paths, found.force, force_to_child(turn, shift, scan.behind[0]))
    classical = spatial_to_classical(found.acceleration, found.velocity)
    return InverseDynamics(found.velocity, classical, found.force, joint_torque(bodies, found.force))


def tail(paths: Array) -> Array:
    """Path from the head of a block to its tail, ``(T, 24)``.

    Parameters
    ----------
    paths
        Across each body's joint, ``(m, T, 24)``.
    """
    out = _at_rest(paths.shape[1])
    for path in paths[1:]:
        kernels.compose(out, path, out=out)
    return out


def reduce(paths: Array, loads: Array) -> Array:
    """Put the bodies of a block together: what they press on its head with, ``(T, 28)``.

    Parameters
    ----------
    paths
        Across each body's joint, ``(m, T, 24)``.
    loads
        Of the single bodies, ``(m, T, 28)``.
    """
    out: Array = loads[-1].copy()
    for path, own in zip(paths[:0:-1], loads[-2::-1], strict=True):
        out = own + kernels.move(out, path)
    return out


def expand(paths: Array, loads: Array, velocity: Array, acceleration: Array) -> Inside:
    """Work out the bodies of a block from the motion of its head, with nothing behind its tail.

    Parameters
    ----------
    paths
        Across each body's joint, ``(m, T, 24)``.
    loads
        Of the single bodies, ``(m, T, 28)``.
    velocity, acceleration
        Of the head, ``(T, 6)``; spatial.
    """
    whole = np.empty_like(paths)  # a path from something that stands still, so that a motion is a path
    whole[0] = _at_rest(len(velocity))
    whole[0, :, 12:18], whole[0, :, 18:] = velocity, acceleration
    for i in range(1, len(paths)):
        kernels.compose(whole[i - 1], paths[i], out=whole[i])
    velocities, accelerations = whole[..., 12:18].copy(), whole[..., 18:].copy()
    force = kernels.force(loads, velocities, accelerations)
    for i in range(len(paths) - 1, 0, -1):
        force[i - 1] += kernels.carry(paths[i], force[i])
    return Inside(velocities, accelerations, force)


def press(paths: Array, force: Array, behind: Array) -> None:
    """Add to the forces ``(m, T, 6)`` of a block what the bodies behind take, ``(T, 6)`` at its tail."""
    for i in range(len(paths) - 1, -1, -1):
        force[i] += behind
        behind = kernels.carry(paths[i], behind)


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


def cut(chain: Chain, bodies: range) -> Chain:
    """Take consecutive bodies out of a serial chain, as a chain of their own."""
    part = slice(bodies.start, bodies.stop)
    return Chain(
        np.arange(len(bodies)) - 1, chain.joints[part], chain.axes[part], chain.rotations[part],
        chain.translations[part], chain.masses[part], chain.coms[part], chain.inertias[part], chain.names[part],
    )  # fmt: skip
