"""What a rank holds: consecutive bodies of a serial chain, the first of them the head, or one body of any tree.

A block is a composite body. What it presses on its head with is a segment as that of one body is, and so is the path
from head to head: ``compose(Q, J)``, with Q from the head of the block before to its tail and J across the own head's
joint. Q comes from the rank before, in a round of its own. After it every method runs on blocks as on bodies; then
each block works out its bodies: those behind the head are a chain whose base moves as the head does and whose last body
bears what is behind the tail.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from mp2a.algebra import inertia, motion
from mp2a.joint_kinematics import BaseMotion, joint_torque
from mp2a.methods.compact import MESSAGES, scan_motion
from mp2a.methods.node import Method, Own
from mp2a.model import Model
from mp2a.program.operations import NOTHING, compose
from mp2a.program.recorder import MethodRecorder, Program
from mp2a.results import Placement
from mp2a.schedule import SHIFT, TAIL, Schedule
from mp2a.serial import placements, reduce_block, rnea
from mp2a.spatial import Array, apply, body_force, force_to_child
from mp2a.validation import JointState

SHIFT_MESSAGES = {TAIL: {"tail": motion.IDENTITY}}
DOUBLES = {TAIL: motion.DOUBLES}


class BodyResults(NamedTuple):
    """Motion and force of a rank's m bodies, ``(m, T, 6)``."""

    velocity: Array
    acceleration: Array
    force: Array


class Block:
    """A rank's bodies, and what it works out by itself.

    Parameters
    ----------
    bodies
        m bodies; more than one are a serial chain.
    rank
        The block's node in the schedule.
    on_base
        Whether the head hangs on the base.
    gravity
        ``(3,)`` m/s² in the base frame.
    """

    def __init__(self, bodies: Model, rank: int, on_base: bool, gravity: Array) -> None:
        self.bodies, self.head = bodies, bodies.body(0)
        self.rest = bodies.block(range(1, len(bodies))) if len(bodies) > 1 else None
        self._rank, self._on_base, self._gravity = rank, on_base, gravity
        self._state = self._behind = still_state(bodies)
        self._across = motion.IDENTITY

    # ---- recording ---------------------------------------------------------------------------------------------

    def record(self, method: Method, schedule: Schedule) -> Program:
        """Record a method's part of this rank; its outputs are named as those of a `ScanResult`."""
        recorder = MethodRecorder(schedule, {**SHIFT_MESSAGES, **method.messages}, self._rank)
        base = np.concatenate((np.zeros(3), -self._gravity)) if self._on_base else NOTHING
        own = Own(
            path=self._record_path(recorder),
            inertia=lambda: recorder.input("inertia", inertia.DOUBLES),
            force=lambda velocity, acceleration: recorder.compute(self._force, 6, velocity, acceleration),
            gravity=self._gravity,
            base=base,
            no_force=lambda: recorder.input("no_force", 6),
        )
        scan = method.scan(own, recorder)
        return recorder.program((scan if self.rest else scan._replace(distal_force=NOTHING))._asdict())

    def record_motion(self, schedule: Schedule) -> Program:
        """Record the rounds of motion alone; its output is ``path``."""
        recorder = MethodRecorder(schedule, {**SHIFT_MESSAGES, **MESSAGES}, self._rank)
        return recorder.program({"path": scan_motion(self._record_path(recorder), recorder)[-1]})

    def _record_path(self, recorder: MethodRecorder) -> Any:
        """Path from the head of the block before to the own one."""
        path = recorder.input("joint", motion.DOUBLES)
        for round_ in recorder.recurrence(SHIFT):
            (tail,) = recorder.exchange(round_, tail=recorder.input("across", motion.DOUBLES))
            path = compose(tail, path)
        return path

    # ---- before the rounds -------------------------------------------------------------------------------------

    def inputs(self, state: JointState, wanted: Mapping[str, object]) -> dict[str, Array]:
        """Work out the inputs of a program, for T samples whose numbers were checked; keeps them for what follows."""
        self._state = state
        own = part(self.bodies, state, range(1))
        behind_head = None
        if self.rest is not None:
            self._behind = part(self.bodies, state, range(1, len(self.bodies)))
            self._across, behind_head = reduce_block(self.rest, self._behind, loaded="inertia" in wanted)
        out = {"joint": reduce_block(self.head, own, loaded=False)[0][None]}
        if "no_force" in wanted:
            out["no_force"] = np.zeros((1, state.samples, 6))
        if "across" in wanted:
            out["across"] = np.broadcast_to(self._across, (1, state.samples, motion.DOUBLES))
        if "inertia" in wanted:
            head = self.head
            load = inertia.from_body(head.masses, head.coms, head.origin_inertias, own.external, state.samples)
            out["inertia"] = load if behind_head is None else load + behind_head
        return out

    def _force(self, velocity: Array, acceleration: Array) -> Array:
        """Force that the block takes at its head for the head's motion, ``(1, T, 6)``."""
        head, external = self.head, self._state.external
        mass, com = head.masses[:, None], head.coms[:, None]
        out = body_force(mass, com, head.origin_inertias[:, None], velocity, acceleration)
        if external is not None:
            out -= external[:1]
        if self.rest is not None:
            out += rnea(self.rest, self._behind, BaseMotion(velocity[0], acceleration[0])).base_force
        return out

    # ---- after the rounds --------------------------------------------------------------------------------------

    def torque(self, scan: Mapping[str, Any]) -> Array:
        """Torque of all joints, ``(T, nv)``, from velocity, acceleration, force and distal force of the head."""
        torque = joint_torque(self.head, scan["force"])
        if self.rest is None:
            return torque
        found = rnea(self.rest, self._behind, *self._ends(scan))
        return np.concatenate((torque, found.torque), axis=1)

    def results(self, scan: Mapping[str, Any]) -> tuple[BodyResults, Array]:
        """Motion and force of all bodies, and the torque ``(T, nv)``."""
        head = BodyResults(scan["velocity"], scan["acceleration"], scan["force"])
        torque = joint_torque(self.head, head.force)
        if self.rest is None:
            return head, torque
        found = rnea(self.rest, self._behind, *self._ends(scan), bodies=True)
        assert found.bodies is not None
        rows = found.bodies.swapaxes(0, 1)
        both = (np.concatenate((x, rows[..., k : k + 6])) for x, k in zip(head, (0, 6, 12), strict=True))
        return BodyResults(*both), np.concatenate((torque, found.torque), axis=1)

    def placements(self, path: Array) -> Placement:
        """Placements ``(m, T, …)`` of all bodies, from the head's path from the base."""
        whole = motion.view(path)
        rotation, translation = whole.rotation.copy(), whole.translation.copy()
        if self.rest is None:
            return Placement(rotation, translation)
        rest = Placement(*(x.swapaxes(0, 1) for x in placements(self.rest, self._behind.q)))
        behind = translation + apply(np.broadcast_to(rotation, rest.rotation.shape), rest.translation)
        return Placement(np.concatenate((rotation, rotation @ rest.rotation)), np.concatenate((translation, behind)))

    def _ends(self, scan: Mapping[str, Any]) -> tuple[BaseMotion, Array | None]:
        """Motion of the base of the bodies behind the head, and the wrench on the last of them."""
        base = BaseMotion(scan["velocity"][0], scan["acceleration"][0])
        distal = scan["distal_force"]
        if distal is NOTHING:
            return base, None
        across = motion.view(self._across)
        return base, -force_to_child(across.rotation, across.translation, distal[0])


def still_state(bodies: Model) -> JointState:
    """One sample of bodies that do not move."""
    still = np.zeros((1, bodies.nv))
    return JointState(bodies.neutral[None], still, still, None, single=True)


def even_counts(bodies: int, ranks: int) -> tuple[int, ...]:
    """Cut a chain into blocks as even as possible: the number of bodies of each rank, the larger ones first."""
    each, more = divmod(bodies, ranks)
    return (each + 1,) * more + (each,) * (ranks - more)


def part(model: Model, state: JointState, bodies: range) -> JointState:
    """State of consecutive bodies."""
    q, v = (slice(starts[bodies.start], starts[bodies.stop]) for starts in (model.q_starts, model.v_starts))
    external = None if state.external is None else state.external[bodies.start : bodies.stop]
    return JointState(state.q[:, q], state.v[:, v], state.a[:, v], external, state.single)
