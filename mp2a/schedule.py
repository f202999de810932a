"""Who sends what to whom in which round: plain data, no numbers, no MPI (paper, figures 4-6 and Table I)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.algebra.affine import MATRIX_AND_VECTOR, VECTOR
from mp2a.checks import array, count
from mp2a.exceptions import InputError

Nodes = NDArray[np.intp]
Formation = int | Nodes

MOTION, FORCE = "motion", "force"
"""Kinds of messages of all schedules but the paper's."""

TAIL, SHIFT = "tail", "shift"
"""Kind of message and name of the recurrence in front of all others if nodes are blocks."""


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
    """⌈log2 n⌉, the rounds of one recurrence along a chain of n."""
    return (count("n", n) - 1).bit_length()


def kogge_stone(formation: Formation) -> Schedule:
    """Three recursive doublings: velocities and accelerations outwards, forces inwards (paper, figures 4-6).

    In round e robot i sends to robot i + 2^(e-1), for forces to i - 2^(e-1). A sender whose window already reaches
    the end of the chain sends the vector alone, any other matrix and vector.

    Parameters
    ----------
    formation
        Number of robots of a chain, or its parents.

    Raises
    ------
    InputError
        For a tree: a window of affine maps inwards belongs to one path, and below a branching there are several.
    """
    parents = _parents(formation)
    n = len(parents)
    if (parents != np.arange(n) - 1).any():
        raise InputError("parents: got a tree, expected a serial chain for 'kogge-stone'; take 'sweep' or 'compact'")
    outwards = [_affine_round(n, e) for e in range(1, rounds_needed(n) + 1)]
    inwards = [_mirrored(n, transfers) for transfers in outwards]
    recurrences = (("velocity", outwards), ("acceleration", outwards), ("force", inwards))
    return Schedule(n, tuple(r for name, rounds in recurrences for r in _numbered(name, rounds)))


def sweep(formation: Formation) -> Schedule:
    """One doubling over parents in which motion travels outwards and force inwards in the same rounds.

    Parameters
    ----------
    formation
        Number of robots of a chain, or the parents of a tree, ``(n,)`` with -1 for the base.
    """
    parents = _parents(formation)
    rounds = [(_outwards(up), _inwards(up)) for up in ancestors(parents)]
    return Schedule(len(parents), tuple(_numbered("sweep", rounds)))


def compact(formation: Formation) -> Schedule:
    """Two doublings over parents: motion outwards, then forces inwards.

    Parameters
    ----------
    formation
        As for `sweep`.
    """
    parents = _parents(formation)
    ups = ancestors(parents)
    out = _numbered("motion", [(_outwards(up),) for up in ups])
    back = _numbered("force", [(_inwards(up),) for up in ups])
    return Schedule(len(parents), (*out, *back))


def motion(formation: Formation) -> Schedule:
    """Take the rounds of motion of `compact` alone, which tell every body where it is."""
    schedule = compact(formation)
    return Schedule(schedule.nodes, schedule.recurrence("motion"))


def parent_to_child(formation: Formation) -> Schedule:
    """One round: every body to those that hang on it.

    Parameters
    ----------
    formation
        As for `sweep`.
    """
    parents = _parents(formation)
    return Schedule(len(parents), tuple(_numbered("parent to child", [(_outwards(parents),)])))


def broadcast(formation: Formation) -> Schedule:
    """One doubling outwards in which every body but the first of a chain gets one message, with what the first one has.

    In round e those that have it, fewer than 2^(e-1) bodies from the base, hand it to their 2^(e-1)-th descendants.

    Parameters
    ----------
    formation
        As for `sweep`.
    """
    parents = _parents(formation)
    ups = ancestors(parents)
    missing = parents >= 0
    rounds = []
    for up in ups:
        reached = np.flatnonzero(missing & (up >= 0) & ~missing[up])
        rounds.append((Transfer(MOTION, up[reached], reached),))
        missing[reached] = False
    return Schedule(len(parents), tuple(_numbered("broadcast", rounds)))


def pipeline(formation: Formation) -> Schedule:
    """Neighbour to neighbour: 2 (n - 1) hops of a chain, motion (12 numbers) outwards, then forces (6) inwards."""
    n = len(_parents(formation))
    out = _numbered("motion", [(_transfer(MOTION, [i - 1], [i]),) for i in range(1, n)])
    back = _numbered("force", [(_transfer(FORCE, [n - i], [n - i - 1]),) for i in range(1, n)])
    return Schedule(n, (*out, *back))


def shifted(schedule: Schedule) -> Schedule:
    """Put a round in front in which each block of a chain hands the path to its tail to the next."""
    nodes = np.arange(schedule.nodes)
    shift = [(Transfer(TAIL, nodes[:-1], nodes[1:]),)] if schedule.nodes > 1 else []
    return Schedule(schedule.nodes, (*_numbered(SHIFT, shift), *schedule.rounds))


def ancestors(parents: Nodes) -> list[Nodes]:
    """Every body's 2^(e-1)-th ancestor in round e = 1, 2, …, -1 where there is none; until nobody has one.

    Pointer doubling: the ancestor's ancestor. ⌈log2 d⌉ rounds for the longest path of d bodies.
    """
    out, up = [], parents
    while (up >= 0).any():
        out.append(up)
        up = np.where(up >= 0, up[up], -1)
    return out


def _parents(formation: Formation) -> Nodes:
    if isinstance(formation, int | np.integer):
        return np.arange(count("n", int(formation))) - 1
    return array("parents", formation, (None,), whole=True)


def _numbered(recurrence: str, rounds: Sequence[tuple[Transfer, ...]]) -> list[Round]:
    return [Round(recurrence, e, transfers) for e, transfers in enumerate(rounds, start=1)]


def _outwards(up: Nodes) -> Transfer:
    has = np.flatnonzero(up >= 0)
    return Transfer(MOTION, up[has], has)


def _inwards(up: Nodes) -> Transfer:
    has = np.flatnonzero(up >= 0)
    return Transfer(FORCE, has, up[has])


def _affine_round(n: int, e: int) -> tuple[Transfer, ...]:
    step = 2 ** (e - 1)
    source = np.arange(n - step)
    reaches_end = source < step
    kinds = ((MATRIX_AND_VECTOR, source[~reaches_end]), (VECTOR, source[reaches_end]))
    return tuple(Transfer(kind, nodes, nodes + step) for kind, nodes in kinds if nodes.size)


def _mirrored(n: int, transfers: tuple[Transfer, ...]) -> tuple[Transfer, ...]:
    return tuple(Transfer(kind, n - 1 - source[::-1], n - 1 - target[::-1]) for kind, source, target in transfers)


def _transfer(kind: str, source: list[int], target: list[int]) -> Transfer:
    return Transfer(kind, np.array(source), np.array(target))
