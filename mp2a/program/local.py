"""A method's rounds with all nodes in this process: arrays have an axis of nodes, and it runs as it stands."""

from typing import Any

import numpy as np

from mp2a.program.recorder import Messages
from mp2a.schedule import Round, Schedule
from mp2a.spatial import Array
from mp2a.transport.local import LocalTransport


class LocalRounds:
    """Rounds of a schedule for all its nodes.

    Parameters
    ----------
    schedule
        Who exchanges with whom.
    messages
        What each kind of message holds.

    Attributes
    ----------
    transport
        Counts what would have been sent.
    """

    def __init__(self, schedule: Schedule, messages: Messages) -> None:
        self._schedule, self._messages = schedule, messages
        self.transport = LocalTransport()

    def recurrence(self, name: str) -> tuple[Round, ...]:
        """Return the rounds of one recurrence."""
        return self._schedule.recurrence(name)

    def exchange(self, round_: Round, **parts: Array) -> tuple[Any, ...]:
        """Exchange parts ``(nodes, T, width)``; where nothing comes is what leaves a node's own part as it is."""
        absent = {name: value for held in self._messages.values() for name, value in held.items()}
        arrived = {name: np.broadcast_to(absent[name], part.shape).copy() for name, part in parts.items()}
        outbox = {t.kind: tuple(parts[name] for name in self._messages[t.kind]) for t in round_.transfers}
        for kind, nodes, arrays in self.transport.exchange(round_, outbox):
            for name, array in zip(self._messages[kind], arrays, strict=True):
                if absent[name].any():
                    arrived[name][nodes] = array
                else:
                    np.add.at(arrived[name], nodes, array)
        return tuple(arrived.values())
