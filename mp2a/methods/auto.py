"""Which method to take, from the size of its messages and what the network and the robots' arithmetic cost."""

from contextlib import suppress
from typing import NamedTuple

from mp2a.exceptions import InputError
from mp2a.methods import METHODS
from mp2a.methods.cost import cost
from mp2a.schedule import Formation

AUTO = "auto"


class Choice(NamedTuple):
    """A method, and why."""

    method: str
    seconds: dict[str, float]
    """What each method that can be taken is expected to need for a call."""
    latency: float
    """s, that it was chosen for."""
    bandwidth: float
    """bit/s, that it was chosen for."""

    def __str__(self) -> str:
        expected = ", ".join(f"{name} {1e3 * seconds:.3g} ms" for name, seconds in self.seconds.items())
        cost = f"latency {1e6 * self.latency:.3g} µs, {self.bandwidth / 1e6:.3g} Mbit/s"
        return f"{self.method} (expected: {expected}; at {cost})"


def choose(formation: Formation, samples: int, latency: float, bandwidth: float) -> Choice:
    """Choose the method that needs the least time for a call, as `mp2a.methods.cost` models it.

    Parameters
    ----------
    formation
        Number of robots of a chain, or the parents of a tree.
    samples
        T, samples in each message.
    latency, bandwidth
        Of the network, s and bit/s.
    """
    seconds = {}
    for name in METHODS:
        with suppress(InputError):  # not for this formation
            seconds[name] = cost(name, formation, samples, latency, bandwidth).seconds
    return Choice(min(seconds, key=lambda name: seconds[name]), seconds, latency, bandwidth)
