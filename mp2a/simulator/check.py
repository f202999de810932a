"""Check a scenario in the 2-D simulator: real rectangles among walls, wheels that slip, LIDAR data that are late."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from mp2a.exceptions import InputError
from mp2a.formation.choreography import check
from mp2a.formation.choreography.collisions import stretches
from mp2a.formation.choreography.findings import Finding
from mp2a.formation.choreography.fleet import models
from mp2a.formation.choreography.ideal import ScenarioRun
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.constants import LONGEST_RUN, TICK
from mp2a.formation.robot_models import RobotModel
from mp2a.simulator.choreography_driver import ChoreographySimulationDriver
from mp2a.simulator.events import EventKind
from mp2a.simulator.simulation import Simulation
from mp2a.simulator.vehicle import TurnSlip
from mp2a.simulator.world import World, geometry, rectangles
from mp2a.spatial import Array

_KINDS = {EventKind.ERROR_STATE: ("failure", True), EventKind.STOP: ("stop", False)}
"""Kinds of events that are findings: of which kind, and whether they are serious."""


def report_simulated(
    text: str,
    robots: RobotModel | Mapping[str, RobotModel],
    world: World,
    *,
    max_speed: float | None = None,
    margin: float = check.MARGIN,
    longest: float = LONGEST_RUN,
    slip: TurnSlip | None = None,
    tell: Callable[[float], None] | None = None,
) -> check.CheckReport:
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
    CheckReport
        Collisions with robots and walls and what stops robots, besides what a check with ideal robots looks for.

    Raises
    ------
    InputError
        If an argument other than ``text`` is wrong, or a robot touches another or a wall from the start.
    """
    casts: list[_SimulatedRobots] = []

    def cast(dance: Choreography) -> _SimulatedRobots:
        simulation = Simulation(world, models(dance.scenario, robots), dance.slot_poses(), slip=slip)
        casts.append(_SimulatedRobots(simulation, dance))
        return casts[0]

    if not isinstance(world, World):
        raise InputError(f"world: got {type(world).__name__}, expected a World")
    result = check.check(text, robots, max_speed=max_speed, margin=margin, longest=longest, tell=tell, cast=cast)
    if result.run is None:
        return result
    whole = _SimulatedRun(casts[0], result.run)
    contacts = [*whole.collisions(), *whole.walls(margin)]
    others = [finding for finding in result.findings if not _is_covered(finding, contacts)]
    paper = [finding for finding in others if finding.time is None]
    timed = [*(finding for finding in others if finding.time is not None), *contacts, *whole.stops()]
    return result._replace(findings=[*paper, *sorted(timed, key=lambda finding: finding.time or (0.0, 0.0))])


class _SimulatedRobots:
    """Simulated robots that run a choreography."""

    def __init__(self, simulation: Simulation, choreography: Choreography) -> None:
        self.simulation, self.driver = simulation, ChoreographySimulationDriver(choreography)

    @property
    def done(self) -> bool:
        """Whether they have come to the end and stand."""
        return self.driver.done

    def decide(self) -> tuple[float, Array, Array, Array]:
        """Step the choreography; returns time, poses, twists and commands."""
        sensed = self.simulation.sense()
        return sensed.time, sensed.poses, sensed.twists, self.driver.step(sensed)

    def move(self, commands: Array) -> None:
        """Drive for a tick."""
        self.simulation.step(commands, TICK)


class _SimulatedRun:
    """What a simulated run shows."""

    def __init__(self, robots: _SimulatedRobots, run: ScenarioRun) -> None:
        self._simulation, self._driver, self._dance, self.run = (
            robots.simulation, robots.driver, robots.driver.choreography, run
        )  # fmt: skip

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
            for ticks in stretches(np.flatnonzero(gaps < margin)):
                begin, end = ticks[[0, -1]]
                x, y = poses[begin, i, :2]
                message = (
                    f"{robot} comes within {max(gaps[ticks].min(), 0):.2f} m of a wall or an obstacle"
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
