"""Find what is wrong with a scenario before robots drive it (thesis, chapter 6: check_scenario).

The run that is part of it is one of ideal robots, or one in the 2-D simulator: real rectangles among walls, wheels that
slip, LIDAR data that are late.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.checks import positive
from mp2a.exceptions import InputError
from mp2a.formation.choreography.findings import Finding
from mp2a.formation.choreography.reading import read
from mp2a.formation.choreography.rules import broken_rules
from mp2a.formation.choreography.runner import Choreography, InstructionEvent
from mp2a.formation.constants import LONGEST_RUN, TICK, WAYPOINT_TOLERANCE
from mp2a.formation.robot_models import RobotModel
from mp2a.simulator.clearance import close_pairs, stretches, wall_gaps
from mp2a.simulator.events import EventKind
from mp2a.simulator.ideal import IdealSimulation
from mp2a.simulator.scenario_run import ScenarioRun, run
from mp2a.simulator.simulation import Simulation
from mp2a.simulator.vehicle import TurnSlip
from mp2a.simulator.world import World

MARGIN = 0.1
"""m that are to stay free between two robots."""
_LASTING = 3.0
"""s from which on it is worth a word that a robot cannot keep up, or drives backwards."""
_MET = 1.0
"""s around the time in which two robots are too close in which they touch."""
_KINDS = {
    EventKind.COLLISION: ("collision", True), EventKind.ERROR_STATE: ("failure", True), EventKind.STOP: ("stop", False),
}  # fmt: skip
"""Kinds of events that are findings: of which kind, and whether they are serious."""


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
    world: World | None = None,
    *,
    max_speed: float | None = None,
    margin: float = MARGIN,
    longest: float = LONGEST_RUN,
    slip: TurnSlip | None = None,
    quiet: bool = True,
) -> CheckReport:
    """Find every mistake in a scenario: in its text, on paper, and in a run.

    Parameters
    ----------
    text
        The scenario; its virtual leader begins at the origin and heads along x.
    robots
        A model for all roles, or a model a role.
    world
        Walls and obstacles among which it is simulated; None: it is run with ideal robots.
    max_speed
        v_max, m/s; None: that of the slowest robot.
    margin
        What is to stay free around the bodies of robots, m.
    longest
        Run no longer than this, s.
    slip
        Of turning wheels, in a world.
    quiet
        Show no bar on a terminal.

    Returns
    -------
    CheckReport
        Its findings are empty if there is nothing to say.

    Raises
    ------
    InputError
        If an argument other than ``text`` is wrong, or a robot touches another or a wall from the start.
    """
    positive("margin", margin, or_zero=True)
    if not isinstance(world, World | None):
        raise InputError(f"world: got {type(world).__name__}, expected a World or None")
    scenario, findings = read(text)
    if scenario is None:
        return CheckReport(findings, [], None)
    dance = Choreography(scenario, robots, max_speed)
    findings += broken_rules(scenario, dance.fleet, dance.max_speed, margin)
    findings.sort(key=lambda finding: finding.line or 0)
    simulation = (
        IdealSimulation(dance.models, dance.slot_poses())
        if world is None
        else Simulation(world, dance.models, dance.slot_poses(), slip=slip)
    )
    result = run(dance, longest, simulation, quiet=quiet)
    seen = [
        *_close(dance, result, margin), *_too_slow(dance, result), *_backwards(dance, result), *_events(dance, result),
        *_near_walls(dance, result, world or World(), margin),
    ]  # fmt: skip
    findings += sorted(seen, key=lambda finding: finding.time or (0.0, 0.0))
    if not result.done:
        late = f"did not end within {longest:g} s, of which all were run"
        findings.append(Finding("time", late, time=(0.0, float(result.time[-1]))))
    return CheckReport(findings, dance.events, result)


def demo() -> str:
    """Return a commented scenario that explains every instruction."""
    return Path(__file__).with_name("demo.txt").read_text(encoding="utf-8")


def _close(dance: Choreography, result: ScenarioRun, margin: float) -> Iterator[Finding]:
    """Find who comes too close to whom; of those that touch in a simulation, the contact says it all."""
    met = [event for event in result.events if event.kind is EventKind.COLLISION]
    for close in close_pairs(result.poses, dance.fleet.sizes, margin):
        pair, (begin, end) = (close.first, close.second), result.time[[close.begin, close.end]]
        if any({e.robot, e.other} == set(pair) and begin - _MET <= e.time <= end + _MET for e in met):
            continue
        what = "collide" if close.gap == 0 else f"come closer than {margin:g} m"
        message = f"{dance.robots[close.first]} and {dance.robots[close.second]} {what}"
        yield _seen(dance, result, "collision", message, pair, close.begin, close.end)


def _near_walls(dance: Choreography, result: ScenarioRun, world: World, margin: float) -> Iterator[Finding]:
    for i, robot in enumerate(dance.robots):
        gaps = wall_gaps(result.poses[:, i], dance.fleet.sizes[i], world)
        for ticks in stretches(np.flatnonzero(gaps < margin)):
            message = f"{robot} comes within {gaps[ticks].min():.2f} m of a wall or an obstacle"
            yield _seen(dance, result, "collision", message, (i,), ticks[0], ticks[-1])


def _too_slow(dance: Choreography, result: ScenarioRun) -> Iterator[Finding]:
    behind = (np.abs(result.raw_commands[..., 0]) > dance.fleet.max_speed) & (result.gap_errors > WAYPOINT_TOLERANCE)
    for i, begin, end in _lasting(behind):
        when = slice(begin, end + 1)
        needed, most = np.abs(result.raw_commands[when, i, 0]).max(), result.gap_errors[when, i].max()
        message = (
            f"{dance.robots[i]} falls {most:.2f} m behind: it would have to drive up to {needed:.2f} m/s, "
            f"has {dance.fleet.max_speed[i]:g}"
        )
        # Serious if it has not caught up by the time its leader ends.
        last = max((event.time for event in dance.events if event.robot == dance.robots[i]), default=np.inf)
        yield _seen(dance, result, "speed", message, (i,), begin, end, serious=bool(result.time[end] >= last - 1e-9))


def _backwards(dance: Choreography, result: ScenarioRun) -> Iterator[Finding]:
    for i, begin, end in _lasting(result.twists[..., 0] < 0):
        message = f"{dance.robots[i]} has turned round and drives backwards"
        yield _seen(dance, result, "backwards", message, (i,), begin, end, serious=False)


def _events(dance: Choreography, result: ScenarioRun) -> Iterator[Finding]:
    """Find who drives into what, error states, and stop signals."""
    for event in result.events:
        if event.kind in _KINDS:
            kind, serious = _KINDS[event.kind]
            message = event.text(dance.robots) + _during(dance, event.robot, event.time)
            robots = tuple(dance.robots[i] for i in (event.robot, event.other) if i is not None)
            yield Finding(kind, message, serious, time=(event.time, event.time), robots=robots, place=event.place)


def _lasting(what: NDArray[np.bool_]) -> Iterator[tuple[int, int, int]]:
    """Return the robot, the first and the last tick of what lasts."""
    for i, column in enumerate(what.T):
        for ticks in stretches(np.flatnonzero(column), 1):
            if len(ticks) * TICK >= _LASTING:
                yield i, int(ticks[0]), int(ticks[-1])


def _seen(
    dance: Choreography, result: ScenarioRun, kind: str, message: str, robots: tuple[int, ...], begin: int, end: int,
    *, serious: bool = True,
) -> Finding:  # fmt: skip
    """Return a finding of robots from one tick of a run to another."""
    x, y = result.poses[begin, list(robots), :2].mean(axis=0).tolist()
    when = float(result.time[begin]), float(result.time[end])
    names = tuple(dance.robots[i] for i in robots)
    return Finding(kind, message + _during(dance, robots[0], when[0]), serious, time=when, robots=names, place=(x, y))


def _during(dance: Choreography, robot: int, time: float) -> str:
    """Name the instruction a robot is at."""
    began = [e for e in dance.events if e.robot == dance.robots[robot] and e.what == "began" and e.time <= time + 1e-9]
    return f" (line {began[-1].instruction.line})" if began else ""
