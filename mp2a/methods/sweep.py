"""The whole inverse dynamics in one set of rounds, on a chain or a tree (theory, section 4)."""

from mp2a import kernels
from mp2a.algebra import inertia, motion
from mp2a.methods.node import Nodes, Scan
from mp2a.schedule import FORCE, MOTION, Schedule
from mp2a.spatial import Array, spatial_to_classical
from mp2a.transport.base import Transport
from mp2a.transport.steps import Operation, Register, Use

DOUBLES = {MOTION: motion.DOUBLES, FORCE: inertia.DOUBLES}

LONGER = Use("path", after=(Operation("compose", "path", ("<path", "path")),))
"""A path that comes is put above the own one."""

_LAYOUT = {
    "path": Register({"path": motion.DOUBLES}, copies=2),
    "below": Register({"below": inertia.DOUBLES}),
    "upwards": Register({"upwards": inertia.DOUBLES}, copies=2),
}
_USES = {
    MOTION: LONGER,
    FORCE: Use(
        "upwards",
        before=(Operation("transform", "upwards", ("below", "path")),),
        after=(Operation("add", "below", ("<upwards",)),),
    ),
}
_LAYOUT_OF_BLOCKS = _LAYOUT | {"behind": Register({"behind": inertia.DOUBLES})}
_USES_OF_BLOCKS = _USES | {FORCE: _USES[FORCE].then(Operation("add", "behind", ("<upwards",)))}


def sweep(nodes: Nodes, gravity: Array, schedule: Schedule, transport: Transport) -> Scan:
    """Scan motion and loads at once.

    A body keeps two segments: its motion across the path from its 2^e-th ancestor, and the load of all bodies fewer
    than 2^e below it. In a round it hands the first to those whose 2^e-th ancestor it is and the second, moved across
    the first, to its own; neither waits for the other.
    """
    registers = transport.registers(_LAYOUT_OF_BLOCKS if nodes.blocks else _LAYOUT, nodes.path.shape[1])
    registers["path"][:], registers["below"][:] = nodes.path, nodes.load()
    if nodes.blocks:
        registers["behind"][:] = 0.0
    transport.run(schedule.recurrence("sweep"), _USES_OF_BLOCKS if nodes.blocks else _USES, registers)
    path = registers["path"].copy()
    velocity, acceleration = read_off(path, gravity)
    force = kernels.force(registers["below"], velocity, acceleration)
    behind = kernels.force(registers["behind"], velocity, acceleration) if nodes.blocks else None
    return Scan(velocity, spatial_to_classical(acceleration, velocity), force, behind, path)


def read_off(path: Array, gravity: Array) -> tuple[Array, Array]:
    """Velocity and spatial acceleration ``(n, T, 6)`` of bodies whose paths reach the base, which falls with -g."""
    whole = motion.view(path)
    acceleration = whole.acceleration.copy()
    acceleration[..., 3:] -= gravity @ whole.rotation
    return whole.velocity.copy(), acceleration
