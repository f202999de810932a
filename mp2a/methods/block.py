"""What a rank holds: consecutive bodies of a serial chain, the first of them the head, or one body of any tree.

A block is a composite body. What it presses on its head with is a segment as that of one body is, and so is the path
from head to head: ``compose(Q, J)``, with Q from the head of the block before to its tail and J across the own head's
joint. Q comes from the rank before, in a round of its own. After it every method runs on blocks as on bodies; then
each block works out its bodies: those behind the head are a chain whose base moves as the head does and whose last body
bears what is behind the tail.

All a rank does in a call is recorded, what it does alone before and after its rounds as well.
"""

from typing import Any, NamedTuple

import numpy as np

from mp2a.algebra import inertia, motion
from mp2a.joint_kinematics import BaseMotion
from mp2a.joints import JOINTS
from mp2a.kernels import LARGEST_ANGLE
from mp2a.methods.body import SingleBody
from mp2a.methods.compact import MESSAGES, scan_motion
from mp2a.methods.node import Method, Own, ScanResult
from mp2a.model import Model
from mp2a.program.operations import NOTHING, Operation, add, compose
from mp2a.program.recorder import MethodRecorder, Output, Program
from mp2a.schedule import SHIFT, TAIL, Schedule
from mp2a.serial import placements, reduce_block, rnea
from mp2a.spatial import Array, apply, force_to_child
from mp2a.validation import JointState

SHIFT_MESSAGES = {TAIL: {"tail": motion.IDENTITY}}
DOUBLES = {TAIL: motion.DOUBLES}


class _Given(NamedTuple):
    """What a call is given of some bodies, as values ``(1, T, numbers)``."""

    q: Any
    v: Any
    a: Any
    external: Any
    """Forces from outside, body after body; or `NOTHING`."""


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
    axis
        Whether results of bodies have an axis of bodies.
    """

    def __init__(self, bodies: Model, rank: int, on_base: bool, gravity: Array, *, axis: bool) -> None:
        self.bodies, self._head = bodies, SingleBody(bodies.body(0))
        self._rest = _Rest(bodies.block(range(1, len(bodies)))) if len(bodies) > 1 else None
        self._rank, self._on_base, self._gravity = rank, on_base, gravity
        self._lead = (len(bodies),) if axis else ()

    def record(self, method: Method, schedule: Schedule, *, forces: bool = False, bodies: bool = False) -> Program:
        """Record this rank's part of a call.

        Parameters
        ----------
        method, schedule
            Of the formation.
        forces
            Whether forces from outside on the own bodies are given.
        bodies
            Whether motion, force and, if the method has it, placement of the own bodies are asked for.

        Returns
        -------
        Program
            Its arguments are q, v, a and, if they are given, the forces. Its outputs are ``torque``, and with
            ``bodies`` also ``velocity``, ``acceleration``, ``force``, ``rotation`` and ``translation``.
        """
        recorder = MethodRecorder(schedule, {**SHIFT_MESSAGES, **method.messages}, self._rank)
        model = self.bodies
        q, v, a = self._record_q(recorder), recorder.input("v", model.nv), recorder.input("a", model.nv)
        external = recorder.input("external_forces", *self._lead, 6) if forces else NOTHING
        given = _Given(q, v, a, external)
        head, behind = self._split(given)
        across, load = (NOTHING, lambda: NOTHING) if self._rest is None else self._rest.reduce(behind)
        still = np.concatenate((np.zeros(3), -self._gravity))

        def force(velocity: Any, acceleration: Any) -> Any:
            own = self._head.force(velocity, acceleration, head.external)
            return own if self._rest is None else add(own, self._rest.force(behind, velocity, acceleration))

        own = Own(
            path=self._record_path(recorder, self._head.path(head.q, head.v, head.a), across),
            inertia=lambda: add(self._head.inertia(head.external, recorder), load()),
            force=force,
            gravity=self._gravity,
            base=recorder.constant(still) if self._on_base else NOTHING,
            no_force=lambda: recorder.constant(np.zeros(6)),
        )
        scan = method.scan(own, recorder)
        return recorder.program(self._results(scan, head, behind, across, bodies))

    def record_placement(self, schedule: Schedule) -> Program:
        """Record the rounds of motion alone: from q to ``rotation`` and ``translation``."""
        recorder = MethodRecorder(schedule, {**SHIFT_MESSAGES, **MESSAGES}, self._rank)
        still = recorder.constant(np.zeros(self.bodies.nv))
        head, behind = self._split(_Given(self._record_q(recorder), still, still, NOTHING))
        across = NOTHING if self._rest is None else self._rest.reduce(behind)[0]
        path = self._record_path(recorder, self._head.path(head.q, head.v, head.a), across)
        return recorder.program(self._placement(scan_motion(path, recorder)[-1], behind))

    def _record_q(self, recorder: MethodRecorder) -> Any:
        """Return the coordinates, of which those of a single joint are for compiled arithmetic."""
        joint = JOINTS[self.bodies.joints[0]]
        if self._rest is not None:
            return recorder.input("q", self.bodies.nq)
        bound = {"bound": LARGEST_ANGLE} if joint.name == "revolute" else {}
        return recorder.input("q", self.bodies.nq, unit=joint.unit, **bound)

    def _record_path(self, recorder: MethodRecorder, path: Any, across: Any) -> Any:
        """Path from the head of the block before to the own one."""
        for round_ in recorder.recurrence(SHIFT):
            own = recorder.constant(motion.IDENTITY) if across is NOTHING else across
            (tail,) = recorder.exchange(round_, tail=own)
            path = compose(tail, path)
        return path

    def _split(self, given: _Given) -> tuple[_Given, _Given]:
        """Return what is given of the head, and of the bodies behind it."""
        if self._rest is None:
            return given, given
        columns = (*(JOINTS[self.bodies.joints[0]].nq, *[JOINTS[self.bodies.joints[0]].nv] * 2), 6)
        first = (_cut(x, slice(None, k)) for x, k in zip(given, columns, strict=True))
        behind = (_cut(x, slice(k, None)) for x, k in zip(given, columns, strict=True))
        return _Given(*first), _Given(*behind)

    def _results(self, scan: ScanResult, head: _Given, behind: _Given, across: Any, bodies: bool) -> dict[str, Output]:
        torque = self._head.torque(scan.force, head.q, head.v, head.a)
        motion_and_force = [scan.velocity, scan.acceleration, scan.force]
        if self._rest is not None:
            found = self._rest.dynamics(behind, across, scan, bodies=bodies)
            torque = _join(torque, found[0])
            motion_and_force = [_join(x, more) for x, more in zip(motion_and_force, found[1:], strict=False)]
        out = {"torque": Output(torque, (self.bodies.nv,))}
        if bodies:
            names = "velocity", "acceleration", "force"
            out |= {name: Output(x, (*self._lead, 6)) for name, x in zip(names, motion_and_force, strict=True)}
            out |= {} if scan.path is None else self._placement(scan.path, behind)
        return out

    def _placement(self, path: Any, behind: _Given) -> dict[str, Output]:
        shapes = (*self._lead, 3, 3), (*self._lead, 3)
        if self._rest is None:
            return {
                "rotation": Output(path, shapes[0], slice(0, 9)), "translation": Output(path, shapes[1], slice(9, 12)),
            }  # fmt: skip
        rotation, translation = self._rest.placement(path, behind)
        return {"rotation": Output(rotation, shapes[0]), "translation": Output(translation, shapes[1])}


class _Rest:
    """The bodies behind the head: a chain, which the kernels for chains in one process work out."""

    def __init__(self, model: Model) -> None:
        self._model = model

    def reduce(self, given: _Given) -> tuple[Any, Any]:
        """Path from the head to the last body, and what to call for the composite inertia about the head."""
        asked = False

        def reduced(*given: Any) -> tuple[Array, Array | None]:
            path, load = reduce_block(self._model, self._state(*given), loaded=asked)
            return path[None], None if load is None else load[None]

        across, behind = Operation(reduced, motion.DOUBLES, inertia.DOUBLES)(*given)

        def load() -> Any:
            nonlocal asked
            asked = True
            return behind

        return across, load

    def force(self, given: _Given, velocity: Any, acceleration: Any) -> Any:
        """Force that the bodies take at the head for its motion."""

        def force(velocity: Array, acceleration: Array, *given: Any) -> Array:
            base = BaseMotion(velocity[0], acceleration[0])
            return rnea(self._model, self._state(*given), base).base_force[None]

        return Operation(force, 6)(velocity, acceleration, *given)

    def dynamics(self, given: _Given, across: Any, scan: ScanResult, *, bodies: bool) -> tuple[Any, ...]:
        """Torque of the joints and, if asked for, velocity, acceleration and force of the bodies."""

        def dynamics(velocity: Array, acceleration: Array, distal: Any, across: Array, *given: Any) -> Any:
            base = BaseMotion(velocity[0], acceleration[0])
            end = None
            if distal is not NOTHING:
                path = motion.view(across[0])
                end = -force_to_child(path.rotation, path.translation, distal[0])
            found = rnea(self._model, self._state(*given), base, end, bodies=bodies)
            if found.bodies is None:
                return found.torque[None]
            rows = (found.bodies[..., k : k + 6].reshape(1, len(found.torque), -1) for k in (0, 6, 12))
            return (found.torque[None], *rows)

        widths = (self._model.nv, *[6 * len(self._model)] * (3 if bodies else 0))
        found = Operation(dynamics, *widths)(scan.velocity, scan.acceleration, scan.distal_force, across, *given)
        return found if bodies else (found,)

    def placement(self, path: Any, given: _Given) -> tuple[Any, Any]:
        """Placements of the head, whose path from the base is given, and of the bodies."""

        def placement(path: Array, q: Array) -> tuple[Array, Array]:
            whole = motion.view(path[0])
            head, rest = whole.rotation[:, None], placements(self._model, q[0])
            translation = whole.translation[:, None] + apply(
                np.broadcast_to(head, rest.rotation.shape), rest.translation
            )
            rotations = np.concatenate((head, head @ rest.rotation), axis=1)
            translations = np.concatenate((whole.translation[:, None], translation), axis=1)
            return rotations.reshape(1, len(q[0]), -1), translations.reshape(1, len(q[0]), -1)

        n = len(self._model) + 1
        found: tuple[Any, Any] = Operation(placement, 9 * n, 3 * n)(path, given.q)
        return found

    def _state(self, q: Array, v: Array, a: Array, external: Any) -> JointState:
        forces = None
        if external is not NOTHING:
            forces = external[0].reshape(len(q[0]), -1, 6).swapaxes(0, 1)
        return JointState(q[0], v[0], a[0], forces, single=False)


def _cut(given: Any, columns: slice) -> Any:
    """Return some columns of a value."""
    if given is NOTHING:
        return NOTHING
    width = len(range(*columns.indices(given.width)))
    return Operation(lambda x: x[..., columns], width)(given)


def _join(first: Any, second: Any) -> Any:
    """Return the numbers of two values one after the other."""
    return Operation(lambda *both: np.concatenate(both, axis=-1), first.width + second.width)(first, second)


def even_counts(bodies: int, ranks: int) -> tuple[int, ...]:
    """Cut a chain into blocks as even as possible: the number of bodies of each rank, the larger ones first."""
    each, more = divmod(bodies, ranks)
    return (each + 1,) * more + (each,) * (ranks - more)
