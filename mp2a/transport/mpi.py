"""Messages between processes: one robot a rank."""

from collections.abc import Mapping, Sequence

import numpy as np

from mp2a.exceptions import InputError
from mp2a.mpi import MPI
from mp2a.schedule import Round, Schedule
from mp2a.spatial import Array
from mp2a.transport.base import Arrival, Nodes
from mp2a.transport.interpreter import interpret
from mp2a.transport.link import Link, MPILink, Receiving
from mp2a.transport.native import Program, record
from mp2a.transport.steps import Layout, Registers, Use
from mp2a.transport.wait import wait

_UNSOUND = 0
_NOTHING = np.empty(0)
_OWN = slice(0, 1)

_KEPT = 1 << 20
"""Bytes of registers that stay from call to call, with the rounds recorded for them. With more samples arithmetic and
messages take far longer than the interpreter, and hundreds of ranks on a machine need the memory for others."""


class MPITransport:
    """Carries out this rank's part of a schedule over a communicator of its own.

    Messages carry their number of samples as the tag, and a rank posts a receive for its own number. A rank whose
    input is wrong takes part in all rounds, but with empty messages of tag 0. Either way a message that does not fit is
    never received into a buffer of another size (MPI leaves open what happens then; Open MPI has been seen to crash):
    the receiver finds it by a probe, and from then on sends empty messages itself. By the end of a call that sends both
    ways along the chain each rank knows that something was wrong somewhere, and a call where all is well sends nothing
    more than the schedule says.

    Where it pays, rounds are recorded once and then done without the interpreter, with persistent requests; see
    `mp2a.transport.native`.

    Attributes
    ----------
    sound
        Whether this rank's data are still worth something; `begin` sets it.
    programs
        Recorded rounds by recurrence; None where they could not be.
    messages, doubles
        What this rank has really sent so far: messages by kind, and numbers in all.
    """

    nodes = 1

    def __init__(self, link: Link, schedule: Schedule) -> None:
        self.link = link
        self.first = link.comm.Get_rank()
        self.sound = True
        self.samples = 1
        self.messages: dict[str, int] = {}
        self.doubles = 0
        self._sends: dict[tuple[str, int], list[tuple[str, int]]] = {}
        self._receives: dict[tuple[str, int], list[tuple[str, int]]] = {}
        for round_ in schedule.rounds:
            key = round_.recurrence, round_.index
            self._sends[key] = _peers(round_, self.first, sending=True)
            self._receives[key] = _peers(round_, self.first, sending=False)
        self._inboxes: dict[tuple[str, int], Array] = {}
        self._in_flight: list[MPI.Request] = []
        self._registers: list[Registers] = []
        self.programs: dict[str, Program | None] = {}

    @property
    def most_samples(self) -> int:
        """Largest number of samples that fits a tag of this MPI."""
        bound = self.link.comm.Get_attr(MPI.TAG_UB)
        return int(bound) if bound is not None else 32767

    def begin(self, samples: int, *, sound: bool) -> None:
        """Start a call with T samples, and with sound input or not."""
        self.samples, self.sound = samples, sound

    def registers(self, layout: Layout, samples: int) -> Registers:
        """Return registers for a call, those of the last one if it had as many samples."""
        if any(kept.samples != samples for kept in self._registers):
            self.close()
        for kept in self._registers:
            if kept.layout == layout:
                kept.reset()
                return kept
        registers = Registers(layout, 1, samples)
        if registers.size <= _KEPT:
            self._registers.append(registers)
        return registers

    def run(self, rounds: Sequence[Round], uses: Mapping[str, Use], registers: Registers) -> None:
        """Go through rounds, without the interpreter if all is well so far."""
        program = self._program(rounds, uses, registers) if self.sound and rounds else None
        if program is None:
            interpret(rounds, uses, registers, self)
            return
        done = program.run(registers)
        for sent in program.sent[:done]:
            for kind, doubles in sent:
                self._count(kind, doubles)
        if program.misfit:
            self.sound = False
            interpret(rounds[done:], uses, registers, self)

    def close(self) -> None:
        """Free what is kept for the next call."""
        for program in self.programs.values():
            if program is not None:
                program.free()
        self.programs, self._registers = {}, []

    def exchange(self, round_: Round, outbox: Mapping[str, Array]) -> list[Arrival]:
        """Send and receive what the schedule says for this rank; waits for what it receives."""
        key = round_.recurrence, round_.index
        expected: list[tuple[str, Receiving]] = []
        for kind, source in self._receives[key]:
            inbox = self._inbox(kind, outbox[kind].size, len(expected))
            expected.append((kind, self.link.receive(inbox, source, self.samples)))
        earlier, self._in_flight = self._in_flight, [
            self._send(kind, target, outbox[kind]) for kind, target in self._sends[key]
        ]  # fmt: skip
        for _, receiving in expected:
            if not self.link.finish(receiving):
                self.sound = False
                receiving.into.fill(0.0)
        for request in earlier:
            wait(request)
        return [Arrival(kind, _OWN, receiving.into) for kind, receiving in expected]

    def flush(self) -> None:
        """Wait until everything sent may be overwritten."""
        for request in self._in_flight:
            wait(request)
        self._in_flight = []

    def senders(self, round_: Round, kind: str) -> list[Nodes]:
        """Return this rank, if it sends this kind."""
        sends = self._sends[round_.recurrence, round_.index]
        return [_OWN] if any(what == kind for what, _ in sends) else []

    def _inbox(self, kind: str, size: int, place: int) -> Array:
        """Buffer for the message in a place of the round; kept for the next call as long as its size stays."""
        key = kind, place
        if key not in self._inboxes or self._inboxes[key].size != size:
            self._inboxes[key] = np.empty((1, size))
        return self._inboxes[key]

    def _send(self, kind: str, target: int, data: Array) -> MPI.Request:
        if not self.sound:
            return self.link.send(_NOTHING, target, _UNSOUND)
        self._count(kind, data.size)
        return self.link.send(data, target, self.samples)

    def _count(self, kind: str, doubles: int) -> None:
        self.messages[kind] = self.messages.get(kind, 0) + 1
        self.doubles += doubles

    def _program(self, rounds: Sequence[Round], uses: Mapping[str, Use], registers: Registers) -> Program | None:
        """Record rounds, once; None where they have to be interpreted."""
        if not any(registers is kept for kept in self._registers) or not isinstance(self.link, MPILink):
            return None
        name = rounds[0].recurrence
        if name not in self.programs:
            self.programs[name] = record(self.link.comm, rounds, uses, registers, self._sends, self._receives)
        return self.programs[name]


def agree(comm: MPI.Intracomm, mine: bool) -> bool:
    """Tell whether something is true on every rank; collective."""
    every = np.empty(1, dtype=np.int32)
    wait(comm.Iallreduce(np.array([mine], dtype=np.int32), every, MPI.MIN))
    return bool(every[0])


def raise_together(comm: MPI.Intracomm, error: Exception | None) -> None:
    """Raise the error of the lowest rank that has one, in every rank; collective.

    Raises
    ------
    InputError
        With the rank and the text of that error.
    """
    if agree(comm, error is None):
        return
    texts = comm.allgather(None if error is None else str(error))
    rank, text = next((rank, text) for rank, text in enumerate(texts) if text is not None)
    raise InputError(f"rank {rank}: {text}")


def _peers(round_: Round, rank: int, *, sending: bool) -> list[tuple[str, int]]:
    """Kind and partner of each message of a round that this rank sends or receives."""
    out = []
    for kind, source, target in round_.transfers:
        mine, other = (source, target) if sending else (target, source)
        out += [(kind, int(partner)) for partner in other[mine == rank]]
    return out
