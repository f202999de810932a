"""What a network costs, as plain data."""

import re
from typing import NamedTuple

from mp2a.exceptions import InputError

_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}
_SPEEDS = {"bit": 1.0, "kbit": 1e3, "Mbit": 1e6, "Gbit": 1e9}


class EmulatedNetwork(NamedTuple):
    """A network to emulate: a message takes ``latency + bits / bandwidth``."""

    latency: float
    """s"""
    bandwidth: float
    """bit/s"""

    def seconds(self, doubles: int) -> float:
        """Time from sending to delivery of a message of this many doubles."""
        return self.latency + 64 * doubles / self.bandwidth

    def __str__(self) -> str:
        return f"{1e3 * self.latency:g} ms, {self.bandwidth / 1e6:g} Mbit/s"


def parse(text: str) -> EmulatedNetwork:
    """Read a network such as ``5ms,54Mbit``: latency in s, ms or us, bandwidth in bit, kbit, Mbit or Gbit a second.

    Raises
    ------
    InputError
        If it is not of that form.
    """
    found = re.fullmatch(r"\s*([\d.e-]+)\s*(s|ms|us|µs)\s*,\s*([\d.e+]+)\s*(bit|kbit|Mbit|Gbit)(/s)?\s*", text)
    try:
        latency, unit, bandwidth, size, _ = found.groups()  # type: ignore[union-attr]
        network = EmulatedNetwork(float(latency) * _TIMES[unit], float(bandwidth) * _SPEEDS[size])
    except (AttributeError, ValueError):
        network = EmulatedNetwork(-1.0, 0.0)
    if network.latency < 0 or network.bandwidth <= 0:
        raise InputError(f"network: got {text!r}, expected latency and bandwidth such as '5ms,54Mbit'")
    return network
