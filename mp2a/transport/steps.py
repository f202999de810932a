"""What a node does in the rounds of a method, as data: its numbers, and what each kind of message does to them.

`mp2a.transport.interpreter` and `mp2a.transport.native` are two ways to do it.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from mp2a.schedule import Round
from mp2a.spatial import Array


class Operation(NamedTuple):
    """A result worked out from numbers of the same node.

    Names are those of parts of registers. ``<name`` is that part in the message that came; ``name@recurrence`` is the
    part as it was before the round of the same index of an earlier recurrence.
    """

    kernel: str
    """One of `mp2a.transport.interpreter.FUNCTIONS`."""
    out: str
    inputs: tuple[str, ...]


class Use(NamedTuple):
    """What nodes do with a kind of message."""

    sent: str
    """Register, or part of one, whose numbers are sent."""
    before: tuple[Operation, ...] = ()
    """What a sender works out before."""
    after: tuple[Operation, ...] = ()
    """What a receiver does for each message that came. All read what was there before the round, but what is added
    up."""

    def then(self, operation: Operation) -> "Use":
        """Let a receiver do one more thing."""
        return self._replace(after=(*self.after, operation))


class Register(NamedTuple):
    """Numbers that every node has, in a buffer that may be sent."""

    parts: Mapping[str, int]
    """Name of each part and its numbers a sample. A part has all samples before the next one begins."""
    copies: int = 1
    """1: changed in place. 2: what is sent, since messages may still be on their way when the next ones are worked
    out. More: to keep what it was before each round."""


Layout = Mapping[str, Register]


class Registers:
    """The registers of some nodes for a number of samples.

    Attributes
    ----------
    size
        Bytes of all buffers.
    """

    def __init__(self, layout: Layout, nodes: int, samples: int) -> None:
        self.layout, self.samples = layout, samples
        self.size = 0
        self._flat: dict[str, list[Array]] = {}
        self._parts: dict[str, list[Array]] = {}
        self._owner: dict[str, str] = {}
        for name, register in layout.items():
            buffers = [np.zeros((nodes, samples * sum(register.parts.values()))) for _ in range(register.copies)]
            self.size += sum(buffer.nbytes for buffer in buffers)
            self._flat[name] = buffers
            for part, cut in _cuts(register, samples).items():
                self._owner[part] = name
                self._flat.setdefault(part, [buffer[:, cut] for buffer in buffers])
                self._parts[part] = [buffer[:, cut].reshape(nodes, samples, -1) for buffer in buffers]
        self.reset()

    def reset(self) -> None:
        """Begin a call."""
        self.version = dict.fromkeys(self.layout, 0)
        self.earlier: dict[tuple[str, int], dict[str, int]] = {}

    def __getitem__(self, part: str) -> Array:
        """Return a part as it is, ``(nodes, T, numbers)``."""
        return self._parts[part][self.version[self._owner[part]]]

    def flat(self, name: str) -> Array:
        """Return a register or a part as it is, as it is sent, ``(nodes, T numbers)``."""
        return self._flat[name][self.version[self._owner.get(name, name)]]

    def note(self, round_: Round) -> None:
        """Remember what is there before a round."""
        self.earlier[round_.recurrence, round_.index] = self.version.copy()

    def read(self, name: str, round_: Round) -> Array:
        """Return a part by its name in an operation, but for what came."""
        part, _, recurrence = name.partition("@")
        if not recurrence:
            return self[part]
        return self._parts[part][self.earlier[recurrence, round_.index][self._owner[part]]]

    def next(self, part: str) -> Array:
        """Return where the next version of a part goes."""
        owner = self._owner[part]
        return self._parts[part][(self.version[owner] + 1) % self.layout[owner].copies]

    def copy(self, part: str) -> None:
        """Begin the next version of the register a part is in with what it has now."""
        buffers, now = self._flat[self._owner[part]], self.version[self._owner[part]]
        np.copyto(buffers[(now + 1) % len(buffers)], buffers[now])

    def turn(self, part: str) -> None:
        """Go on to the next version of the register a part is in."""
        owner = self._owner[part]
        self.version[owner] = (self.version[owner] + 1) % self.layout[owner].copies

    def owner(self, part: str) -> str:
        """Name of the register a part is in."""
        return self._owner[part]

    def came(self, name: str, data: Array) -> dict[str, Array]:
        """Parts of messages ``(k, T numbers)`` that were sent from a register or a part, by their names."""
        if name not in self.layout or name in self.layout[name].parts:
            return {f"<{name}": data.reshape(len(data), self.samples, -1)}
        cuts = _cuts(self.layout[name], self.samples)
        return {f"<{part}": data[:, cut].reshape(len(data), self.samples, -1) for part, cut in cuts.items()}


def _cuts(register: Register, samples: int) -> dict[str, slice]:
    """Where each part lies in a row of the buffer."""
    out, start = {}, 0
    for part, numbers in register.parts.items():
        out[part] = slice(start, start + samples * numbers)
        start += samples * numbers
    return out
