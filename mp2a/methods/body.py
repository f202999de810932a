"""What a robot works out alone of its own joint and body, as operations that have compiled forms."""

from typing import Any

import numpy as np

from mp2a.algebra import inertia, motion
from mp2a.joint_kinematics import drive_forces, joint_motion, joint_torque
from mp2a.model import Model
from mp2a.program.operations import NOTHING, Operation, subtract
from mp2a.program.recorder import MethodRecorder
from mp2a.spatial import Array, body_force
from mp2a.validation import JointState


class SingleBody:
    """A body and the joint it hangs on.

    Parameters
    ----------
    body
        A model of one body.
    """

    def __init__(self, body: Model) -> None:
        (group,) = body.groups
        self._joint = np.concatenate((body.rotations.ravel(), body.translations[0], body.axes[0]))
        self._axis = np.ascontiguousarray(body.axes[0])
        self._inertia = inertia.from_body(body.masses, body.coms, body.origin_inertias, None, 1)[0, 0]

        def path(q: Array, v: Array, a: Array, _: Array) -> Array:
            return motion.from_joint(joint_motion(body, JointState(q[0], v[0], a[0], None, single=False)))

        def loaded(external: Array, _: Array) -> Array:
            return inertia.from_body(body.masses, body.coms, body.origin_inertias, external, external.shape[1])

        def force(velocity: Array, acceleration: Array, _: Array) -> Array:
            mass, com = body.masses[:, None], body.coms[:, None]
            return body_force(mass, com, body.origin_inertias[:, None], velocity, acceleration)

        def torque(force: Array, _: Array) -> Array:
            return joint_torque(body, force)[None]

        self._path = Operation(path, motion.DOUBLES, step=f"path_{group.joint.name}")
        self._loaded = Operation(loaded, inertia.DOUBLES, step="body_inertia")
        self._force = Operation(force, 6, step="body_force")

        def driven(torque: Array, q: Array, v: Array, a: Array) -> Array:
            forces = drive_forces(body, JointState(q[0], v[0], a[0], None, single=False))
            return torque if forces is None else torque + forces

        self._torque = Operation(torque, body.nv, step=f"torque_{group.joint.name}")
        self._driven = Operation(driven, body.nv) if body.armature.any() or body.has_joint_forces else None

    def path(self, q: Any, v: Any, a: Any) -> Any:
        """Path from the parent to the body, by the joint's values."""
        return self._path(q, v, a, self._joint)

    def inertia(self, external: Any, recorder: MethodRecorder) -> Any:
        """Composite inertia of the body alone, with the force from outside on it, which may be `NOTHING`."""
        return recorder.constant(self._inertia) if external is NOTHING else self._loaded(external, self._inertia)

    def force(self, velocity: Any, acceleration: Any, external: Any) -> Any:
        """Force that moves the body, less the one from outside."""
        return subtract(self._force(velocity, acceleration, self._inertia), external)

    def torque(self, force: Any, q: Any, v: Any, a: Any) -> Any:
        """Torque of the joint that passes a force to the body, and moves its own armature, damper and spring."""
        passed = self._torque(force, self._axis)
        return passed if self._driven is None else self._driven(passed, q, v, a)
