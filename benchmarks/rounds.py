"""What a round costs beside the bare messages in it: two ranks, one sample, microseconds a round.

    python benchmarks/rounds.py

The rounds are those of each method between two robots, many of them in a row, with everything a round does: messages,
joining, moving. Beside them, in the same run and interleaved:

- interpreted: the same with the messages of each round by Python, as in traces and over emulated networks;
- bare messages: an exchange of the same sizes, by mpi4py's calls for new requests and for persistent ones;
- arithmetic: what was recorded of the rounds, without the messages.
"""

import argparse
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from itertools import chain
from typing import Any

import numpy as np
from measure import finish, need_kernels, script_parser, spread

from mp2a.mpi_environment import under_mpi
from mp2a.tables import Column, Table, show_seconds

ROUNDS = 1200

Run = Callable[[], object]


def ranks(options: argparse.Namespace) -> None:
    """Measure; run by two ranks, of which the first saves and prints."""
    from mp2a.bench.machine import describe_machine
    from mp2a.methods import METHODS
    from mp2a.mpi import MPI

    results: dict[str, Any] = {"machine": describe_machine(), "runs": []}
    for name in METHODS:
        with ExitStack() as after:
            timed = ours(name, after) | {f"bare, {how}": bare(name, how, after) for how in ("new", "persistent")}
            turns = [{what: seconds(run) for what, run in timed.items()} for _ in range(options.repeats)]
        times = {what: [turn[what] for turn in turns] for what in timed}
        results["runs"].append({"method": name, "seconds": times})
    if MPI.COMM_WORLD.Get_rank() == 0:
        finish(results, [table(results["runs"])], [], options)


def table(runs: list[dict[str, Any]]) -> Table:
    """Make the table of a round's time."""
    names = dict.fromkeys(name for run in runs for name in run["seconds"])
    columns = [Column("method", left=True), *(Column(name, show_seconds, "s") for name in names)]
    rows = [[run["method"], *(spread(run["seconds"], name) for name in names)] for run in runs]
    return Table("time of a round, two ranks, one sample", columns, rows)


def seconds(run: Run) -> float:
    """Seconds a round."""
    from mp2a.mpi import MPI

    MPI.COMM_WORLD.Barrier()
    began = time.perf_counter()
    run()
    return (time.perf_counter() - began) / ROUNDS


def ours(name: str, after: ExitStack) -> dict[str, Run]:
    """Repeat every round of a method many times."""
    from mp2a import Model, kernels
    from mp2a.methods import METHODS
    from mp2a.methods.block import Block
    from mp2a.mpi import MPI
    from mp2a.program.rank import Given, RankProgram
    from mp2a.schedule import Round, Schedule
    from mp2a.transport.link import MPILink
    from mp2a.transport.mpi import MPITransport
    from mp2a.transport.trace import TraceTransport

    comm, method, model = MPI.COMM_WORLD, METHODS[name], Model.random(2)
    rank = comm.Get_rank()
    block = Block(model.body(rank), rank, rank == 0, np.zeros(3), axis=False)
    state = model.random_state(1, body=rank)
    once = method.schedule(2)
    times = range(ROUNDS // len(once.rounds))
    many = Schedule(2, tuple(Round(r.recurrence, k, r.transfers) for r in once.rounds for k in times))
    recorded = block.record(method, many)

    def through(program: RankProgram) -> Run:
        def run() -> None:
            program.run(state, lambda *arrays: Given(arrays, 1, False, lambda: None))

        after.callback(program.close)
        run()
        return run

    transport = MPITransport(MPILink(comm))
    fast, slow = (RankProgram(name, recorded, transport, trace) for trace in (None, TraceTransport(transport)))
    timed = {"ours": through(fast), "interpreted": through(slow)}
    if kernels.rounds() is None:
        return timed
    assert fast.compiled is not None
    return timed | {"arithmetic": fast.compiled.arithmetic()}


def bare(name: str, how: str, after: ExitStack) -> Run:
    """Exchange the same messages in plain mpi4py calls."""
    from mp2a.methods import METHODS
    from mp2a.mpi import MPI

    comm, method = MPI.COMM_WORLD, METHODS[name]
    rank, other = comm.Get_rank(), 1 - comm.Get_rank()
    once = [
        [(int(t.source[0]), [np.zeros(method.doubles[t.kind]), MPI.DOUBLE]) for t in r.transfers]
        for r in method.schedule(2).rounds
    ]
    kept = [[(comm.Send_init if s == rank else comm.Recv_init)(x, other) for s, x in messages] for messages in once]

    for request in chain.from_iterable(kept):
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
    """Start two ranks of this script, or be one of them."""
    parser = script_parser(__doc__, "rounds.json", repeats=15)
    options = parser.parse_args()
    if under_mpi():
        ranks(options)
        return
    from mp2a import launch

    need_kernels()
    sys.exit(launch.run(2, [sys.executable, "-m", "mpi4py", __file__, *sys.argv[1:]]).returncode)


if __name__ == "__main__":
    main()
