"""What a method is given of each node, and what it finds out: the same for single bodies and for blocks."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

from mp2a.program.recorder import Messages
from mp2a.schedule import Formation, Round, Schedule


class Rounds(Protocol):
    """The rounds of a schedule, for all nodes or for one."""

    def recurrence(self, name: str) -> tuple[Round, ...]:
        """Return the rounds of one recurrence."""
        ...

    def exchange(self, round_: Round, **parts: Any) -> tuple[Any, ...]:
        """Send each kind of message of the round, made of the parts given; return in their order the parts that come.

        Where none comes it is what leaves a node's own part as it is. Forces of several children come added up.
        """
        ...


class Own(NamedTuple):
    """What nodes know by themselves; a node is a body, or a block of which the first is its head.

    Arrays ``(nodes, T, numbers)``, or values while a method is recorded.
    """

    path: Any
    """From the parent's head to the own one, 24 numbers (`mp2a.algebra.motion`)."""
    inertia: Callable[[], Any]
    """Composite inertia of the node about its head, 28 numbers (`mp2a.algebra.inertia`)."""
    force: Callable[[Any, Any], Any]
    """Force that the node takes at its head for the head's velocity and classical acceleration, 6 numbers."""
    gravity: Any
    """``(3,)`` m/s² in the base frame."""
    base: Any
    """``[0; -g]``, the acceleration of the base, where it is the parent; what adds nothing elsewhere."""
    no_force: Callable[[], Any]
    """Zeros, 6 numbers."""


class ScanResult(NamedTuple):
    """What nodes know after the exchanges, of their heads; 6 numbers each."""

    velocity: Any
    acceleration: Any
    """Classical."""
    force: Any
    """That the joint passes to the head."""
    distal_force: Any
    """The part of it that goes to what is behind the node. It comes from what was received, not from a difference, in
    which digits would be lost; for nodes of more than one body."""
    path: Any = None
    """From the base to the heads, 24 numbers, where the method has it."""


class Work(NamedTuple):
    """Arithmetic of one robot in one round, as measured on one core; it weighs methods against each other."""

    call: float
    """s, whatever the number of samples, of a recorded round"""
    sample: float
    """s a sample"""

    def seconds(self, samples: int) -> float:
        """Return the time of a round for some samples."""
        return self.call + samples * self.sample


class Method(NamedTuple):
    """A distributed method: who talks to whom, and what each robot does."""

    schedule: Callable[[Formation], Schedule]
    """Schedule for the parents of a formation."""
    messages: Messages
    """What each kind of message holds."""
    work: Work
    """Mean over the rounds."""
    scan: Callable[[Own, Rounds], ScanResult]
    """What each node does: straight on over its rounds."""

    @property
    def doubles(self) -> Mapping[str, int]:
        """Numbers a sample in each kind of message."""
        return {kind: sum(len(part) for part in parts.values()) for kind, parts in self.messages.items()}
