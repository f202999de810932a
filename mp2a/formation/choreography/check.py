"""Find what is wrong with a scenario before robots drive it (thesis, chapter 6: check_scenario)."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.exceptions import InputError
from mp2a.formation.choreography.collisions import close_pairs
from mp2a.formation.choreography.constants import TICK, WAYPOINT_TOLERANCE
from mp2a.formation.choreography.findings import Finding
from mp2a.formation.choreography.ideal import Run, run
from mp2a.formation.choreography.reading import read
from mp2a.formation.choreography.rules import broken_rules
from mp2a.formation.choreography.runner import Choreography, Event
from mp2a.formation.robot_models import RobotModel

MARGIN = 0.1
"""m that are to stay free between two robots."""
LONGEST = 3600.0
"""s of a scenario that are run at most."""
_LASTING = 3.0
"""s from which on it is worth a word that a robot cannot keep up, or drives backwards."""
_TOGETHER = 1.0
"""s between two times of one finding that count as one."""


class Report(NamedTuple):
    """What a check found, and the run it is from."""

    findings: list[Finding]
    events: list[Event]
    run: Run | None
    """None if the text has a serious mistake."""


def check(
    text: str,
    robots: RobotModel | Mapping[str, RobotModel],
    *,
    max_speed: float | None = None,
    margin: float = MARGIN,
    longest: float = LONGEST,
) -> list[Finding]:
    """Find every mistake in a scenario: in its text, on paper, and in a run with ideal robots.

    Parameters
    ----------
    text
        The scenario.
    robots
        A model for all roles, or a model a role.
    max_speed
        v_max, m/s; None: that of the slowest robot.
    margin
        What is to stay free between the bodies of two robots, m.
    longest
        Run no longer than this, s.

    Returns
    -------
    list of Finding
        By place in the text, then by time; empty if there is nothing to say.

    Raises
    ------
    InputError
        If an argument other than ``text`` is wrong.
    """
    return report(text, robots, max_speed=max_speed, margin=margin, longest=longest).findings


def report(
    text: str,
    robots: RobotModel | Mapping[str, RobotModel],
    *,
    max_speed: float | None = None,
    margin: float = MARGIN,
    longest: float = LONGEST,
    tell: Callable[[float], None] | None = None,
) -> Report:
    """`check`, with the run and when each instruction began and ended; ``tell`` is called with the time reached."""
    if not 0 <= margin < np.inf:
        raise InputError(f"margin: got {margin}, expected a distance in m of at least 0")
    scenario, findings = read(text)
    if scenario is None:
        return Report(findings, [], None)
    dance = Choreography(scenario, robots, max_speed)
    findings += broken_rules(scenario, dance.fleet, dance.max_speed, margin)
    findings.sort(key=lambda finding: finding.line or 0)
    done = run(dance, longest, tell)
    seen = [*_collisions(dance, done, margin), *_too_slow(dance, done), *_backwards(dance, done)]
    findings += sorted(seen, key=lambda finding: finding.time or (0.0, 0.0))
    if not done.done:
        late = f"did not end within {longest:g} s, of which all were run"
        findings.append(Finding("time", late, time=(0.0, float(done.time[-1]))))
    return Report(findings, dance.events, done)


def demo() -> str:
    """Commented scenario that explains every instruction."""
    return Path(__file__).with_name("demo.txt").read_text(encoding="utf-8")


def _collisions(dance: Choreography, done: Run, margin: float) -> Iterator[Finding]:
    sizes = np.column_stack((dance.fleet.length, dance.fleet.width))
    for close in close_pairs(done.poses, sizes, margin, round(_TOGETHER / TICK)):
        first, second = dance.robots[close.first], dance.robots[close.second]
        what = "collide" if close.overlap else f"come closer than {margin:g} m"
        x, y = done.poses[close.begin, [close.first, close.second], :2].mean(axis=0)
        yield Finding(
            "collision", f"{first} and {second} {what}{_during(dance, close.first, done.time[close.begin])}",
            time=(float(done.time[close.begin]), float(done.time[close.end])),
            robots=(first, second), place=(float(x), float(y)),
        )  # fmt: skip


def _too_slow(dance: Choreography, done: Run) -> Iterator[Finding]:
    behind = (np.abs(done.asked[..., 0]) > dance.fleet.max_speed) & (done.excess > WAYPOINT_TOLERANCE)
    for i, begin, end in _lasting(behind):
        asked, most = np.abs(done.asked[begin : end + 1, i, 0]).max(), done.excess[begin : end + 1, i].max()
        message = (
            f"{dance.robots[i]} falls {most:.2f} m behind: it would have to drive up to {asked:.2f} m/s, "
            f"has {dance.fleet.max_speed[i]:g}{_during(dance, i, done.time[begin])}"
        )
        # Serious if it has not caught up by the time its leader ends.
        last = max((event.time for event in dance.events if event.robot == dance.robots[i]), default=np.inf)
        yield _seen("speed", message, bool(done.time[end] >= last - 1e-9), dance, done, i, begin, end)


def _backwards(dance: Choreography, done: Run) -> Iterator[Finding]:
    for i, begin, end in _lasting(done.twists[..., 0] < 0):
        message = f"{dance.robots[i]} has turned round and drives backwards{_during(dance, i, done.time[begin])}"
        yield _seen("backwards", message, False, dance, done, i, begin, end)


def _seen(
    kind: str, message: str, serious: bool, dance: Choreography, done: Run, i: int, begin: int, end: int
) -> Finding:
    x, y, _ = done.poses[begin, i]
    when = float(done.time[begin]), float(done.time[end])
    return Finding(kind, message, serious, time=when, robots=(dance.robots[i],), place=(float(x), float(y)))


def _lasting(what: NDArray[np.bool_]) -> Iterator[tuple[int, int, int]]:
    """Robot, first and last tick of what lasts."""
    for i in range(what.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate(([False], what[:, i], [False])).astype(int)))
        for begin, end in edges.reshape(-1, 2):
            if (end - begin) * TICK >= _LASTING:
                yield i, int(begin), int(end) - 1


def _during(dance: Choreography, robot: int, time: float) -> str:
    """Name the instruction a robot is at."""
    began = [e for e in dance.events if e.robot == dance.robots[robot] and e.what == "began" and e.time <= time + 1e-9]
    return f" (line {began[-1].instruction.line})" if began else ""
