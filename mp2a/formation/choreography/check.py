"""Find what is wrong with a scenario before robots drive it (thesis, chapter 6: check_scenario)."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.checks import positive
from mp2a.formation.choreography.collisions import close_pairs, stretches
from mp2a.formation.choreography.findings import Finding
from mp2a.formation.choreography.ideal import IdealRobots, Robots, ScenarioRun, run
from mp2a.formation.choreography.reading import read
from mp2a.formation.choreography.rules import broken_rules
from mp2a.formation.choreography.runner import Choreography, InstructionEvent
from mp2a.formation.constants import LONGEST_RUN, TICK, WAYPOINT_TOLERANCE
from mp2a.formation.robot_models import RobotModel

MARGIN = 0.1
"""m that are to stay free between two robots."""
_LASTING = 3.0
"""s from which on it is worth a word that a robot cannot keep up, or drives backwards."""


class CheckReport(NamedTuple):
    """What a check found, and the run it is from."""

    findings: list[Finding]
    """By place in the text, then by time."""
    events: list[InstructionEvent]
    run: ScenarioRun | None
    """None if the text has a serious mistake."""


def check(
    text: str,
    robots: RobotModel | Mapping[str, RobotModel],
    *,
    max_speed: float | None = None,
    margin: float = MARGIN,
    longest: float = LONGEST_RUN,
    tell: Callable[[float], None] | None = None,
    cast: Callable[[Choreography], Robots] = IdealRobots,
) -> CheckReport:
    """Find every mistake in a scenario: in its text, on paper, and in a run.

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
    tell
        Called with the time reached, s.
    cast
        Makes the robots that run the choreography.

    Returns
    -------
    CheckReport
        Its findings are empty if there is nothing to say.

    Raises
    ------
    InputError
        If an argument other than ``text`` is wrong.
    """
    positive("margin", margin, or_zero=True)
    scenario, findings = read(text)
    if scenario is None:
        return CheckReport(findings, [], None)
    dance = Choreography(scenario, robots, max_speed)
    findings += broken_rules(scenario, dance.fleet, dance.max_speed, margin)
    findings.sort(key=lambda finding: finding.line or 0)
    result = run(dance, longest, tell, cast(dance))
    seen = [*_collisions(dance, result, margin), *_too_slow(dance, result), *_backwards(dance, result)]
    findings += sorted(seen, key=lambda finding: finding.time or (0.0, 0.0))
    if not result.done:
        late = f"did not end within {longest:g} s, of which all were run"
        findings.append(Finding("time", late, time=(0.0, float(result.time[-1]))))
    return CheckReport(findings, dance.events, result)


def demo() -> str:
    """Return a commented scenario that explains every instruction."""
    return Path(__file__).with_name("demo.txt").read_text(encoding="utf-8")


def _collisions(dance: Choreography, result: ScenarioRun, margin: float) -> Iterator[Finding]:
    sizes = np.column_stack((dance.fleet.length, dance.fleet.width))
    for close in close_pairs(result.poses, sizes, margin):
        first, second = dance.robots[close.first], dance.robots[close.second]
        what = "collide" if close.overlap else f"come closer than {margin:g} m"
        x, y = result.poses[close.begin, [close.first, close.second], :2].mean(axis=0)
        yield Finding(
            "collision", f"{first} and {second} {what}{during(dance, close.first, result.time[close.begin])}",
            time=(float(result.time[close.begin]), float(result.time[close.end])),
            robots=(first, second), place=(float(x), float(y)),
        )  # fmt: skip


def _too_slow(dance: Choreography, result: ScenarioRun) -> Iterator[Finding]:
    behind = (np.abs(result.raw_commands[..., 0]) > dance.fleet.max_speed) & (result.gap_errors > WAYPOINT_TOLERANCE)
    for i, begin, end in _lasting(behind):
        when = slice(begin, end + 1)
        needed, most = np.abs(result.raw_commands[when, i, 0]).max(), result.gap_errors[when, i].max()
        message = (
            f"{dance.robots[i]} falls {most:.2f} m behind: it would have to drive up to {needed:.2f} m/s, "
            f"has {dance.fleet.max_speed[i]:g}{during(dance, i, result.time[begin])}"
        )
        # Serious if it has not caught up by the time its leader ends.
        last = max((event.time for event in dance.events if event.robot == dance.robots[i]), default=np.inf)
        yield _seen("speed", message, bool(result.time[end] >= last - 1e-9), dance, result, i, begin, end)


def _backwards(dance: Choreography, result: ScenarioRun) -> Iterator[Finding]:
    for i, begin, end in _lasting(result.twists[..., 0] < 0):
        message = f"{dance.robots[i]} has turned round and drives backwards{during(dance, i, result.time[begin])}"
        yield _seen("backwards", message, False, dance, result, i, begin, end)


def _seen(
    kind: str, message: str, serious: bool, dance: Choreography, result: ScenarioRun, i: int, begin: int, end: int
) -> Finding:
    x, y, _ = result.poses[begin, i]
    when = float(result.time[begin]), float(result.time[end])
    return Finding(kind, message, serious, time=when, robots=(dance.robots[i],), place=(float(x), float(y)))


def _lasting(what: NDArray[np.bool_]) -> Iterator[tuple[int, int, int]]:
    """Return the robot, the first and the last tick of what lasts."""
    for i, column in enumerate(what.T):
        for ticks in stretches(np.flatnonzero(column), 1):
            if len(ticks) * TICK >= _LASTING:
                yield i, int(ticks[0]), int(ticks[-1])


def during(dance: Choreography, robot: int, time: float) -> str:
    """Name the instruction a robot is at."""
    began = [e for e in dance.events if e.robot == dance.robots[robot] and e.what == "began" and e.time <= time + 1e-9]
    return f" (line {began[-1].instruction.line})" if began else ""
