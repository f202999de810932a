"""How a run of robots ended: who arrived, who did not and why, who touched whom; simulated robots and real ones."""

from collections.abc import Iterable
from typing import NamedTuple

ARRIVAL_TOLERANCE = 0.5
"""m from its place up to which a robot has arrived. A robot takes points of its path 0.3 m away as reached (thesis,
7.2.2) and nobody reverses to its place, so it may stand as far beside it, and a braking distance beyond it."""
FAILED = 3
"""Exit status of a run in which a robot did not arrive or touched something."""


class Outcome(NamedTuple):
    """The end of a run for one robot."""

    role: str
    """Its name."""
    arrived: bool
    """Whether it stands at its place, with the whole scenario or path behind it, and not in its error state."""
    distance: float
    """m from its place; nan where that is not known."""
    reason: str = ""
    """Why it has not arrived; empty if it has."""
    touched: tuple[str, ...] = ()
    """What it drove into, or what drove into it: roles of robots, or "a wall or an obstacle"."""

    @property
    def good(self) -> bool:
        """Whether the robot arrived without touching anything."""
        return self.arrived and not self.touched

    def __str__(self) -> str:
        where = "" if self.distance != self.distance else f"{self.distance:.2f} m from its place"
        text = ", ".join(part for part in ("arrived" if self.arrived else "did not arrive", where) if part)
        text += f": {self.reason}" if self.reason else ""
        return f"{self.role} {text}" + (f"; touched {', '.join(self.touched)}" if self.touched else "")


def outcome(
    role: str,
    distance: float,
    *,
    over: bool,
    error: str = "",
    blocked: str = "",
    touched: Iterable[str] = (),
) -> Outcome:
    """Judge how a run ended for one robot.

    Parameters
    ----------
    role
        Its name.
    distance
        m from its place; nan where that is not known, as for a robot whose pose is lost.
    over
        Whether the scenario or the leader's path has come to its end for it.
    error
        What brought it into its error state; empty if it is not in it.
    blocked
        What is in its way; empty if nothing is.
    touched
        What it drove into or was driven into by, each once.

    Returns
    -------
    Outcome
        Arrived if the scenario is over, the robot is not in its error state, and stands within `ARRIVAL_TOLERANCE` of
        its place.
    """
    if error:
        reason = f"in its error state, {error}"
    elif not over:
        reason = "time was up" + (f", blocked by {blocked}" if blocked else "")
    elif distance <= ARRIVAL_TOLERANCE:
        reason = ""
    elif blocked:
        reason = f"blocked by {blocked}"
    else:
        reason = "nothing was in its way" if distance > ARRIVAL_TOLERANCE else "its pose is not known"
    return Outcome(role, not reason, distance, reason, tuple(touched))


def exit_status(outcomes: Iterable[Outcome]) -> int:
    """Return the exit status of a run: 0 if all robots arrived and touched nothing, `FAILED` otherwise."""
    return 0 if all(each.good for each in outcomes) else FAILED
