"""What users call under mpirun: a model of which every rank holds one body, or a block of consecutive ones."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from mp2a import schedule as schedules
from mp2a.checks import array, numbers
from mp2a.distributed_setup import choose_method, duplicate, set_up
from mp2a.exceptions import InputError
from mp2a.methods import METHODS
from mp2a.methods.auto import AUTO
from mp2a.methods.block import Block
from mp2a.methods.values import record_broadcast, record_to_children
from mp2a.model import Model
from mp2a.mpi import MPI
from mp2a.network import EmulatedNetwork
from mp2a.program.calls import Call, Calls, Key
from mp2a.program.operations import NOTHING
from mp2a.program.rank import Given, RankProgram
from mp2a.results import InverseDynamics, Placement
from mp2a.schedule import Schedule
from mp2a.spatial import Array
from mp2a.transport.agreement import Agreement
from mp2a.transport.mpi import MPITransport
from mp2a.transport.trace import TraceTransport
from mp2a.validation import JointState, check_shapes, check_values

if TYPE_CHECKING:
    import pinocchio


class DistributedModel:
    """A formation over a communicator: rank i is robot i and keeps its own body alone.

    A serial chain may have more bodies than there are ranks. Then each rank holds a block of consecutive ones, and what
    it passes in and gets back has an axis of bodies, on a rank with one body too.

    Making and closing one, and each call of `rnea`, `placement`, `broadcast` and `send_to_children`, is collective:
    every rank of the communicator does it, in the thread that made it. All traffic is on a duplicate of the
    communicator. Whatever goes wrong on one rank, in its arguments or before the call in a block of `together`, is
    raised on every rank: what mp2a raises itself as the same error, anything else as `mp2a.RankError`.

    Parameters
    ----------
    comm
        Ranks in the order of the chain.
    model
        The whole model, ours or a `pinocchio.Model`, the same on every rank; only the rank's own bodies are kept. Or a
        file that every rank reads: one that `Model.save` wrote (``.npz``), or a URDF. If one rank cannot read it, all
        raise its error.
    method
        One of `mp2a.methods.METHODS`, or "auto": the one that needs least time by the formation, the samples and what
        the network costs, which is measured between two ranks; `choice` says which and why.
    gravity
        ``(3,)`` m/s² in the base frame; None: the model's own.
    counts
        How many bodies each rank holds: as many whole numbers of at least 1 as there are ranks, whose sum is the number
        of bodies. None: as even as possible, the larger blocks first.
    samples
        Number of samples that calls will have, as far as "auto" is to know; calls may have any.
    network
        Emulate a slower network between the ranks of this machine.
    trace
        Record when each message was sent and had come, see `mp2a.transport.trace`.

    Attributes
    ----------
    bodies
        Which bodies of the model this rank holds.
    part
        These bodies, as a model of their own.
    q_columns, v_columns
        Where the whole model's q, and v and a, have the numbers of these bodies; slices.
    method
        Name of the method in use.
    choice
        What "auto" chose and why, else None.
    schedule
        Who talks to whom in a call of `rnea`.
    transport
        Counts what this rank sends in calls of `rnea`.
    trace
        What was recorded of calls of `rnea`, if that was asked for.

    Raises
    ------
    InputError
        On every rank: if there are more ranks than bodies, or more bodies than ranks in a tree, the counts do not fit,
        the arguments differ between ranks, or the method is unknown or not for this model.

    Examples
    --------
    Under ``mpirun -n 8``, each rank with its own joint's values::

        from mpi4py import MPI
        import mp2a

        with mp2a.DistributedModel(MPI.COMM_WORLD, mp2a.Model.uniform(8)) as robots:
            torque = robots.rnea(q=[0.1], v=[0.2], a=[0.0])
        print(MPI.COMM_WORLD.rank, torque)
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        model: "Model | pinocchio.Model | str | Path",
        method: str = AUTO,
        gravity: ArrayLike | None = None,
        *,
        counts: Sequence[int] | None = None,
        samples: int = 1,
        network: EmulatedNetwork | None = None,
        trace: bool = False,
    ) -> None:
        self._comm = duplicate(comm)
        try:
            whole, field, counts, link = set_up(self._comm, model, method, gravity, counts, samples, network)
            self._blocks = len(whole) > len(counts)
            self._nodes = np.arange(len(counts)) - 1 if self._blocks else whole.parents
            self.choice = choose_method(link, self._nodes, samples) if method == AUTO else None
            self.method = method if self.choice is None else self.choice.method
            self.schedule = self._shifted(METHODS[self.method].schedule(self._nodes))
        except Exception:
            self._comm.Free()
            raise
        rank = self._comm.Get_rank()
        self._link, self._rank, self._serial = link, rank, whole.is_serial
        self.bodies = range(sum(counts[:rank]), sum(counts[: rank + 1]))
        self.part = whole.block(self.bodies) if self._blocks else whole.body(rank)
        self.q_columns, self.v_columns = (
            slice(int(starts[self.bodies.start]), int(starts[self.bodies.stop]))
            for starts in (whole.q_starts, whole.v_starts)
        )
        self._block = Block(self.part, rank, bool(self._nodes[rank] < 0), field, axis=self._blocks)
        self.transport = MPITransport(link)
        self.trace = TraceTransport(self.transport) if trace else None
        self._calls = Calls(self._comm, self._program)

    # ---- calls -------------------------------------------------------------------------------------------------

    @overload
    def rnea(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, external_forces: ArrayLike | None = ..., *,
        bodies: Literal[False] = ...,
    ) -> Array: ...  # fmt: skip
    @overload
    def rnea(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, external_forces: ArrayLike | None = ..., *,
        bodies: Literal[True],
    ) -> InverseDynamics: ...  # fmt: skip
    def rnea(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        external_forces: ArrayLike | None = None,
        *,
        bodies: bool = False,
    ) -> Array | InverseDynamics:
        """Inverse dynamics of the formation, each rank with the values of its own joints; collective.

        Parameters
        ----------
        q, v, a
            This rank's coordinates ``(nq,)``, velocities and accelerations ``(nv,)``, or T samples of them, ``(T, nq)``
            and ``(T, nv)``, which travel in the same messages. T is the same on every rank.
        external_forces
            ``[torque; force]`` on this rank's body, in its frame about its origin, ``(6,)`` or ``(T, 6)``, N m and N.
            If there are more bodies than ranks, on its m bodies, ``(m, 6)`` or ``(T, m, 6)``.
        bodies
            Return motion, placement and force as well; the same on every rank.

        Returns
        -------
        numpy.ndarray or InverseDynamics
            This rank's joint torques ``(nv,)`` or ``(T, nv)``, N m and N. With ``bodies`` an `InverseDynamics` that
            holds them, of this rank's body: ``(6,)`` or ``(T, 6)``. If there are more bodies than ranks, of its m
            bodies: ``(m, 6)`` or ``(T, m, 6)``.

        Raises
        ------
        InputError
            On every rank, if an argument of any rank is wrong or the numbers of samples differ.
        """
        forces = external_forces is not None
        arguments = (q, v, a, external_forces) if forces else (q, v, a)
        found = self._calls.run(("rnea", forces, bodies), arguments, self._read)
        if not bodies:
            torque: Array = found["torque"]
            return torque
        placed = "rotation" in found
        placement = Placement(found.pop("rotation"), found.pop("translation")) if placed else self.placement(q)
        return InverseDynamics(**found, placement=placement)

    def placement(self, q: ArrayLike) -> Placement:
        """Where this rank's bodies are, by the rounds of motion alone; collective.

        Parameters
        ----------
        q
            This rank's coordinates, ``(nq,)`` or ``(T, nq)``; T is the same on every rank.

        Returns
        -------
        Placement
            Of this rank's body, ``(3, 3)`` and ``(3,)`` m, with T in front if ``q`` has it. If there are more bodies
            than ranks, of its m bodies: ``(m, 3, 3)`` and ``(m, 3)``.

        Raises
        ------
        InputError
            On every rank, if ``q`` of any rank is wrong or the numbers of samples differ.
        """
        return Placement(**self._calls.run(("placement",), (q,), self._read_q))

    def broadcast(self, values: ArrayLike) -> Array:
        """Tell every robot what the first one of the chain knows, in ⌈log2 n⌉ rounds and n - 1 messages; collective.

        Parameters
        ----------
        values
            ``(k,)`` on the first robot, k the same on every rank; elsewhere as many numbers that are not looked at. In
            a tree every robot that hangs on the base is the first one of those behind it.

        Returns
        -------
        numpy.ndarray
            ``(k,)`` of the first robot.

        Raises
        ------
        InputError
            On every rank, if ``values`` of any rank is not a row of finite numbers, or their numbers differ.
        """
        told: Array = self._calls.run(("broadcast",), (values,), self._read_values)["values"]
        return told

    def send_to_children(self, values: ArrayLike) -> Array:
        """Hand some numbers to the bodies that hang on this rank's, and return those of the parent; collective.

        Parameters
        ----------
        values
            ``(k,)``, k the same on every rank. If there are more bodies than ranks, of its m bodies: ``(m, k)``.

        Returns
        -------
        numpy.ndarray
            ``(k,)``, or ``(m, k)``, of the body that each hangs on; zeros if that is the base.

        Raises
        ------
        InputError
            On every rank, if ``values`` of any rank are not finite numbers of this shape, or differ in length.
        """
        key = ("send_to_children",)
        if self._blocks:  # of which the last row alone is sent
            found = self._calls.run(key, (), partial(self._read_rows, values))
        else:
            found = self._calls.run(key, (values,), self._read_values)
        came = found["values"]
        own = np.asarray(values, dtype=np.float64)
        first: Array = np.zeros(own.shape[-1]) if came is NOTHING else came
        return np.concatenate((first[None], own[:-1])) if self._blocks else first

    @contextmanager
    def together(self, call: Call) -> Iterator[Call]:
        """Raise on every rank what one of them raises while it prepares a call.

        Parameters
        ----------
        call
            `rnea`, `placement`, `broadcast` or `send_to_children` of this object. What the block is given in its place
            has to be called once in it, on every rank.

        Examples
        --------
        A robot whose sensor fails in the block does not leave the others waiting::

            with robots.together(robots.rnea) as rnea:
                torque = rnea(*read_sensors())
        """
        with self._calls.together(call, self._key(call.__name__)) as once:
            yield once

    def close(self) -> None:
        """Free the duplicate communicator; collective. Closing twice does nothing."""
        self._calls.close()

    def __enter__(self) -> "DistributedModel":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    # ---- parts of a call ---------------------------------------------------------------------------------------

    def _key(self, name: str) -> Key:
        """Return what programs of a call have in common with a rank that has nothing to say."""
        return ("rnea", False, False) if name == "rnea" else (name,)

    def _program(self, agreement: Agreement, name: str, *variant: bool) -> RankProgram:
        """Record the program of a call."""
        nodes, rank, transport = self._nodes, self._rank, MPITransport(self._link)
        match name:
            case "rnea":
                forces, bodies = variant
                recorded = self._block.record(METHODS[self.method], self.schedule, forces=forces, bodies=bodies)
                known = None if self._serial else agreement  # forces and motion reach both ends of a chain
                return RankProgram(name, recorded, self.transport, self.trace, agreement=known, flag=bodies)
            case "placement":
                recorded = self._block.record_placement(self._shifted(schedules.motion(nodes)))
            case "broadcast":
                recorded = record_broadcast(schedules.broadcast(nodes), rank, first=bool(nodes[rank] < 0))
            case _:
                recorded = record_to_children(schedules.parent_to_child(nodes), rank)
        return RankProgram(name, recorded, transport, agreement=agreement)

    def _shifted(self, schedule: Schedule) -> Schedule:
        return schedules.shifted(schedule) if self._blocks else schedule

    def _read(self, q: ArrayLike, v: ArrayLike, a: ArrayLike, external: ArrayLike | None = None) -> Given:
        """Make arrays of the arguments of `rnea`, after a look at their shapes."""
        state = check_shapes(self.part, q, v, a, self._own_force(external))
        arrays = [state.q, state.v, state.a]
        if state.external is not None:
            forces = np.broadcast_to(state.external, (len(self.part), state.samples, 6))
            arrays.append(forces.swapaxes(0, 1) if self._blocks else forces[0])
        return self._given(arrays, state)

    def _read_q(self, q: ArrayLike) -> Given:
        """Make an array of the argument of `placement`."""
        still = np.zeros((*numbers("q", q).shape[:-1], self.part.nv))
        state = check_shapes(self.part, q, still, still, None)
        return self._given([state.q], state)

    def _given(self, arrays: Sequence[Array], state: JointState) -> Given:
        ready = [np.ascontiguousarray(array) for array in arrays]
        return Given(ready, state.samples, state.single, lambda: check_values(self.part, state))

    def _read_values(self, values: ArrayLike) -> Given:
        """Make an array of numbers that are handed on."""
        return _numbers(array("values", values, (None,)))

    def _read_rows(self, values: ArrayLike) -> Given:
        """Make an array of those of the last body."""
        return _numbers(array("values", values, (len(self.part), None))[-1])

    def _own_force(self, external: ArrayLike | None) -> Array | None:
        """Give forces on this rank's bodies the shape of those of a model."""
        if external is None:
            return None
        force = numbers("external_forces", external)
        wanted = (len(self.part), 6) if self._blocks else (6,)
        if force.ndim - len(wanted) not in (0, 1) or force.shape[-len(wanted) :] != wanted:
            many = str(("T", *wanted)).replace("'", "")
            raise InputError(f"external_forces: got shape {force.shape}, expected {wanted} or {many}")
        return force if self._blocks else force[..., None, :]


def _numbers(values: Array) -> Given:
    if not values.size:
        raise InputError("values: got none, expected at least one number")
    return Given([values], len(values), False, lambda: None)
