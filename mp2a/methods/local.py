"""Methods with every body of a model a node of this process."""

import numpy as np

from mp2a.algebra import inertia, motion
from mp2a.joint_kinematics import joint_motion
from mp2a.methods.node import Method, Own, ScanResult
from mp2a.model import Model
from mp2a.program.local import LocalRounds
from mp2a.spatial import Array, body_force
from mp2a.transport.local import LocalTransport
from mp2a.validation import JointState


def solve_locally(method: Method, model: Model, state: JointState, gravity: Array) -> tuple[ScanResult, LocalTransport]:
    """Run a method of inverse dynamics for all bodies at once.

    Parameters
    ----------
    method
        Of `mp2a.methods.METHODS`.
    model
        n bodies.
    state
        T samples, with numbers that were checked.
    gravity
        ``(3,)`` m/s².

    Returns
    -------
    ScanResult
        Arrays ``(n, T, 6)``; ``path``, if the method has it, ``(n, T, 24)``.
    LocalTransport
        What would have been sent.
    """
    rounds = LocalRounds(method.schedule(model.parents), method.messages)
    n, samples = len(model), state.samples
    base = np.where(model.parents[:, None, None] < 0, np.concatenate((np.zeros(3), -gravity)), 0.0)

    def own_inertia() -> Array:
        return inertia.from_body(model.masses, model.coms, model.origin_inertias, state.external, samples)

    def own_force(velocity: Array, acceleration: Array) -> Array:
        mass, com = model.masses[:, None], model.coms[:, None]
        out = body_force(mass, com, model.origin_inertias[:, None], velocity, acceleration)
        return out if state.external is None else out - state.external

    path = motion.from_joint(joint_motion(model, state))
    own = Own(path, own_inertia, own_force, gravity, base, lambda: np.zeros((n, samples, 6)))
    return method.scan(own, rounds), rounds.transport
