"""Robots find each other and agree when to start (thesis, chapter 3 and section 4.2).

Every robot publishes ``test ROLE`` ten times a second. Who hears it adds its own role and publishes it again; who hears
its own test with another role at the end knows that the way there and back works. Once it has heard back from
everybody, a robot proposes a time, four seconds ahead, as ``sync ROLE TIME``, and repeats it until the start. When it
has heard a proposal of everybody, the latest one holds.

In the thesis the proposal that comes last holds and each message proposes anew, so that lost or overtaking messages
make robots disagree. Here a robot proposes once, and the greatest proposal holds, in whatever order they come. If all
messages of one robot are lost for all four seconds, some start without it: nothing helps against that, and it says so.

With each test a robot also publishes ``terms ROLE JSON``: what it drives by (`mp2a.robots.terms`). Nobody proposes a
time before it has heard everybody's terms, and whose terms differ are refused.

A pure state machine: messages in, messages out, time given.
"""

import json
import math
from collections.abc import Sequence

from mp2a.exceptions import DependencyError, InputError
from mp2a.robots.terms import Terms, check_terms

LEAD = 4.0
"""s from a proposal to the start it proposes (section 4.2)."""
PERIOD = 0.1
"""s between two messages (chapter 3)."""
CLOCK_TOLERANCE = 0.5
"""s by which another's clock may be ahead before it is refused; ours."""
PATIENCE = 60.0
"""s without the start being agreed on after which a robot gives up; ours."""


class Start:
    """One robot's part of the agreement.

    Parameters
    ----------
    role
        Its own.
    roles
        All of the scenario.
    terms
        What it drives by; the others must drive by the same.
    lead
        s from its proposal to the start it proposes.

    Attributes
    ----------
    time : float or None
        When to start, by the clock that all robots share, s; None until agreed on.

    Raises
    ------
    InputError
        If its role is not among the roles, or a role has a blank in it.
    """

    def __init__(self, role: str, roles: Sequence[str], terms: Terms, lead: float = LEAD) -> None:
        if role not in roles or any(len(name.split()) != 1 for name in roles):
            raise InputError(f"role: got {role!r} of {list(roles)}, expected one of these, without blanks")
        self.role = role
        self._roles = tuple(roles)
        self._untested = set(roles) - {role}
        self._unknown = set(roles) - {role}  # whose terms have not come
        self._terms = terms
        self._lead = lead
        self._proposals: dict[str, float] = {}
        self.time: float | None = None

    @property
    def all_ready(self) -> bool:
        """Whether everybody has answered the test, and drives by the same."""
        return not self._untested and not self._unknown

    def say(self, now: float) -> list[str]:
        """Messages to publish now, ten times a second until the start."""
        out = [f"test {self.role}", self.introduction()]
        if self.all_ready:
            self._take(self.role, self._proposals.get(self.role, now + self._lead), now)
            out.append(f"sync {self.role} {self._proposals[self.role]!r}")
        return out

    def introduction(self) -> str:
        """Return the message with the robot's own terms."""
        return f"terms {self.role} {json.dumps(self._terms)}"

    def hear(self, message: str, now: float) -> list[str]:
        """Take in a message that came over the channel, one's own included; returns answers to publish at once.

        Raises
        ------
        InputError
            If another drives by other terms.
        DependencyError
            If another's clock is ahead, or the agreed time is over when it becomes known.
        """
        match message.split(maxsplit=2):
            case ["test", sender] if sender in self._roles and sender != self.role:
                return [f"test {sender} {self.role}"]
            case ["test", self.role, other]:
                self._untested.discard(other)
            case ["terms", sender, text] if sender in self._unknown:
                check_terms(self.role, self._terms, sender, _table(text))
                self._unknown.discard(sender)
            case ["sync", sender, time] if sender in self._roles and sender != self.role:
                proposal = _seconds(time)
                if math.isfinite(proposal):
                    self._take(sender, proposal, now)
        return []

    def check(self, waited: float) -> None:
        """Raise DependencyError if ``waited`` s were too long; says who is missing."""
        if waited > PATIENCE and self.time is None:
            silent = sorted(self._untested | self._unknown or set(self._roles) - set(self._proposals))
            raise DependencyError(
                f"{self.role} waited {PATIENCE:g} s for {', '.join(silent)}; are all robots on, and reachable?"
            )

    def _take(self, sender: str, time: float, now: float) -> None:
        if not time <= now + self._lead + CLOCK_TOLERANCE:
            ahead = time - now - self._lead
            raise DependencyError(
                f"the clock of {sender} is {ahead:.1f} s ahead of that of {self.role}; set both by NTP"
            )
        known = self._proposals.get(sender)
        self._proposals[sender] = time if known is None else max(known, time)
        if len(self._proposals) < len(self._roles):
            return
        agreed = max(self._proposals.values())
        if self.time is None and agreed < now:
            raise DependencyError(
                f"{self.role} learned {now - agreed:.1f} s too late when to start; start all robots again"
            )
        self.time = agreed


def _seconds(text: str) -> float:
    """Read a time; not a number if it is none, since anybody may publish on the topic."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _table(text: str) -> Terms:
    """Read terms; what is not a table of texts has no terms."""
    try:
        value = json.loads(text)
    except ValueError:
        value = None
    return value if isinstance(value, dict) else {}
