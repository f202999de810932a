"""What a round costs beside the bare messages in it: two ranks, one sample, microseconds a round.

    python benchmarks/rounds.py

The rounds are those of each method between two robots, many of them in a row, with everything a round does: messages,
joining, moving. Beside them, in the same run and interleaved:

- interpreted: the same rounds step by step in Python, as they go in traces, over emulated networks, with hundreds of
  samples and without compiled kernels;
- bare messages: an exchange of the same sizes, by mpi4py's calls for new requests and for persistent ones;
- arithmetic: what was recorded of the rounds, without the messages.
"""

import statistics
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import chain as chained

import numpy as np

ROUNDS, REPEATS = 1200, 15

Run = Callable[[], object]


def ranks() -> None:
    """Measure; run by two ranks."""
    from mpi4py import MPI

    from mp2a import kernels
    from mp2a.methods import METHODS

    comm = MPI.COMM_WORLD
    for name in METHODS:
        with ExitStack() as after:
            timed = ours(name, after) | {f"bare, {how}": bare(name, how, after) for how in ("new", "persistent")}
            turns = [{what: seconds(run) for what, run in timed.items()} for _ in range(REPEATS)]
        if comm.Get_rank() == 0:
            medians = {what: 1e6 * statistics.median(turn[what] for turn in turns) for what in timed}
            print(f"{name:<12}", *(f"{what} {value:5.2f} µs " for what, value in medians.items()))
    if comm.Get_rank() == 0:
        status = kernels.status()
        print(f"kernels: {'compiled' if status.compiled else 'numpy, ' + status.why}")


def seconds(run: Run) -> float:
    """Seconds a round."""
    from mpi4py import MPI

    MPI.COMM_WORLD.Barrier()
    began = time.perf_counter()
    run()
    return (time.perf_counter() - began) / ROUNDS


def ours(name: str, after: ExitStack) -> dict[str, Run]:
    """Repeat every round of a method many times."""
    from mpi4py import MPI

    from mp2a import Model, kernels
    from mp2a.methods import METHODS
    from mp2a.methods.block import Block
    from mp2a.program.rank import RankProgram
    from mp2a.schedule import Round, Schedule
    from mp2a.transport.link import MPILink
    from mp2a.validation import check_state

    comm, method, model = MPI.COMM_WORLD, METHODS[name], Model.random(2)
    rank = comm.Get_rank()
    block = Block(model.body(rank), rank, rank == 0, np.zeros(3))
    state = check_state(block.bodies, *model.random_state(body=rank), None)
    once = method.schedule(2)
    times = range(ROUNDS // len(once.rounds))
    many = Schedule(2, tuple(Round(r.recurrence, k, r.transfers) for r in once.rounds for k in times))
    recorded = block.record(method, many)

    def through(program: RankProgram) -> Run:
        inputs = block.inputs(state, program.inputs)

        def run() -> None:
            program.run(inputs, 1, 2)

        after.callback(program.close)
        run()
        return run

    fast = RankProgram(recorded, MPILink(comm))
    timed = {"ours": through(fast), "interpreted": through(RankProgram(recorded, MPILink(comm), trace=True))}
    if kernels.rounds() is None:
        return timed
    assert fast.compiled is not None
    alone = [fast.compiled.arithmetic(name) for name in dict.fromkeys(r.recurrence for r in once.rounds)]
    return timed | {"arithmetic": lambda: [run() for run in alone]}


def bare(name: str, how: str, after: ExitStack) -> Run:
    """Exchange the same messages in plain mpi4py calls."""
    from mpi4py import MPI

    from mp2a.methods import METHODS

    comm, method = MPI.COMM_WORLD, METHODS[name]
    rank, other = comm.Get_rank(), 1 - comm.Get_rank()
    once = [
        [(int(t.source[0]), [np.zeros(method.doubles[t.kind]), MPI.DOUBLE]) for t in r.transfers]
        for r in method.schedule(2).rounds
    ]
    kept = [[(comm.Send_init if s == rank else comm.Recv_init)(x, other) for s, x in messages] for messages in once]

    for request in chained.from_iterable(kept):
        after.callback(request.Free)

    def new() -> None:
        for _ in range(ROUNDS // len(once)):
            for messages in once:
                MPI.Request.Waitall([(comm.Isend if s == rank else comm.Irecv)(x, other) for s, x in messages])

    def persistent() -> None:
        for _ in range(ROUNDS // len(kept)):
            for requests in kept:
                MPI.Prequest.Startall(requests)
                MPI.Request.Waitall(requests)

    return {"new": new, "persistent": persistent}[how]


def main() -> None:
    """Start two ranks of this script."""
    from mp2a import kernels, launch

    kernels.build()
    launch.run(2, [sys.executable, "-m", "mpi4py", __file__, "rank"])


if __name__ == "__main__":
    ranks() if sys.argv[1:] == ["rank"] else main()
