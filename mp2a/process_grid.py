"""Ranks in two directions: some share a chain, and several such groups share the samples of a trajectory."""

from types import TracebackType

import numpy as np

from mp2a.checks import count
from mp2a.distributed_setup import duplicate
from mp2a.exceptions import InputError
from mp2a.mpi import MPI
from mp2a.transport.agreement import shared_errors

_LANES = 8
"""Samples that a core works on at once: with fewer, splitting them further gains nothing."""


class ProcessGrid:
    """A communicator as a table: the ranks of a row hold one chain together, and the rows share the samples.

    Samples need no messages, a chain does, and three times the arithmetic as well: split the samples first, and the
    chain only as far as there are too few samples, or too many bodies for the memory of a rank, or where the ranks are
    robots.

    Making and closing one is collective.

    Parameters
    ----------
    comm
        All ranks.
    chain_ranks
        How many ranks share a chain; it divides the number of ranks. None: as few as leave each row enough samples to
        fill its vectors.
    samples
        T, samples of the trajectory.

    Attributes
    ----------
    chain_comm
        Communicator of this rank's row, for `mp2a.DistributedModel`.
    row, rows
        Which row this is, and how many there are.
    local_slice
        The row's samples, a slice of the trajectory's; rows differ by one sample at most.

    Raises
    ------
    InputError
        On every rank: if ``chain_ranks`` does not divide the number of ranks, there are fewer samples than rows, or
        ranks differ in what they ask for.

    Examples
    --------
    Under ``mpirun -n 8``, two ranks a chain and four rows::

        with mp2a.ProcessGrid(MPI.COMM_WORLD, chain_ranks=2, samples=len(q)) as grid:
            with mp2a.DistributedModel(grid.chain_comm, chain) as part:
                samples, columns = grid.local_slice, part.v_columns
                result = part.rnea(q[samples, part.q_columns], v[samples, columns], a[samples, columns])
    """

    def __init__(self, comm: MPI.Intracomm, chain_ranks: int | None = None, *, samples: int) -> None:
        self.chain_comm = MPI.COMM_NULL
        comm = duplicate(comm)
        try:
            ranks, share = comm.Get_size(), 0
            with shared_errors(comm):
                count("samples", samples)
                share = ranks_per_chain(ranks, samples) if chain_ranks is None else count("chain_ranks", chain_ranks)
                if ranks % share:
                    raise InputError(f"chain_ranks: got {share} for {ranks} ranks, expected a divisor of that number")
                if samples < ranks // share:
                    raise InputError(f"samples: got {samples} for {ranks // share} rows, expected at least one a row")
            largest = np.array([share, samples, -share, -samples])
            comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
            if (largest[:2] != -largest[2:]).any():
                raise InputError("chain_ranks, samples: differ between ranks, expected the same on every rank")
            self.rows, self.row = ranks // share, comm.Get_rank() // share
            self.local_slice = slice(samples * self.row // self.rows, samples * (self.row + 1) // self.rows)
            self.chain_comm = comm.Split(self.row, comm.Get_rank())
        finally:
            comm.Free()

    def close(self) -> None:
        """Free the row's communicator; collective. Closing twice does nothing."""
        if self.chain_comm != MPI.COMM_NULL:
            self.chain_comm.Free()

    def __enter__(self) -> "ProcessGrid":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def ranks_per_chain(ranks: int, samples: int) -> int:
    """Return how many ranks should share a chain: as few as leave each row samples enough to fill its vectors.

    Parameters
    ----------
    ranks
        All there are.
    samples
        T, samples of the trajectory.
    """
    divisors = (along for along in range(1, ranks + 1) if ranks % along == 0)
    return next((along for along in divisors if samples * along >= _LANES * ranks), ranks)
