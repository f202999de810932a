"""The pipeline: what a formation without MP²A does, each robot waits for its neighbour."""

import time

import numpy as np

from mp2a.joint_kinematics import joint_motion, joint_torque
from mp2a.model import Model
from mp2a.spatial import Array, apply, cross, inertia_at_origin, motion_operator, skew, transpose
from mp2a.transport.link import Link
from mp2a.transport.wait import wait
from mp2a.validation import JointState, check_state

_MOTION, _FORCE = 1, 2


class Pipeline:
    """Inverse dynamics hop by hop: each robot waits for its neighbour, 2 (n - 1) hops.

    As quick as hops can be. With the spatial acceleration A = V̇ - [0; ω × v], velocity and acceleration of a robot are
    a linear map of its predecessor's, ``[V; A] -> [[C, 0], [-(s×) C, C]] [V; A] + [s; a]`` with s = H q̇ and a = H q̈, so
    that a hop is one product, formed before the message comes. A robot passes on first and works out its force after;
    and many samples can be cut into blocks, so that all robots are busy once the first block has come through.

    Parameters
    ----------
    link
        One rank a robot, in the order of the chain.
    model
        The whole chain.
    blocks
        Number of blocks the samples of a call are cut into, at most one a sample.

    Attributes
    ----------
    alone, hopping
        Processor seconds of all calls so far that this rank spent on its own body, which all robots do at the same
        time, and between a message's coming and its going on, which they do one after another.
    samples
        Samples of all calls so far.
    """

    def __init__(self, link: Link, model: Model, blocks: int = 1) -> None:
        self._link = link
        self._rank, self._last = link.comm.Get_rank(), link.comm.Get_size() - 1
        self._blocks = blocks
        self.body = model.body(self._rank)
        self._inertia = _spatial_inertia(self.body)
        self.alone = self.hopping = 0.0
        self.samples = 0

    def rnea(self, q: Array, v: Array, a: Array) -> Array:
        """Torque ``(T, nv)`` of this robot's joint from its own q ``(T, nq)``, v and a ``(T, nv)``; collective."""
        began = time.process_time()
        state = check_state(self.body, q, v, a, None)
        hop, added, operator = self._prepare(state)
        motion = np.empty((state.samples, 12))
        blocks = np.array_split(np.arange(state.samples), min(self._blocks, state.samples))
        cuts = [slice(block[0], block[-1] + 1) for block in blocks]
        self.alone += time.process_time() - began
        sent = []
        for cut in cuts:
            if self._rank > 0:
                self._link.finish(self._link.receive(motion[cut], self._rank - 1, _MOTION))
            else:
                motion[cut] = np.concatenate((np.zeros(9), -self.body.gravity))
            began = time.process_time()
            motion[cut] = apply(hop[cut], motion[cut]) + added[cut]
            if self._rank < self._last:
                sent.append(self._link.send(motion[cut], self._rank + 1, _MOTION))
            self.hopping += time.process_time() - began
        began = time.process_time()
        force = self._force(motion)
        passed = np.empty_like(force)
        self.alone += time.process_time() - began
        for cut in cuts:
            if self._rank < self._last:
                self._link.finish(self._link.receive(passed[cut], self._rank + 1, _FORCE))
            began = time.process_time()
            if self._rank < self._last:
                force[cut] += passed[cut]
            if self._rank > 0:
                passed[cut] = apply(transpose(operator[cut]), force[cut])
                sent.append(self._link.send(passed[cut], self._rank - 1, _FORCE))
            self.hopping += time.process_time() - began
        torque = joint_torque(self.body, force[None])
        for request in sent:
            wait(request)
        self.samples += state.samples
        return torque

    def _prepare(self, state: JointState) -> tuple[Array, Array, Array]:
        """Map of a hop ``(T, 12, 12)``, what it adds ``(T, 12)``, and the motion operator ``(T, 6, 6)``."""
        joint = joint_motion(self.body, state)
        relative = joint.velocity[0]
        hop = np.zeros((state.samples, 12, 12))
        operator = hop[:, :6, :6]
        operator[:] = motion_operator(joint.rotation[0], joint.translation[0])
        hop[:, 6:, 6:] = operator
        np.matmul(_motion_cross(-relative), operator, out=hop[:, 6:, :6])
        return hop, np.concatenate((relative, joint.acceleration[0]), axis=1), operator

    def _force(self, motion: Array) -> Array:
        """Force ``I A + V ×* I V`` that moves this body, ``(T, 6)``."""
        velocity, acceleration = motion[:, :6], motion[:, 6:]
        momentum = velocity @ self._inertia
        turning = cross(velocity[:, :3], momentum[:, :3]) + cross(velocity[:, 3:], momentum[:, 3:])
        pushing = cross(velocity[:, :3], momentum[:, 3:])
        out: Array = acceleration @ self._inertia + np.concatenate((turning, pushing), axis=1)
        return out


def _spatial_inertia(body: Model) -> Array:
    """6×6 inertia about the origin of a chain's first body, ``[angular; linear]``; symmetric."""
    mass, com = body.masses[0], body.coms[0]
    lever = mass * skew(com)
    upper = inertia_at_origin(body.masses, body.coms, body.inertias)[0]
    return np.block([[upper, lever], [-lever, mass * np.eye(3)]])


def _motion_cross(motion: Array) -> Array:
    """Matrix of the spatial cross product of motions, ``(T, 6)`` to ``(T, 6, 6)``."""
    out = np.zeros((len(motion), 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = skew(motion[:, :3])
    out[:, 3:, :3] = skew(motion[:, 3:])
    return out
