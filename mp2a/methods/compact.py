"""The fewest bytes: one scan of motion outwards, then one of forces inwards, on a chain or a tree."""

from mp2a.chain import Chain
from mp2a.leaf import State, joint_motion, joint_torque
from mp2a.methods.result import InverseDynamics
from mp2a.methods.sweep import LONGER, read_off
from mp2a.schedule import FORCE, MOTION, Schedule
from mp2a.segments import motion
from mp2a.spatial import Array, body_force, spatial_to_classical
from mp2a.transport.base import Transport
from mp2a.transport.steps import Operation, Register, Use

DOUBLES = {MOTION: motion.DOUBLES, FORCE: 6}

_OUTWARDS = {MOTION: LONGER}
_INWARDS = {
    FORCE: Use(
        "carried",
        before=(Operation("carry", "carried", ("path@motion", "force")),),
        after=(Operation("add", "force", ("<carried",)),),
    )
}


def compact(bodies: Chain, state: State, gravity: Array, schedule: Schedule, transport: Transport) -> InverseDynamics:
    """Inverse dynamics of the bodies this process holds.

    A body remembers the path to its 2^e-th ancestor of every round. With it, it carries its force itself to where it
    sends it, so that a force is 6 numbers on the wire.
    """
    outwards = schedule.recurrence("motion")
    layout = {
        "path": Register({"path": motion.DOUBLES}, copies=max(len(outwards) + 1, 2)),
        "force": Register({"force": 6}),
        "carried": Register({"carried": 6}, copies=2),
    }
    registers = transport.registers(layout, state.samples)
    registers["path"][:] = motion.leaf(joint_motion(bodies, state))
    transport.run(outwards, _OUTWARDS, registers)
    velocity, acceleration = read_off(registers["path"], gravity)
    classical = spatial_to_classical(acceleration, velocity)
    force = registers["force"]
    mass, com = bodies.masses[:, None], bodies.coms[:, None]
    force[:] = body_force(mass, com, bodies.origin_inertias[:, None], velocity, classical)
    if state.external is not None:
        force -= state.external
    transport.run(schedule.recurrence("force"), _INWARDS, registers)
    return InverseDynamics(velocity, classical, force.copy(), joint_torque(bodies, force))
