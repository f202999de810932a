"""A recorded program, done step by step: over any transport, with any number of samples."""

from collections.abc import Iterable
from typing import Any

from mp2a.program.memory import Frame
from mp2a.program.recorder import Communication, Computation, ValueNumber
from mp2a.transport.base import Parcel, Transport


def replay(frame: Frame, transport: Transport) -> None:
    """Go through a program whose inputs are stored; what it finds stays in the frame.

    A robot that finds out that something is wrong, here or elsewhere, computes no more, but goes through all exchanges.

    Raises
    ------
    Exception
        What a computation raised, after all exchanges.
    """
    error: Exception | None = None
    for instruction in frame.layout.program.instructions:
        if isinstance(instruction, Communication):
            exchange(frame, instruction, transport)
        elif transport.valid:
            try:
                compute(frame, instruction)
            except Exception as found:
                error, transport.valid = found, False
    transport.flush()
    if error is not None:
        raise error


def exchange_only(frame: Frame, transport: Transport, first: int = 0) -> None:
    """Go through the exchanges alone, from one on, of a rank that has nothing to say."""
    exchanges = [x for x in frame.layout.program.instructions if isinstance(x, Communication)]
    for instruction in exchanges[first:]:
        exchange(frame, instruction, transport)
    transport.flush()


def exchange(frame: Frame, instruction: Communication, transport: Transport) -> None:
    """Do an exchange."""
    sends, receives = (
        [Parcel(message.kind, message.partner, frame.message(message)) for message in messages]
        for messages in (instruction.sends, instruction.receives)
    )
    transport.exchange(instruction.round, sends, receives)


def compute(frame: Frame, instruction: Computation) -> None:
    """Work something out."""
    operation, inputs, outputs = instruction
    results = operation.function(*values_of(frame, inputs))
    for number, result in zip(outputs, results if len(outputs) > 1 else (results,), strict=True):
        frame.store(number, result)


def values_of(frame: Frame, inputs: Iterable[Any]) -> list[Any]:
    """Return the arrays of inputs; a constant stays what it is."""
    return [frame.values[x] if isinstance(x, ValueNumber) else x for x in inputs]
