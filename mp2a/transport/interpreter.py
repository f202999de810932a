"""Rounds of a method, done step by step with arrays of all nodes of a process, over any transport."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np

from mp2a import kernels
from mp2a.algebra import affine
from mp2a.schedule import Round
from mp2a.spatial import Array
from mp2a.transport.base import Arrival, Nodes
from mp2a.transport.steps import Registers, Use

ADD = "add"
"""The operation that adds to what is there; a node of a tree may do so several times in a round."""

FUNCTIONS: dict[str, Callable[..., Array]] = {
    "compose": kernels.compose,
    "transform": kernels.transform,
    "transform_force": kernels.transform_force,
    "product": affine.product,
    "push": affine.push,
}
"""All other operations: ``f(*inputs, out)`` on ``(nodes, T, numbers)``."""

Perform = Callable[[str, Array, Nodes, list[Array]], None]
"""Do an operation: its name, where the result goes, at which nodes, and the inputs of these nodes."""


class Exchanger(Protocol):
    """The part of a transport that rounds need."""

    def senders(self, round_: Round, kind: str) -> list[Nodes]:
        """See `mp2a.transport.base.Transport`."""
        ...

    def exchange(self, round_: Round, outbox: Mapping[str, Array]) -> list[Arrival]:
        """See `mp2a.transport.base.Transport`."""
        ...


def perform(kernel: str, out: Array, nodes: Nodes, inputs: list[Array]) -> None:
    """Do an operation now."""
    if isinstance(nodes, slice):
        if kernel == ADD:
            out[nodes] += inputs[0]
        else:
            FUNCTIONS[kernel](*inputs, out=out[nodes])
    elif kernel == ADD:
        np.add.at(out, nodes, inputs[0])
    else:
        out[nodes] = FUNCTIONS[kernel](*inputs)


def interpret(
    rounds: Sequence[Round],
    uses: Mapping[str, Use],
    registers: Registers,
    transport: Exchanger,
    perform: Perform = perform,
) -> None:
    """Go through rounds.

    Parameters
    ----------
    rounds
        Rounds of one recurrence.
    uses
        What is done with each kind of message in them.
    registers
        Of all nodes of this process.
    transport
        Exchanges the messages.
    perform
        Does the operations.
    """
    for round_ in rounds:
        registers.note(round_)
        for kind, use in uses.items():
            groups = transport.senders(round_, kind)
            for kernel, out, inputs in use.before if groups else ():
                for nodes in groups:
                    perform(kernel, registers.next(out), nodes, [registers.read(x, round_)[nodes] for x in inputs])
                registers.turn(out)
        arrivals = transport.exchange(round_, {kind: registers.flat(use.sent) for kind, use in uses.items()})
        _receive(round_, arrivals, uses, registers, perform)


def _receive(
    round_: Round, arrivals: list[Arrival], uses: Mapping[str, Use], registers: Registers, perform: Perform
) -> None:
    turned: dict[str, str] = {}
    for kind, nodes, data in arrivals:
        came = registers.came(uses[kind].sent, data)
        for kernel, out, inputs in uses[kind].after:
            if kernel != ADD and registers.owner(out) not in turned:
                turned[registers.owner(out)] = out
                if len(registers[out]) > 1:  # some nodes got nothing and keep what they have
                    registers.copy(out)
            read = [came[x] if x in came else registers.read(x, round_)[nodes] for x in inputs]
            perform(kernel, registers[out] if kernel == ADD else registers.next(out), nodes, read)
    for part in turned.values():
        registers.turn(part)
