"""One rank's part of a method, noted down: what it computes, sends and receives, in order."""

import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from mp2a.program.operations import NOTHING, Operation, Value, add
from mp2a.schedule import Round, Schedule
from mp2a.spatial import Array

Messages = Mapping[str, Mapping[str, Array]]
"""What each kind of message holds: its parts by name, and of each what it is where no message comes, ``(width,)``.
Parts that are zero there add up if several messages come."""


class Computation(NamedTuple):
    """Work something out."""

    operation: Operation
    inputs: tuple[Any, ...]
    """Numbers of values; anything else is a constant."""
    outputs: tuple[int, ...]


class RankMessage(NamedTuple):
    """A message this rank sends or receives."""

    kind: str
    partner: int
    values: tuple[int, ...]
    """Numbers of the values in it, one after the other."""


class Communication(NamedTuple):
    """Send and receive in a round, if there is anything for this rank in it."""

    round: Round
    sends: tuple[RankMessage, ...]
    receives: tuple[RankMessage, ...]


Instruction = Computation | Communication


class ValueNumber(int):
    """The number of a value among the inputs of an operation, as told from a constant."""


class Argument(NamedTuple):
    """Numbers that are given when a program runs; a compiled one looks whether they are as they should be."""

    name: str
    number: int | None
    """Of the value; None if nobody needs it."""
    shape: tuple[int, ...]
    """Of a sample."""
    bound: float
    """Numbers beyond it are not for compiled arithmetic."""
    unit: slice | None
    """Those that have to have length 1."""


class Output(NamedTuple):
    """A value that is handed out, in the shape in which the caller wants it."""

    value: Any
    shape: tuple[int, ...]
    """Of a sample."""
    columns: slice = slice(None)
    """Which of the value's numbers."""


class Program(NamedTuple):
    """One rank's part of a method, for any number of samples."""

    instructions: tuple[Instruction, ...]
    widths: tuple[int, ...]
    """Numbers a sample of each value."""
    arguments: tuple[Argument, ...]
    """In the order in which they are given."""
    constants: Mapping[int, Array]
    """Values that are the same in every call and for all samples, ``(width,)``; those alone that are used."""
    outputs: Mapping[str, Output]
    """Results by name."""


class MethodRecorder:
    """Stands in the place of the rounds while a method is recorded for one rank.

    Parameters
    ----------
    schedule
        Who exchanges with whom.
    messages
        What each kind of message holds.
    rank
        The node whose part is recorded.
    """

    def __init__(self, schedule: Schedule, messages: Messages, rank: int) -> None:
        self._schedule, self._messages, self._rank = schedule, messages, rank
        self._instructions: list[Instruction] = []
        self._widths: list[int] = []
        self._arguments: list[Argument] = []
        self._constants: dict[int, Array] = {}

    def input(self, name: str, *shape: int, bound: float = sys.float_info.max, unit: slice | None = None) -> Value:
        """Return a value that has to be given when the program runs; see `Argument`."""
        value = self._value(math.prod(shape))
        self._arguments.append(Argument(name, value.number, shape, bound, unit))
        return value

    def constant(self, numbers: Array) -> Value:
        """Return a value that is the same in every call and for all samples, ``(width,)``."""
        value = self._value(len(numbers))
        self._constants[value.number] = numbers
        return value

    def note(self, operation: Operation, inputs: Sequence[Any]) -> Any:
        """Note an operation down and return its result, or its results."""
        widths = operation.widths or (inputs[0].width,)
        results = tuple(self._value(width) for width in widths)
        numbers = tuple(ValueNumber(x.number) if isinstance(x, Value) else x for x in inputs)
        self._instructions.append(Computation(operation, numbers, tuple(value.number for value in results)))
        return results[0] if len(results) == 1 else results

    def recurrence(self, name: str) -> tuple[Round, ...]:
        """Return the rounds of one recurrence."""
        return self._schedule.recurrence(name)

    def exchange(self, round_: Round, **parts: Any) -> tuple[Any, ...]:
        """Note down this rank's messages of a round; what comes has the order of the parts given."""
        sends, receives = [], []
        arrivals: dict[str, list[Value]] = {name: [] for name in parts}
        for kind, source, target in round_.transfers:
            held = self._messages[kind]
            for partner in target[source == self._rank]:
                sends.append(RankMessage(kind, int(partner), tuple(parts[name].number for name in held)))
            for partner in source[target == self._rank]:
                values = {name: self._value(len(absent)) for name, absent in held.items()}
                receives.append(RankMessage(kind, int(partner), tuple(value.number for value in values.values())))
                for name, value in values.items():
                    arrivals[name].append(value)
        self._instructions.append(Communication(round_, tuple(sends), tuple(receives)))
        return tuple(_sum(values) for values in arrivals.values())

    def program(self, outputs: Mapping[str, Output]) -> Program:
        """Return what was recorded, without what nobody needs for these outputs."""
        results = {
            name: x._replace(value=ValueNumber(x.value.number)) if isinstance(x.value, Value) else x
            for name, x in outputs.items()
        }
        needed: set[int] = {x.value for x in results.values() if isinstance(x.value, ValueNumber)}
        kept: list[Instruction] = []
        for instruction in reversed(self._instructions):
            if isinstance(instruction, Communication):
                needed.update(number for message in instruction.sends for number in message.values)
            elif needed.isdisjoint(instruction.outputs):
                continue
            else:
                needed.update(x for x in instruction.inputs if isinstance(x, ValueNumber))
            kept.append(instruction)
        arguments = (x if x.number in needed else x._replace(number=None) for x in self._arguments)
        constants = {number: row for number, row in self._constants.items() if number in needed}
        return Program(tuple(reversed(kept)), tuple(self._widths), tuple(arguments), constants, results)

    def _value(self, width: int) -> Value:
        self._widths.append(width)
        return Value(self, len(self._widths) - 1, width)


def _sum(values: Iterable[Value]) -> Any:
    total: Any = NOTHING
    for value in values:
        total = add(total, value)
    return total
