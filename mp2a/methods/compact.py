"""The fewest bytes: one scan of motion outwards, then one of forces inwards, on a chain or a tree."""

from mp2a.algebra import motion
from mp2a.methods.node import Nodes, Scan
from mp2a.methods.sweep import LONGER, read_off
from mp2a.schedule import FORCE, MOTION, Schedule
from mp2a.spatial import Array, spatial_to_classical
from mp2a.transport.base import Transport
from mp2a.transport.steps import Operation, Register, Use

DOUBLES = {MOTION: motion.DOUBLES, FORCE: 6}

_OUTWARDS = {MOTION: LONGER}
_INWARDS = {
    FORCE: Use(
        "carried",
        before=(Operation("transform_force", "carried", ("path@motion", "force")),),
        after=(Operation("add", "force", ("<carried",)),),
    )
}
_INWARDS_OF_BLOCKS = {FORCE: _INWARDS[FORCE].then(Operation("add", "behind", ("<carried",)))}


def compact(nodes: Nodes, gravity: Array, schedule: Schedule, transport: Transport) -> Scan:
    """Scan motion, then force.

    A body remembers the path to its 2^e-th ancestor of every round. With it, it carries its force itself to where it
    sends it, so that a force is 6 numbers on the wire.
    """
    outwards = schedule.recurrence("motion")
    layout = {
        "path": Register({"path": motion.DOUBLES}, copies=max(len(outwards) + 1, 2)),
        "force": Register({"force": 6}),
        "carried": Register({"carried": 6}, copies=2),
    }
    if nodes.blocks:
        layout["behind"] = Register({"behind": 6})
    registers = transport.registers(layout, nodes.path.shape[1])
    registers["path"][:] = nodes.path
    transport.run(outwards, _OUTWARDS, registers)
    path = registers["path"].copy()
    velocity, acceleration = read_off(path, gravity)
    classical = spatial_to_classical(acceleration, velocity)
    registers["force"][:] = nodes.force(velocity, classical)
    if nodes.blocks:
        registers["behind"][:] = 0.0
    transport.run(schedule.recurrence("force"), _INWARDS_OF_BLOCKS if nodes.blocks else _INWARDS, registers)
    behind = registers["behind"].copy() if nodes.blocks else None
    return Scan(velocity, classical, registers["force"].copy(), behind, path)


def outwards(path: Array, schedule: Schedule, transport: Transport) -> Array:
    """Scan motion alone: paths from the base to all nodes, ``(nodes, T, 24)``.

    Parameters
    ----------
    path
        From each node's parent to it, ``(nodes, T, 24)``.
    schedule, transport
        With rounds of a recurrence "motion", as `mp2a.schedule.motion` has them.
    """
    registers = transport.registers({"path": Register({"path": motion.DOUBLES}, copies=2)}, path.shape[1])
    registers["path"][:] = path
    transport.run(schedule.recurrence("motion"), _OUTWARDS, registers)
    return registers["path"].copy()
