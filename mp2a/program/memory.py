"""Where the values of a program lie: memory that is used again as soon as nobody needs what is in it.

Values that messages hold or compiled steps touch get a place in a slot; others are arrays of their own for as long as
they are needed. What is sent stays untouched until its message is known to be gone, which is waited for in the next
exchange; and a receive may fill its place from the moment the exchange begins.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from mp2a.program.operations import Operation, add
from mp2a.program.recorder import (
    Communication,
    Computation,
    Instruction,
    Output,
    Program,
    RankMessage,
    ValueNumber,
)
from mp2a.spatial import Array


class MemoryPlace(NamedTuple):
    """Where a value lies, in numbers a sample."""

    slot: int
    start: int


class MemoryLayout(NamedTuple):
    """A program whose values have places."""

    program: Program
    places: dict[int, MemoryPlace]
    slots: tuple[int, ...]
    """Numbers a sample of each slot."""

    def size(self, samples: int) -> int:
        """Return the bytes of all slots."""
        return 8 * samples * sum(self.slots)


def _copy(array: Array) -> Array:
    return array


COPY = Operation(_copy, step="copy")
"""A value once more, where it has to lie beside others."""


def lay_out(program: Program) -> MemoryLayout:
    """Give the values of a program their places."""
    program, groups = _group(program)
    first, last = _lives(program, groups)
    return MemoryLayout(program, *_allocate(program, groups, first, last))


class Frame:
    """The memory of a program for a number of samples.

    Attributes
    ----------
    values
        Array ``(1, T, width)`` of each value, by its number; of a value without a place None until it is worked out.
    """

    def __init__(self, layout: MemoryLayout, samples: int) -> None:
        self.layout, self.samples = layout, samples
        self._slots = [np.zeros((1, samples * width)) for width in layout.slots]
        self.values: list[Array | None] = [None] * len(layout.program.widths)
        for number, place in layout.places.items():
            self.values[number] = self._cut(place, layout.program.widths[number]).reshape(1, samples, -1)
        for number, row in layout.program.constants.items():
            self.store(number, np.broadcast_to(row, (1, samples, len(row))))

    def message(self, message: RankMessage) -> Array:
        """Return the memory of a message as it goes on the wire, ``(1, T numbers)``, contiguous."""
        width = sum(self.layout.program.widths[number] for number in message.values)
        return self._cut(self.layout.places[message.values[0]], width)

    def store(self, number: int, array: Array) -> None:
        """Put a value where it belongs."""
        if number in self.layout.places:
            place = self.values[number]
            assert place is not None
            place[...] = array
        else:
            self.values[number] = array

    def give(self, arrays: Sequence[Array]) -> None:
        """Store the arguments of a call, ``(T, *shape)`` each."""
        for argument, array in zip(self.layout.program.arguments, arrays, strict=True):
            if argument.number is not None:
                self.store(argument.number, array.reshape(1, self.samples, -1))

    def results(self, *, single: bool) -> dict[str, Any]:
        """Return the outputs for the caller to keep, ``(T, *shape)``, or ``shape`` of a single sample."""
        found = {}
        for name, output in self.layout.program.outputs.items():
            value = output.value
            if isinstance(value, ValueNumber):
                view = self._view(output, single)
                value = view.copy() if value in self.layout.places else view
            found[name] = value
        return found

    def placed_views(self, *, single: bool) -> tuple[tuple[str, Array], ...] | None:
        """Return where the outputs lie, of which `results` makes copies; None if not all have a place."""
        outputs = self.layout.program.outputs
        if any(output.value not in self.layout.places for output in outputs.values()):
            return None
        return tuple((name, self._view(output, single)) for name, output in outputs.items())

    def _view(self, output: Output, single: bool) -> Array:
        array = self.values[output.value]
        assert array is not None
        shaped = array[0, :, output.columns].reshape(self.samples, *output.shape)
        view: Array = shaped[0] if single else shaped
        return view

    def _cut(self, place: MemoryPlace, width: int) -> Array:
        return self._slots[place.slot][:, place.start * self.samples : (place.start + width) * self.samples]


def _group(program: Program) -> tuple[Program, list[tuple[int, ...]]]:
    """Find values that have to lie side by side, since a message holds them; copy those that cannot."""
    groups: dict[int, tuple[int, ...]] = {}
    widths = list(program.widths)
    instructions: list[Instruction] = []
    for instruction in program.instructions:
        if isinstance(instruction, Computation):
            if instruction.operation.step is not None:
                for number in _touched(instruction):
                    groups.setdefault(number, (number,))
            instructions.append(instruction)
            continue
        for message in instruction.receives:
            groups.update(dict.fromkeys(message.values, message.values))
        sends = []
        for message in instruction.sends:
            numbers = message.values
            if len(numbers) > 1 and groups.get(numbers[0]) != numbers:
                copies = []
                for number in numbers:
                    if len(groups.get(number, ())) > 1:  # it already lies beside others
                        widths.append(widths[number])
                        instructions.append(Computation(COPY, (ValueNumber(number),), (len(widths) - 1,)))
                        number = len(widths) - 1  # noqa: PLW2901
                    copies.append(number)
                numbers = tuple(copies)
                groups.update(dict.fromkeys(numbers, numbers))
            for number in numbers:
                groups.setdefault(number, (number,))
            sends.append(message._replace(values=numbers))
        instructions.append(instruction._replace(sends=tuple(sends)))
    given = {argument.number for argument in program.arguments}
    for output in program.outputs.values():
        if isinstance(output.value, ValueNumber) and output.value in given:
            groups.setdefault(output.value, (output.value,))
    changed = program._replace(instructions=tuple(instructions), widths=tuple(widths))
    return changed, list(dict.fromkeys(groups.values()))


def _touched(instruction: Computation) -> Iterator[int]:
    yield from (x for x in instruction.inputs if isinstance(x, ValueNumber))
    yield from instruction.outputs


def _lives(program: Program, groups: Sequence[tuple[int, ...]]) -> tuple[dict[int, int], dict[int, int]]:
    """Find the first and the last instruction for which each value has to be there; -1: from the start."""
    first = {argument.number: -1 for argument in program.arguments if argument.number is not None}
    end = len(program.instructions)
    last: dict[int, int] = dict.fromkeys(program.constants, end + 1)
    first.update(dict.fromkeys(program.constants, -1))
    in_flight: list[int] = []

    def lives_until(numbers: Iterable[int], k: int) -> None:
        last.update((number, max(k, last.get(number, k))) for number in numbers)

    for k, instruction in enumerate(program.instructions):
        if isinstance(instruction, Computation):
            first.update(dict.fromkeys(instruction.outputs, k))
            lives_until(_touched(instruction), k)
        elif instruction.sends or instruction.receives:
            lives_until(in_flight, k)
            in_flight = [number for message in instruction.sends for number in message.values]
            coming = [number for message in instruction.receives for number in message.values]
            first.update(dict.fromkeys(coming, k))
            lives_until(coming, k)
            lives_until(in_flight, k)
    lives_until(in_flight, end)
    lives_until((x.value for x in program.outputs.values() if isinstance(x.value, ValueNumber)), end)
    for group in groups:
        begin, until = min(first[number] for number in group), max(last.get(number, -1) for number in group)
        first.update(dict.fromkeys(group, begin))
        last.update(dict.fromkeys(group, until))
    return first, last


def _allocate(
    program: Program, groups: Sequence[tuple[int, ...]], first: dict[int, int], last: dict[int, int]
) -> tuple[dict[int, MemoryPlace], tuple[int, ...]]:
    """Give groups slots of their width that are free, in the order in which they begin to live."""
    places: dict[int, MemoryPlace] = {}
    slots: list[int] = []
    busy_until: list[int] = []
    for group in sorted(groups, key=lambda group: first[group[0]]):
        width, begin = sum(program.widths[number] for number in group), first[group[0]]
        slot = _in_place(program, group, begin, last, places)
        if slot is None or slots[slot] != width:
            free = (k for k, size in enumerate(slots) if size == width and busy_until[k] < begin)
            slot = next(free, len(slots))
        if slot == len(slots):
            slots.append(width)
            busy_until.append(-1)
        busy_until[slot] = last[group[0]]
        start = 0
        for number in group:
            places[number] = MemoryPlace(slot, start)
            start += program.widths[number]
    return places, tuple(slots)


def _in_place(
    program: Program, group: tuple[int, ...], begin: int, last: dict[int, int], places: dict[int, MemoryPlace]
) -> int | None:
    """Slot of a first summand that ends where the sum begins."""
    if len(group) > 1 or begin < 0:
        return None
    instruction = program.instructions[begin]
    if isinstance(instruction, Communication) or instruction.operation is not add:
        return None
    summand = instruction.inputs[0]
    return places[summand].slot if summand in places and last[summand] == begin else None
