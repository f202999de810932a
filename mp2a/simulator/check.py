"""Check a scenario in the 2-D simulator: real rectangles among walls, wheels that slip, LIDAR data that are late."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from mp2a.exceptions import InputError
from mp2a.formation.choreography import check
from mp2a.formation.choreography.findings import Finding
from mp2a.formation.choreography.ideal import Run
from mp2a.formation.choreography.runner import Choreography, models
from mp2a.formation.robot_models import RobotModel
from mp2a.simulator.choreography_driver import ChoreographySimulationDriver
from mp2a.simulator.events import EventKind
from mp2a.simulator.simulation import Simulation
from mp2a.simulator.vehicle import TurnSlip
from mp2a.simulator.world import World, geometry, rectangles
from mp2a.spatial import Array

_TICK = 0.1
_TELL = 100  # ticks
_PAUSE = 10  # ticks between two times of one finding that count as one
_KINDS = {EventKind.ERROR_STATE: ("failure", True), EventKind.STOP: ("stop", False)}
"""Kinds of events that are findings: of which kind, and whether they are serious."""


def report_simulated(
    text: str,
    robots: RobotModel | Mapping[str, RobotModel],
    world: World,
    *,
    max_speed: float | None = None,
    margin: float = check.MARGIN,
    longest: float = check.LONGEST,
    slip: TurnSlip | None = None,
    tell: Callable[[float], None] | None = None,
) -> check.Report:
    """Find every mistake in a scenario: in its text, on paper, and in a simulated run.

    Parameters
    ----------
    text
        The scenario; its virtual leader begins at the origin and heads along x.
    robots
        A model for all roles, or a model a role.
    world
        Walls and obstacles.
    max_speed
        v_max, m/s; None: that of the slowest robot.
    margin
        What is to stay free around the robots, m.
    longest
        Run no longer than this, s.
    slip
        Of turning wheels.
    tell
        Called with the time reached, s.

    Returns
    -------
    Report
        Collisions with robots and walls and what stops robots, besides what a check with ideal robots looks for.

    Raises
    ------
    InputError
        If an argument other than ``text`` is wrong, or a robot touches another or a wall from the start.
    """
    runs: list[_SimulatedRun] = []

    def drive(dance: Choreography, longest: float, tell: Callable[[float], None] | None) -> Run:
        fleet = models(dance.scenario, robots)
        simulation = Simulation(world, fleet, dance.places(), slip=slip)
        driver = ChoreographySimulationDriver(dance)
        runs.append(_SimulatedRun(simulation, driver, _run(simulation, driver, longest, tell)))
        return runs[0].run

    if not isinstance(world, World):
        raise InputError(f"world: got {type(world).__name__}, expected a World")
    result = check.report(
        text, robots, max_speed=max_speed, margin=margin, longest=longest, tell=tell, drive=drive
    )  # fmt: skip
    if not runs:
        return result
    [whole] = runs
    contacts = [*whole.collisions(), *whole.walls(margin)]
    others = [finding for finding in result.findings if not _is_covered(finding, contacts)]
    paper = [finding for finding in others if finding.time is None]
    timed = [*(finding for finding in others if finding.time is not None), *contacts, *whole.stops()]
    return result._replace(findings=[*paper, *sorted(timed, key=lambda finding: finding.time or (0.0, 0.0))])


def _run(
    simulation: Simulation,
    driver: ChoreographySimulationDriver,
    longest: float,
    tell: Callable[[float], None] | None,
) -> Run:
    """Simulate to the end; the columns are those of a run with ideal robots."""
    dance, rows = driver.choreography, []
    for tick in range(int(longest / _TICK) + 1):
        sensed = simulation.sense()
        commands = driver.step(sensed)
        state, leaders = dance.state, dance.state.leaders
        rows.append((
            sensed.time, sensed.poses, sensed.twists, commands, state.asked, state.excess, leaders.pose, leaders.twist,
            leaders.place,
        ))  # fmt: skip
        if driver.done:
            break
        if tell is not None and tick % _TELL == 0:
            tell(sensed.time)
        simulation.step(commands, _TICK)
    return Run._make([*(np.array(column) for column in zip(*rows, strict=True)), driver.done])


class _SimulatedRun:
    """What a simulated run shows."""

    def __init__(self, simulation: Simulation, driver: ChoreographySimulationDriver, run: Run) -> None:
        self._simulation, self._driver, self._dance, self.run = simulation, driver, driver.choreography, run

    def collisions(self) -> Iterator[Finding]:
        """Find who drives into what."""
        for event in self._simulation.collisions:
            message = event.text(self._dance.robots) + check.during(self._dance, event.robot, event.time)
            names = tuple(self._dance.robots[i] for i in (event.robot, event.other) if i is not None)
            yield Finding("collision", message, time=(event.time, event.time), robots=names, place=event.place)

    def walls(self, margin: float) -> Iterator[Finding]:
        """Find who comes closer to walls and obstacles than the margin."""
        shapes = self._simulation.world.shapes
        if not len(shapes):
            return
        poses, times = self.run.poses, self.run.time
        shapely = geometry()
        everything = shapely.union_all(shapes)
        shapely.prepare(everything)
        for i, robot in enumerate(self._dance.robots):
            model = self._simulation.models[i]
            sizes = (np.full(len(poses), size) for size in (model.length, model.width))
            gaps = shapely.distance(shapely.polygons(rectangles(poses[:, i], *sizes)), everything)
            for begin, end in _stretches(gaps < margin):
                x, y = poses[begin, i, :2]
                message = (
                    f"{robot} comes within {max(gaps[begin : end + 1].min(), 0):.2f} m of a wall or an obstacle"
                    f"{check.during(self._dance, i, times[begin])}"
                )
                yield Finding(
                    "collision", message, time=(float(times[begin]), float(times[end])), robots=(robot,),
                    place=(float(x), float(y)),
                )  # fmt: skip

    def stops(self) -> Iterator[Finding]:
        """Find error states, which are serious, and stop signals."""
        for event in self._driver.events:
            if event.kind in _KINDS:
                kind, serious = _KINDS[event.kind]
                message = event.text(self._dance.robots) + check.during(self._dance, event.robot, event.time)
                robots, when = (self._dance.robots[event.robot],), (event.time, event.time)
                yield Finding(kind, message, serious, time=when, robots=robots, place=event.place)


def _is_covered(finding: Finding, contacts: list[Finding]) -> bool:
    """Return whether a collision says all that a finding of two robots that come too close does."""
    return finding.kind == "collision" and any(
        set(other.robots) == set(finding.robots)
        and finding.time is not None
        and other.time is not None
        and finding.time[0] - 1 <= other.time[0] <= finding.time[1] + 1
        for other in contacts
    )


def _stretches(what: Array) -> Iterator[tuple[int, int]]:
    """Return the first and last tick of what lasts, with short pauses left out."""
    ticks = np.flatnonzero(what)
    for part in np.split(ticks, np.flatnonzero(np.diff(ticks) > _PAUSE) + 1):
        if len(part):
            yield int(part[0]), int(part[-1])
