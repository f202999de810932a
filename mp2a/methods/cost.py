"""What a call of a method costs, modelled: rounds, messages, bytes and time."""

from typing import NamedTuple

from mp2a.methods import METHODS
from mp2a.schedule import Formation


class Cost(NamedTuple):
    """Cost of one call, all robots together."""

    rounds: int
    """That follow one another."""
    messages: int
    bytes: int
    seconds: float
    """Rounds one after another, each with its latency, its largest message and the robot's arithmetic."""


def cost(method: str, formation: Formation, samples: int, latency: float, bandwidth: float) -> Cost:
    """Model a call of a method.

    Parameters
    ----------
    method
        Name in `mp2a.methods.METHODS`.
    formation
        Number of robots of a chain, or the parents of a tree.
    samples
        T, samples in each message.
    latency, bandwidth
        Of the network, s and bit/s. All messages of a round are in flight together and do not slow each other down.

    Raises
    ------
    InputError
        If the method is not for this formation.
    """
    chosen = METHODS[method]
    schedule = chosen.schedule(formation)
    count = schedule.count(chosen.doubles)
    seconds = len(schedule.rounds) * (latency + chosen.work.seconds(samples))
    for round_ in schedule.rounds:
        largest = max(chosen.doubles[kind] for kind, _, _ in round_.transfers)
        seconds += 64 * largest * samples / bandwidth
    return Cost(count.rounds, count.total, 8 * count.doubles * samples, seconds)
