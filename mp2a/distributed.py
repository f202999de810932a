"""What users call under mpirun: a chain of which every rank holds one body, or a block of consecutive ones."""

import hashlib
import statistics
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mp2a import schedule as schedules
from mp2a.algebra.motion import from_joint, view
from mp2a.checks import array, count, numbers
from mp2a.exceptions import InputError
from mp2a.joint_kinematics import joint_motion
from mp2a.methods import METHODS, InverseDynamics, block
from mp2a.methods.auto import AUTO, Choice, choose
from mp2a.methods.compact import outwards
from mp2a.model import Model
from mp2a.mpi import MPI
from mp2a.network import EmulatedNetwork
from mp2a.schedule import Formation, Schedule, shifted
from mp2a.spatial import GRAVITY, Array
from mp2a.transport.base import Transport
from mp2a.transport.link import EmulatedLink, Link, make_link, measure
from mp2a.transport.mpi import MPITransport, agree, raise_together
from mp2a.transport.trace import TraceTransport
from mp2a.transport.wait import wait
from mp2a.validation import JointState, check_gravity, check_state

_SMALL, _LARGE, _ROUNDS = 24, 24_000, 7


class DistributedModel:
    """A formation over a communicator: rank i is robot i and keeps its own body alone.

    A serial chain may have more bodies than there are ranks. Then each rank holds a block of consecutive ones, and what
    it passes in and gets back has an axis of bodies, on a rank with one body too.

    Making and closing one, and each call of `rnea`, is collective: every rank of the communicator does it. All traffic
    is on a duplicate of the communicator. A wrong argument on any rank raises the same error on every rank.

    Parameters
    ----------
    comm
        Ranks in the order of the chain.
    model
        The whole chain, the same on every rank; only the rank's own bodies are kept. Or a file that every rank reads:
        one that `Model.save` wrote (``.npz``), or a URDF. If one rank cannot read it, all raise its error.
    method
        One of `mp2a.methods.METHODS`, or "auto": the one that needs least time by the formation, the samples and what
        the network costs, which is measured between two ranks; `choice` says which and why.
    gravity
        ``(3,)`` m/s² in the base frame.
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
        Which bodies of the chain this rank holds.
    part
        These bodies, as a chain of their own.
    q_columns, v_columns
        Where the whole chain's q, and v and a, have the numbers of these bodies; slices.
    method
        Name of the method in use.
    choice
        What "auto" chose and why, else None.
    schedule
        Who talks to whom.
    transport
        Counts what this rank sends.

    Raises
    ------
    InputError
        On every rank: if there are more ranks than bodies, or more bodies than ranks in a tree, the counts do not fit,
        the arguments differ between ranks, or the method is unknown or not for this chain.

    Examples
    --------
    Under ``mpirun -n 8``, each rank with its own joint's values::

        from mp2a.mpi import MPI
        import mp2a

        with mp2a.DistributedModel(MPI.COMM_WORLD, mp2a.Model.uniform(8)) as robots:
            mine = robots.rnea(q=[0.1], v=[0.2], a=[0.0])
        print(MPI.COMM_WORLD.rank, mine.torque)
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        model: Model | str | Path,
        method: str = AUTO,
        gravity: ArrayLike = GRAVITY,
        *,
        counts: Sequence[int] | None = None,
        samples: int = 1,
        network: EmulatedNetwork | None = None,
        trace: bool = False,
    ) -> None:
        if not isinstance(comm, MPI.Intracomm) or comm == MPI.COMM_NULL:
            raise InputError(f"comm: got {type(comm).__name__}, expected an mpi4py intra-communicator")
        self._comm = comm.Dup()
        try:
            whole, self._gravity, counts, link = self._agree(model, method, gravity, counts, samples, network)
            self._blocks = len(whole) > len(counts)
            nodes = len(counts) if self._blocks else whole.parents
            self.choice = _choose(link, nodes, samples) if method == AUTO else None
            self.method = method if self.choice is None else self.choice.method
            schedule = METHODS[self.method].schedule(nodes)
            self.schedule = shifted(schedule) if self._blocks else schedule
        except InputError:
            self._comm.Free()
            raise
        self._serial = whole.is_serial
        rank = self._comm.Get_rank()
        self.bodies = range(sum(counts[:rank]), sum(counts[: rank + 1]))
        self.part = block.cut(whole, self.bodies) if self._blocks else whole.body(rank)
        self._block = block.block_of(self.part) if self._blocks else None
        self.q_columns, self.v_columns = (
            slice(int(starts[self.bodies.start]), int(starts[self.bodies.stop]))
            for starts in (whole.q_starts, whole.v_starts)
        )
        self._parents = whole.parents
        self._carriers: dict[str, _Carrier] = {}
        self.transport = MPITransport(link, self.schedule)
        self.trace = TraceTransport(self.transport) if trace else None

    def rnea(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        external_force: ArrayLike | None = None,
        *,
        wrong: InputError | None = None,
    ) -> InverseDynamics:
        """Inverse dynamics of the formation, each rank with the values of its own joints; collective.

        Parameters
        ----------
        q, v, a
            This rank's coordinates ``(nq,)``, velocities and accelerations ``(nv,)``, or T samples of them, ``(T, nq)``
            and ``(T, nv)``, which travel in the same messages. T is the same on every rank.
        external_force
            ``[torque; force]`` on this rank's body, in its frame about its origin, ``(6,)`` or ``(T, 6)``, N m and N.
            If there are more bodies than ranks, on its m bodies, ``(m, 6)`` or ``(T, m, 6)``.
        wrong
            An error that this rank's caller has found in its own input and that every rank is to raise.

        Returns
        -------
        InverseDynamics
            Of this rank's body: ``(6,)`` and ``(nv,)``, or ``(T, 6)`` and ``(T, nv)``. If there are more bodies than
            ranks, of its m bodies: ``(m, 6)`` and ``(nv,)``, or ``(T, m, 6)`` and ``(T, nv)``.

        Raises
        ------
        InputError
            On every rank, if an argument of any rank is wrong or the numbers of samples differ.
        """
        error: InputError | None = None
        try:
            if wrong is not None:
                raise wrong
            state = check_state(self.part, q, v, a, self._own_force(external_force))
            if state.samples > self.transport.most_samples:
                raise InputError(
                    f"q, v, a: got {state.samples} samples, expected at most {self.transport.most_samples} a call "
                    "with this MPI"
                )
        except InputError as found:
            error, state = found, _at_rest(self.part)
        self.transport.begin(state.samples, sound=error is None)
        carrier: Transport = self.trace or self.transport
        method = METHODS[self.method]
        if self._block is None:
            result = method.solve(self.part, state, self._gravity, self.schedule, carrier)
        else:
            result = block.solve(method, self._block, state, self._gravity, self.schedule, carrier)
        self.transport.flush()
        self._all_sound(self.transport, error, state.samples, far=self._serial)
        at = (slice(None) if self._blocks else 0, 0 if state.single else slice(None))
        velocity, acceleration, force = (x[at] for x in (result.velocity, result.acceleration, result.force))
        if self._blocks and not state.single:  # samples first
            velocity, acceleration, force = (np.swapaxes(x, 0, 1) for x in (velocity, acceleration, force))
        place = [] if result.rotation is None or result.position is None else [result.rotation[at], result.position[at]]
        return InverseDynamics(velocity, acceleration, force, result.torque[at[1]], *place)

    def placement(self, q: ArrayLike) -> tuple[Array, Array]:
        """Where this robot is, by the rounds of motion alone, for methods whose `rnea` does not tell; collective.

        Parameters
        ----------
        q
            This robot's coordinates, ``(nq,)`` or ``(T, nq)``; T is the same on every rank.

        Returns
        -------
        tuple of numpy.ndarray
            Rotation from this body's to the base frame ``(3, 3)`` and position of its origin ``(3,)`` m, with T in
            front if ``q`` has it.

        Raises
        ------
        InputError
            On every rank, if ``q`` of any rank is wrong or the numbers of samples differ.
        """
        error: InputError | None = None
        state = _at_rest(self.part)
        try:
            still = np.zeros((*np.shape(q)[:-1], self.part.nv))
            state = check_state(self.part, q, still, still, None)
        except InputError as found:
            error = found
        carrier = self._one_way(schedules.motion, state.samples, sound=error is None)
        path = outwards(from_joint(joint_motion(self.part, state)), carrier.schedule, carrier.transport)
        carrier.transport.flush()
        self._all_sound(carrier.transport, error, state.samples, far=False)
        place = view(path[0, 0] if state.single else path[0])
        return place.rotation, place.translation

    def send_to_children(self, values: ArrayLike) -> Array | None:
        """Hand some numbers to the robots that hang on this one, and return those of its parent; collective.

        Parameters
        ----------
        values
            ``(k,)``, k the same on every rank.

        Returns
        -------
        numpy.ndarray or None
            ``(k,)`` of the robot that this one hangs on; None if it hangs on the base.

        Raises
        ------
        InputError
            If ``values`` is not one row of numbers, or the parent's row has another length; on this rank alone.
        """
        values = array("values", values, (None,))
        if not len(values):
            raise InputError("values: got none, expected at least one number")
        # The number of samples is the tag by which another length is noticed.
        carrier = self._one_way(schedules.neighbours, len(values), sound=True)
        arrivals = carrier.transport.exchange(carrier.schedule.rounds[0], {schedules.MOTION: values[None]})
        carrier.transport.flush()
        if not carrier.transport.sound:
            raise InputError(f"values: got {len(values)} and another number from the parent, expected as many")
        return arrivals[0].data[0].copy() if arrivals else None

    def _one_way(self, plan: Callable[[NDArray[np.intp]], Schedule], samples: int, sound: bool) -> "_Carrier":
        """Transport for a schedule that runs outwards only, made when it is first wanted."""
        if plan.__name__ not in self._carriers:
            schedule = plan(self._parents)
            self._carriers[plan.__name__] = _Carrier(schedule, MPITransport(self.transport.link, schedule))
        carrier = self._carriers[plan.__name__]
        carrier.transport.begin(samples, sound=sound)
        return carrier

    def _all_sound(self, transport: MPITransport, error: InputError | None, samples: int, far: bool) -> None:
        """Raise the same error on every rank if an input was wrong on one; ``far``: what is wrong has reached all.

        Outwards and back along a chain it has; between the branches of a tree, or on the way out alone, it has not.
        """
        if not (transport.sound if far else agree(self._comm, transport.sound)):
            raise_together(self._comm, error)
            raise InputError(self._sample_counts(samples))

    def close(self) -> None:
        """Free the duplicate communicator; collective. Closing twice does nothing."""
        if self._comm != MPI.COMM_NULL:
            for transport in (self.transport, *(carrier.transport for carrier in self._carriers.values())):
                transport.close()
            self._comm.Free()

    def __enter__(self) -> "DistributedModel":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _agree(
        self,
        model: Model | str | Path,
        method: str,
        gravity: ArrayLike,
        counts: Sequence[int] | None,
        samples: int,
        network: EmulatedNetwork | None,
    ) -> tuple[Model, Array, tuple[int, ...], Link]:
        """Check the arguments on every rank and that they are the same on all."""
        error: InputError | None = None
        digest = bytes(32)
        try:
            field = check_gravity(gravity)
            whole = _read(model)
            _check(whole, method)
            shares = _shares(counts, whole, self._comm.Get_size())
            count("samples", samples)
            link = make_link(self._comm, network)
            same = f"{whole.digest()} {method} {field.tolist()} {shares} {samples} {network}"
            digest = hashlib.sha256(same.encode()).digest()
        except InputError as wrong:
            error = wrong
        raise_together(self._comm, error)
        root = np.frombuffer(digest, dtype=np.uint8).copy()
        wait(self._comm.Ibcast(root, 0))
        if root.tobytes() != digest:
            what = "model, method, gravity, counts, samples, network"
            error = InputError(f"{what}: differ from those of rank 0, expected the same on every rank")
        raise_together(self._comm, error)
        return whole, field, shares, link

    def _own_force(self, external: ArrayLike | None) -> Array | None:
        """Give forces on this rank's bodies the shape of those of a chain."""
        if external is None:
            return None
        force = numbers("external_force", external)
        wanted = (len(self.part), 6) if self._blocks else (6,)
        if force.ndim - len(wanted) not in (0, 1) or force.shape[-len(wanted) :] != wanted:
            many = str(("T", *wanted)).replace("'", "")
            raise InputError(f"external_force: got shape {force.shape}, expected {wanted} or {many}")
        return force if self._blocks else force[..., None, :]

    def _sample_counts(self, samples: int) -> str:
        counts = self._comm.allgather(samples)
        odd = next((rank for rank, count in enumerate(counts) if count != counts[0]), 0)
        given = f"{counts[0]} samples on rank 0 and {counts[odd]} on rank {odd}"
        return f"q, v, a: got {given}, expected the same number on every rank"


class _Carrier(NamedTuple):
    schedule: Schedule
    transport: MPITransport


def _read(model: Model | str | Path) -> Model:
    if not isinstance(model, str | Path):
        return model
    return Model.load(model) if Path(model).suffix == ".npz" else Model.from_urdf(model)


def _check(model: Model, method: str) -> None:
    if not isinstance(model, Model):
        raise InputError(f"model: got {type(model).__name__}, expected an mp2a.Model")
    if method not in (AUTO, *METHODS):
        raise InputError(f"method: got {method!r}, expected one of {', '.join(map(repr, (AUTO, *METHODS)))}")


def _shares(counts: Sequence[int] | None, model: Model, ranks: int) -> tuple[int, ...]:
    """Check how many bodies each rank is to hold."""
    n = len(model)
    if n < ranks:
        raise InputError(f"model: got {n} bodies for a communicator of {ranks} ranks, expected at least one a rank")
    if n > ranks and not model.is_serial:
        raise InputError(f"model: got a tree of {n} bodies for a communicator of {ranks} ranks, expected one a rank")
    if counts is None:
        return block.share(n, ranks)
    given = array("counts", counts, (None,), whole=True).tolist()
    if len(given) != ranks or min(given) < 1 or sum(given) != n:
        raise InputError(
            f"counts: got {given}, expected {ranks} whole numbers of at least 1, one a rank, with the sum {n} of bodies"
        )
    return tuple(given)


def _choose(link: Link, nodes: Formation, samples: int) -> Choice:
    """Choose a method on rank 0 for what messages cost between ranks 0 and 1, and tell all."""
    if isinstance(link, EmulatedLink):
        latency, bandwidth = link.network
    else:
        small, large = (measure(link, doubles, _ROUNDS) or [0.0] for doubles in (_SMALL, _LARGE))
        latency, slow = statistics.median(small), statistics.median(large)
        bandwidth = 64 * (_LARGE - _SMALL) / max(slow - latency, 1e-9)
    cost = np.array([latency, bandwidth])
    wait(link.comm.Ibcast([cost, MPI.DOUBLE], 0))
    return choose(nodes, samples, float(cost[0]), float(cost[1]))


def _at_rest(body: Model) -> JointState:
    zero = np.zeros((1, body.nv))
    return JointState(body.neutral[None], zero, zero, None, single=True)
