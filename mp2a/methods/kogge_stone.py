"""The paper's method: three Kogge-Stone scans of affine maps over 6×6 operators (eq. 4-10, figures 4-6)."""

from collections.abc import Mapping

import numpy as np

from mp2a.algebra import motion
from mp2a.algebra.affine import MATRIX_AND_VECTOR, VECTOR
from mp2a.methods.node import Nodes, Scan
from mp2a.schedule import Schedule
from mp2a.spatial import Array, apply, force_to_child, motion_operator, transpose, velocity_product
from mp2a.transport.base import Transport
from mp2a.transport.steps import Operation, Register, Use

_LAYOUT = {"window": Register({"matrix": 36, "vector": 6}, copies=2)}
_PUSH = Operation("push", "vector", ("matrix", "<vector", "vector"))
_USES = {
    MATRIX_AND_VECTOR: Use("window", after=(Operation("product", "matrix", ("matrix", "<matrix")), _PUSH)),
    VECTOR: Use("vector", after=(_PUSH,)),
}
"""The piece that comes lies before the own one (for forces: behind it). After a vector alone the window reaches the end
of the chain, and its matrix means nothing any more."""

_LAYOUT_OF_BLOCKS = _LAYOUT | {"behind": Register({"behind": 6})}
_BEHIND = Operation("push", "behind", ("matrix", "<vector", "behind"))
_USES_OF_BLOCKS = {kind: use.then(_BEHIND) for kind, use in _USES.items()}


def kogge_stone(nodes: Nodes, gravity: Array, schedule: Schedule, transport: Transport) -> Scan:
    r"""Scan velocity, acceleration and force.

    Each robot forms its own :math:`C_i, b_i` (eq. 7, 9, 10) and knows its own joint only. The paper's backward
    operator :math:`R_{i+1,i} P_{i,i+1}` holds the joint of the *next* robot, so the recurrence runs over the force
    that robot i passes inwards, :math:`G_i = C_i^T F_i` with :math:`C_i = P^T R^T`:

    .. math:: G_i = C_i^T G_{i+1} + C_i^T (M \dot V + [\dot M - \dot S M] V - F_{ext}), \quad F_i = C_i^{-T} G_i.

    The messages are as many and as large as the paper's.
    """
    r, p, relative, relative_acceleration = motion.view(nodes.path)
    outwards = motion_operator(r, p)
    registers = transport.registers(_LAYOUT_OF_BLOCKS if nodes.blocks else _LAYOUT, nodes.path.shape[1])

    def scan(recurrence: str, matrix: Array, vector: Array, uses: Mapping[str, Use] = _USES) -> Array:
        transport.flush()
        registers["matrix"].reshape(matrix.shape)[:], registers["vector"][:] = matrix, vector
        transport.run(schedule.recurrence(recurrence), uses, registers)
        return registers["vector"].copy()

    velocity = scan("velocity", outwards, relative)

    coriolis = velocity_product(p, r, velocity - relative, relative, velocity)
    rate = relative_acceleration + coriolis
    if transport.first == 0:
        rate[0] += apply(outwards[0], np.concatenate((np.zeros(3), -gravity)))
    acceleration = scan("acceleration", outwards, rate)

    inwards = transpose(outwards)
    passed = apply(inwards, nodes.force(velocity, acceleration))
    if not nodes.blocks:
        return Scan(velocity, acceleration, force_to_child(r, p, scan("force", inwards, passed)), None)
    registers["behind"][:] = 0.0
    force = force_to_child(r, p, scan("force", inwards, passed, _USES_OF_BLOCKS))
    return Scan(velocity, acceleration, force, force_to_child(r, p, registers["behind"]))
