"""What a robot computes between its messages, measured here: each contender's own code, fed without any message."""

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from mp2a.methods import METHODS
from mp2a.methods.block import Block
from mp2a.model import Model
from mp2a.program.memory import Frame
from mp2a.program.recorder import Communication, MethodRecorder, Output, Program
from mp2a.program.replay import replay
from mp2a.schedule import Round, Schedule, Transfer
from mp2a.spatial import Array
from mp2a.transport.base import Parcel

if TYPE_CHECKING:
    from mp2a.transport.link import Link

_ROBOTS = 64
_BUDGET = 1.0
_FEWEST, _MOST = 5, 2000
_CALLS = 20
"""Calls of something that takes less than the clock can tell."""


class ComputeCosts(NamedTuple):
    """Processor seconds of a robot in the middle of a formation, for all samples of a message."""

    start: Mapping[str, float]
    """Between the round before, or the beginning, and the first round of a recurrence, by its name."""
    between: Mapping[str, float]
    """From what came in a round to the next round of the same recurrence."""
    end: float
    """From what came in the last round to the end."""


def method_costs(name: str, samples: int, seed: int = 0) -> ComputeCosts:
    """Measure a distributed method: what one robot does alone, without its messages.

    Parameters
    ----------
    name
        One of `mp2a.methods.METHODS`.
    samples
        Samples in each message.
    seed
        Of the random chain and its motion.
    """
    from mp2a.mpi import MPI
    from mp2a.program.rank import Given, RankProgram
    from mp2a.transport.link import MPILink
    from mp2a.transport.mpi import MPITransport

    chosen = METHODS[name]
    model = Model.random(_ROBOTS, seed)
    middle = _ROBOTS // 2
    body = model.body(middle)
    state = model.random_state(samples, seed, body=middle)
    link = MPILink(MPI.COMM_SELF)

    def bind(recorded: Program) -> RankProgram:
        program = RankProgram(name, recorded, MPITransport(link))
        program.run(state, lambda *arrays: Given(arrays, samples, False, lambda: None))
        return program

    schedule = as_seen_by(middle, chosen.schedule(_ROBOTS))
    recorded = Block(body, 0, False, body.gravity, axis=False).record(chosen, schedule)
    names = [x.round.recurrence for x in recorded.instructions if isinstance(x, Communication)]
    program, empty = bind(recorded), bind(_nothing(body))
    if program.compiled is None:
        gaps = _medians(lambda: _interpreted(Frame(program.layout, samples), state))
    else:
        gaps = [_seconds(stretch) for stretch in program.compiled.stretches()]
        gaps[0] += _seconds(lambda: empty.run(state, cast("Any", None)))  # what the interpreter does of a call
    program.close()
    empty.close()
    return _sorted(names, gaps)


def _nothing(body: Model) -> Program:
    """Return a program that takes what others take and hands back what it got."""
    recorder = MethodRecorder(Schedule(1, ()), {}, 0)
    q, *_ = (recorder.input(name, width) for name, width in zip("qva", (body.nq, body.nv, body.nv), strict=True))
    return recorder.program({"torque": Output(q, (body.nq,))})


def _interpreted(frame: Frame, state: Sequence[Array]) -> list[float]:
    """Seconds before each round and after the last of a program that is done step by step."""
    watch = _Watch()
    watch.marks.append(time.thread_time())
    frame.give(state)
    replay(frame, watch)
    frame.results(single=False)
    watch.marks.append(time.thread_time())
    return np.subtract(watch.marks[1::2], watch.marks[::2]).tolist()


def _seconds(call: Callable[[], object]) -> float:
    """Seconds of a call that takes less than the clock can tell."""

    def once() -> list[float]:
        began = time.thread_time()
        for _ in range(_CALLS):
            call()
        return [(time.thread_time() - began) / _CALLS]

    return _medians(once)[0]


def pipeline_costs(samples: int, seed: int = 0) -> ComputeCosts:
    """Measure the pipeline: what a robot does alone, and what each hop waits for.

    Each is halved between the way out and the way back, which leaves a whole call as long as it is.
    """
    from mp2a.bench.pipeline import Pipeline

    model = Model.random(3, seed)
    robot = Pipeline(cast("Link", _Neighbours()), model)
    state = model.random_state(samples, seed, body=1)

    def once() -> list[float]:
        robot.alone = robot.hopping = 0.0
        robot.rnea(*state)
        return [robot.alone, robot.hopping]

    alone, hopping = (seconds / 2 for seconds in _medians(once))
    return ComputeCosts({"motion": alone, "force": hopping + alone}, {"motion": hopping, "force": hopping}, hopping)


def gather_scatter_cost(samples: int, seed: int = 0) -> float:
    """Measure what pinocchio takes for one robot of a chain and all samples, s.

    Raises
    ------
    DependencyError
        If pinocchio does not fit in memory.
    """
    from mp2a.reference import Reference

    model = Model.random(_ROBOTS, seed)
    reference = Reference(model)
    state = model.random_state(samples, seed)

    def once() -> list[float]:
        began = time.thread_time()
        reference.torque(*state)
        return [time.thread_time() - began]

    return _medians(once)[0] / _ROBOTS


def as_seen_by(robot: int, schedule: Schedule) -> Schedule:
    """Schedule of one node that sends to itself all that a robot of a larger schedule would send or get."""
    own = np.zeros(1, dtype=np.intp)
    rounds = [
        Round(r.recurrence, r.index, tuple(Transfer(kind, own, own) for kind, s, t in r.transfers if robot in (*s, *t)))
        for r in schedule.rounds
    ]
    return Schedule(1, tuple(rounds))


class _Watch:
    """A transport that brings zeros at once, and notes when a round is asked for and when it goes on."""

    valid = True

    def __init__(self) -> None:
        self.marks: list[float] = []

    def begin(self, tag: int, *, valid: bool) -> None:
        """There is nothing to begin."""

    def exchange(self, round_: Round, sends: Sequence[Parcel], receives: Sequence[Parcel]) -> None:
        """Note the time before and after."""
        self.marks.append(time.thread_time())
        for parcel in receives:
            parcel.data.fill(0.0)
        self.marks.append(time.thread_time())

    def flush(self) -> None:
        """Nothing is in flight here."""


class _Neighbours:
    """Link of a robot in the middle of three, whose neighbours send zeros at once; also what it returns."""

    def __init__(self) -> None:
        self.comm = self

    def Get_rank(self) -> int:
        return 1

    def Get_size(self) -> int:
        return 3

    def receive(self, into: Array, source: int, tag: int) -> "_Neighbours":
        into.fill(0.0)
        return self

    def finish(self, receiving: object) -> bool:
        return True

    def send(self, data: Array, target: int, tag: int) -> "_Neighbours":
        return self

    def Test(self) -> bool:
        return True

    def Wait(self) -> None:
        return


def _medians(once: Callable[[], list[float]]) -> list[float]:
    """Medians of what a run measures, over as many runs as fit the budget, after a first one for warming up."""
    once()
    runs: list[list[float]] = []
    began = time.monotonic()
    while len(runs) < _FEWEST or (len(runs) < _MOST and time.monotonic() - began < _BUDGET):
        runs.append(once())
    return [statistics.median(column) for column in zip(*runs, strict=True)]


def _sorted(names: Sequence[str], gaps: list[float]) -> ComputeCosts:
    """Sort the times before each round and after the last into costs, by the rounds' recurrences."""
    start: dict[str, float] = {}
    between: dict[str, list[float]] = {}
    for name, gap in zip(names, gaps, strict=False):
        if name in start:
            between[name].append(gap)
        else:
            start[name], between[name] = gap, []
    return ComputeCosts(start, {name: statistics.median(times) for name, times in between.items()}, gaps[-1])
