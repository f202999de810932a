"""What users call under mpirun: a chain of which every rank is one body."""

import hashlib
from types import TracebackType

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike

from mp2a.chain import Chain
from mp2a.checks import numbers
from mp2a.exceptions import InputError
from mp2a.leaf import State, check_gravity, check_state
from mp2a.methods import METHODS, InverseDynamics, Method
from mp2a.spatial import GRAVITY, Array
from mp2a.transport.base import Transport
from mp2a.transport.mpi import MPITransport, raise_together
from mp2a.transport.trace import TraceTransport
from mp2a.transport.wait import wait


class DistributedChain:
    """A formation over a communicator: rank i is robot i and keeps its own body alone.

    Making and closing one, and each call of `rnea`, is collective: every rank of the communicator does it. All traffic
    is on a duplicate of the communicator. A wrong argument on any rank raises the same error on every rank.

    Parameters
    ----------
    comm
        One rank a robot, in the order of the chain.
    chain
        The whole chain, the same on every rank; only the rank's own body is kept.
    method
        One of `mp2a.methods.METHODS`.
    gravity
        ``(3,)`` m/s² in the base frame.
    trace
        Record when each message was sent and had come, see `mp2a.transport.trace`.

    Attributes
    ----------
    body
        This robot's body, a chain of one.
    schedule
        Who talks to whom.
    transport
        Counts what this rank sends.

    Raises
    ------
    InputError
        On every rank: if the chain has another size than the communicator, differs between ranks, is a tree, or if the
        method is unknown.

    Examples
    --------
    Under ``mpirun -n 8``, each rank with its own joint's values::

        from mpi4py import MPI
        import mp2a

        with mp2a.DistributedChain(MPI.COMM_WORLD, mp2a.Chain.uniform(8)) as robots:
            mine = robots.rnea(q=[0.1], v=[0.2], a=[0.0])
        print(MPI.COMM_WORLD.rank, mine.torque)
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        chain: Chain,
        method: str = "kogge-stone",
        gravity: ArrayLike = GRAVITY,
        *,
        trace: bool = False,
    ) -> None:
        if not isinstance(comm, MPI.Intracomm) or comm == MPI.COMM_NULL:
            raise InputError(f"comm: got {type(comm).__name__}, expected an mpi4py intra-communicator")
        self._comm = comm.Dup()
        try:
            self._gravity, self._method = self._agree(chain, method, gravity)
        except InputError:
            self._comm.Free()
            raise
        self.body = chain.body(self._comm.Get_rank())
        self.schedule = self._method.schedule(len(chain))
        self.transport = MPITransport(self._comm, self.schedule)
        self.trace = TraceTransport(self.transport) if trace else None

    def rnea(
        self, q: ArrayLike, v: ArrayLike, a: ArrayLike, external_force: ArrayLike | None = None
    ) -> InverseDynamics:
        """Inverse dynamics of the formation, each robot with its own joint's values; collective.

        Parameters
        ----------
        q, v, a
            This robot's coordinates ``(nq,)``, velocity and acceleration ``(nv,)``, or T samples of them, ``(T, nq)``
            and ``(T, nv)``, which travel in the same messages. T is the same on every rank.
        external_force
            ``[torque; force]`` on this robot's body, in its frame about its origin, ``(6,)`` or ``(T, 6)``, N m and N.

        Returns
        -------
        InverseDynamics
            Of this robot's body: ``(6,)`` and ``(nv,)``, or ``(T, 6)`` and ``(T, nv)``.

        Raises
        ------
        InputError
            On every rank, if an argument of any rank is wrong or the numbers of samples differ.
        """
        error: InputError | None = None
        try:
            state = check_state(self.body, q, v, a, _own_force(external_force))
            if state.samples > self.transport.most_samples:
                raise InputError(
                    f"q, v, a: got {state.samples} samples, expected at most {self.transport.most_samples} a call "
                    "with this MPI"
                )
        except InputError as wrong:
            error, state = wrong, _at_rest(self.body)
        self.transport.begin(state.samples, sound=error is None)
        carrier: Transport = self.trace or self.transport
        result = self._method.solve(self.body, state, self._gravity, self.schedule, carrier)
        self.transport.flush()
        if not self.transport.sound:
            raise_together(self._comm, error)
            raise InputError(self._sample_counts(state.samples))
        cut = 0 if state.single else slice(None)
        return InverseDynamics(
            result.velocity[0][cut], result.acceleration[0][cut], result.force[0][cut], result.torque[cut]
        )

    def close(self) -> None:
        """Free the duplicate communicator; collective. Closing twice does nothing."""
        if self._comm != MPI.COMM_NULL:
            self._comm.Free()

    def __enter__(self) -> "DistributedChain":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _agree(self, chain: Chain, method: str, gravity: ArrayLike) -> tuple[Array, Method]:
        """Check the arguments on every rank and that they are the same on all."""
        error: InputError | None = None
        digest = bytes(32)
        field = np.zeros(3)
        try:
            field = check_gravity(gravity)
            _check(chain, method, self._comm.Get_size())
            digest = hashlib.sha256(f"{chain.digest()} {method} {field.tolist()}".encode()).digest()
        except InputError as wrong:
            error = wrong
        raise_together(self._comm, error)
        root = np.frombuffer(digest, dtype=np.uint8).copy()
        wait(self._comm.Ibcast(root, 0))
        if root.tobytes() != digest:
            error = InputError("chain, method, gravity: differ from those of rank 0, expected the same on every rank")
        raise_together(self._comm, error)
        return field, METHODS[method]

    def _sample_counts(self, samples: int) -> str:
        counts = self._comm.allgather(samples)
        odd = next((rank for rank, count in enumerate(counts) if count != counts[0]), 0)
        given = f"{counts[0]} samples on rank 0 and {counts[odd]} on rank {odd}"
        return f"q, v, a: got {given}, expected the same number on every rank"


def _check(chain: Chain, method: str, ranks: int) -> None:
    if not isinstance(chain, Chain):
        raise InputError(f"chain: got {type(chain).__name__}, expected an mp2a.Chain")
    if method not in METHODS:
        raise InputError(f"method: got {method!r}, expected one of {', '.join(map(repr, METHODS))}")
    if not chain.is_serial:
        raise InputError("chain: got a tree, expected a serial chain")
    if len(chain) != ranks:
        raise InputError(f"chain: got {len(chain)} bodies for a communicator of {ranks} ranks, expected one a rank")


def _own_force(external: ArrayLike | None) -> Array | None:
    """One robot's forces in the shape of a chain of one."""
    if external is None:
        return None
    force = numbers("external_force", external)
    if force.ndim not in (1, 2) or force.shape[-1] != 6:
        raise InputError(f"external_force: got shape {force.shape}, expected (6,) or (T, 6)")
    return force[..., None, :]


def _at_rest(body: Chain) -> State:
    zero = np.zeros((1, body.nv))
    return State(body.neutral[None], zero, zero, None, single=True)
