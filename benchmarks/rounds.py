"""What a round costs beside the bare messages in it: two ranks, one sample, microseconds a round.

    python benchmarks/rounds.py

The rounds are those of each method between two robots, many of them in a row, with everything a round does: messages,
joining, moving. Beside it, in the same run and interleaved: a bare exchange of the same sizes in plain mpi4py calls.
"""

import statistics
import sys
import time

import numpy as np

ROUNDS, REPEATS = 2000, 9


def ranks() -> None:
    """Measure; run by two ranks."""
    from mpi4py import MPI

    from mp2a import Chain, kernels
    from mp2a.leaf import check_state
    from mp2a.methods import METHODS
    from mp2a.schedule import Round, Schedule
    from mp2a.transport.link import MPILink
    from mp2a.transport.mpi import MPITransport

    comm = MPI.COMM_WORLD
    rank = comm.Get_rank()
    status = kernels.status()
    chain = Chain.random(2)
    body, gravity = chain.body(rank), np.zeros(3)
    state = check_state(body, *chain.random_state(body=rank), None)

    def rounds(name: str) -> float:
        """Seconds a round of a method whose every round is repeated many times."""
        method = METHODS[name]
        once = method.schedule(2)
        times = ROUNDS // len(once.rounds)
        many = [Round(r.recurrence, k, r.transfers) for r in once.rounds for k in range(times)]
        transport = MPITransport(MPILink(comm), Schedule(2, tuple(many)))
        comm.Barrier()
        began = time.perf_counter()
        method.solve(body, state, gravity, Schedule(2, tuple(many)), transport)
        transport.flush()
        return (time.perf_counter() - began) / len(many)

    def bare(name: str) -> float:
        """Seconds of an exchange of the same messages in plain mpi4py calls."""
        method = METHODS[name]
        once = [
            [(int(t.source[0]), np.zeros(method.doubles[t.kind])) for t in r.transfers]
            for r in method.schedule(2).rounds
        ]
        exchanges = once * (ROUNDS // len(once))
        comm.Barrier()
        began = time.perf_counter()
        for messages in exchanges:
            requests = [
                comm.Isend([data, MPI.DOUBLE], 1 - rank) if source == rank else comm.Irecv([data, MPI.DOUBLE], 1 - rank)
                for source, data in messages
            ]
            MPI.Request.Waitall(requests)
        return (time.perf_counter() - began) / len(exchanges)

    for name in METHODS:
        pairs = [(rounds(name), bare(name)) for _ in range(REPEATS)]
        if rank == 0:
            ours, theirs = (1e6 * statistics.median(column) for column in zip(*pairs, strict=True))
            print(f"{name:<12} {ours:6.1f} µs a round, {theirs:5.1f} µs the bare messages")
    if rank == 0:
        print(f"kernels: {'compiled' if status.compiled else 'numpy, ' + status.why}")


def main() -> None:
    """Start two ranks of this script."""
    from mp2a import kernels, launch

    kernels.build()
    launch.run(2, [sys.executable, "-m", "mpi4py", __file__, "rank"])


if __name__ == "__main__":
    ranks() if sys.argv[1:] == ["rank"] else main()
