"""Who sends what to whom in which round: plain data, no numbers, no MPI (paper, figures 4-6 and Table I)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.exceptions import InputError
from mp2a.segments.affine import MATRIX_AND_VECTOR, VECTOR

Nodes = NDArray[np.intp]


class Transfer(NamedTuple):
    """All messages of one kind in a round."""

    kind: str
    source: Nodes
    """``(k,)`` sending nodes, from 0."""
    target: Nodes
    """``(k,)`` receiving nodes."""


@dataclass(frozen=True)
class Round:
    """Messages that may be in flight at the same time, because each sends what it knew before the round."""

    recurrence: str
    index: int
    """The paper's e, from 1."""
    transfers: tuple[Transfer, ...]


@dataclass(frozen=True)
class Schedule:
    """All rounds of an algorithm for a number of nodes, in the order every node goes through them."""

    nodes: int
    rounds: tuple[Round, ...]

    def recurrence(self, name: str) -> tuple[Round, ...]:
        """Select the rounds of one recurrence."""
        return tuple(round_ for round_ in self.rounds if round_.recurrence == name)

    def count(self, doubles: Mapping[str, int]) -> "Count":
        """Count rounds, messages and numbers; ``doubles`` says how many numbers a sample each kind of message has."""
        messages: dict[str, int] = {}
        for round_ in self.rounds:
            for kind, source, _ in round_.transfers:
                messages[kind] = messages.get(kind, 0) + len(source)
        sent = sum(number * doubles[kind] for kind, number in messages.items())
        return Count(len(self.rounds), messages, sent)

    def __str__(self) -> str:
        lines = []
        for round_ in self.rounds:
            for kind, source, target in round_.transfers:
                pairs = "  ".join(f"{s + 1}→{t + 1}" for s, t in zip(source, target, strict=True))
                lines.append(f"{round_.recurrence:<13} round {round_.index}  {kind:<14} {pairs}")
        return "\n".join(lines)


class Count(NamedTuple):
    """What a schedule costs for one sample."""

    rounds: int
    messages: dict[str, int]
    """By kind."""
    doubles: int
    """Numbers sent in all."""

    @property
    def total(self) -> int:
        """Messages of all kinds."""
        return sum(self.messages.values())


def rounds_needed(n: int) -> int:
    """⌈log2 n⌉, the rounds of one recurrence."""
    if n < 1:
        raise InputError(f"n: got {n}, expected at least 1")
    return (n - 1).bit_length()


def kogge_stone(n: int) -> Schedule:
    """Three recursive doublings: velocities and accelerations outwards, forces inwards (paper, figures 4-6).

    In round e robot i sends to robot i + 2^(e-1), for forces to i - 2^(e-1). A sender whose window already reaches
    the end of the chain sends the vector alone, any other matrix and vector.

    Parameters
    ----------
    n
        Number of robots.
    """
    outwards = [_doubling_round(n, e) for e in range(1, rounds_needed(n) + 1)]
    inwards = [_mirrored(n, transfers) for transfers in outwards]
    recurrences = (("velocity", outwards), ("acceleration", outwards), ("force", inwards))
    return Schedule(
        n,
        tuple(Round(name, e, transfers) for name, rounds in recurrences for e, transfers in enumerate(rounds, start=1)),
    )


def relay(n: int) -> Schedule:
    """Neighbour to neighbour: 2 (n - 1) hops, motion (12 numbers) outwards, then forces (6) inwards."""
    rounds_needed(n)
    out = [Round("motion", i, (_transfer("motion", [i - 1], [i]),)) for i in range(1, n)]
    back = [Round("force", i, (_transfer("force", [n - i], [n - i - 1]),)) for i in range(1, n)]
    return Schedule(n, (*out, *back))


def _doubling_round(n: int, e: int) -> tuple[Transfer, ...]:
    step = 2 ** (e - 1)
    source = np.arange(n - step)
    reaches_end = source < step
    kinds = ((MATRIX_AND_VECTOR, source[~reaches_end]), (VECTOR, source[reaches_end]))
    return tuple(Transfer(kind, nodes, nodes + step) for kind, nodes in kinds if nodes.size)


def _mirrored(n: int, transfers: tuple[Transfer, ...]) -> tuple[Transfer, ...]:
    return tuple(Transfer(kind, n - 1 - source[::-1], n - 1 - target[::-1]) for kind, source, target in transfers)


def _transfer(kind: str, source: list[int], target: list[int]) -> Transfer:
    return Transfer(kind, np.array(source), np.array(target))


SCHEDULES: dict[str, Callable[[int], Schedule]] = {"kogge-stone": kogge_stone, "relay": relay}
"""Every schedule by the name of the method that follows it."""
