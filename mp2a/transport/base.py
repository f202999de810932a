"""What every transport between ranks offers: the messages of one rank in a round."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from mp2a.schedule import Round
from mp2a.spatial import Array


class Parcel(NamedTuple):
    """A message with its numbers."""

    kind: str
    partner: int
    data: Array
    """``(1, T numbers)``, contiguous: what is sent, or where it goes that comes."""


class Transport(Protocol):
    """Messages of one rank, in the rounds of a schedule.

    Attributes
    ----------
    valid
        Whether this rank's data are still worth something. Once they are not, it sends empty messages only.
    """

    valid: bool

    def begin(self, tag: int, *, valid: bool) -> None:
        """Start a call whose messages carry a tag, with valid input or not."""
        ...

    def exchange(self, round_: Round, sends: Sequence[Parcel], receives: Sequence[Parcel]) -> None:
        """Send and receive the messages of a round; waits for what it receives.

        What was sent may be overwritten once the *next* exchange has returned: a robot does not wait here for its
        receiver.
        """
        ...

    def flush(self) -> None:
        """Wait until everything sent may be overwritten."""
        ...
