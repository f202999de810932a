"""Check a scenario in the 2-D simulator: real rectangles among walls, wheels that slip, LIDAR data that are late."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np
import shapely

from mp2a.exceptions import InputError
from mp2a.formation.choreography import check
from mp2a.formation.choreography.findings import Finding
from mp2a.formation.choreography.ideal import Run
from mp2a.formation.choreography.runner import Choreography, models
from mp2a.formation.robot_models import RobotModel
from mp2a.simulator.dance import Dance
from mp2a.simulator.drive import TurnSlip
from mp2a.simulator.observation import Event
from mp2a.simulator.simulation import Simulation
from mp2a.simulator.world import World, rectangles
from mp2a.spatial import Array

_TICK = 0.1
_TELL = 100  # ticks
_PAUSE = 10  # ticks between two times of one finding that count as one


def report(
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
    seen: list[_Seen] = []

    def drive(dance: Choreography, longest: float, tell: Callable[[float], None] | None) -> Run:
        fleet = models(dance.scenario, robots)
        simulation = Simulation(world, fleet, dance.places(), slip=slip)
        actors = Dance(dance)
        done = _run(simulation, actors, longest, tell)
        seen.append(_Seen(dance, simulation, actors.events, done))
        return done

    if not isinstance(world, World):
        raise InputError(f"world: got {type(world).__name__}, expected a World")
    found = check.report(
        text, robots, max_speed=max_speed, margin=margin, longest=longest, tell=tell, drive=drive
    )  # fmt: skip
    if not seen:
        return found
    [whole] = seen
    met = [*whole.collisions(), *whole.walls(margin)]
    near = [finding for finding in found.findings if not _told_by(finding, met)]
    paper = [finding for finding in near if finding.time is None]
    run = [*(finding for finding in near if finding.time is not None), *met, *whole.stops()]
    return found._replace(findings=[*paper, *sorted(run, key=lambda finding: finding.time or (0.0, 0.0))])


def _run(simulation: Simulation, actors: Dance, longest: float, tell: Callable[[float], None] | None) -> Run:
    """Simulate to the end; the columns are those of a run with ideal robots."""
    dance, rows = actors.choreography, []
    for tick in range(int(longest / _TICK) + 1):
        sensed = simulation.sense()
        commands = actors.step(sensed)
        state, leaders = dance.state, dance.state.leaders
        rows.append((
            sensed.time, sensed.poses, sensed.twists, commands, state.asked, state.excess, leaders.pose, leaders.twist,
            leaders.place,
        ))  # fmt: skip
        if actors.done:
            break
        if tell is not None and tick % _TELL == 0:
            tell(sensed.time)
        simulation.step(commands, _TICK)
    return Run._make([*(np.array(column) for column in zip(*rows, strict=True)), actors.done])


class _Seen:
    """What a simulated run shows."""

    def __init__(self, dance: Choreography, simulation: Simulation, events: list[Event], done: Run) -> None:
        self._dance, self._simulation, self._events, self._done = dance, simulation, events, done

    def collisions(self) -> Iterator[Finding]:
        for met in self._simulation.collisions:
            names = tuple(self._dance.robots[i] for i in (met.robot, met.other) if i is not None)
            what = "a wall or an obstacle" if met.other is None else names[1]
            when = check.during(self._dance, met.robot, met.time)
            message = f"{names[0]} drives into {what}{when}"
            yield Finding("collision", message, time=(met.time, met.time), robots=names, place=met.place)

    def walls(self, margin: float) -> Iterator[Finding]:
        """Who comes closer to walls and obstacles than the margin."""
        shapes = self._simulation.world.shapes
        if not len(shapes):
            return
        poses, times = self._done.poses, self._done.time
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
        """Error states, which are serious, and stop signals."""
        for event in self._events:
            for word, kind, serious in (("error state", "failure", True), ("stops", "stop", False)):
                if word in event.text:
                    name = self._dance.robots[event.robot]
                    said = event.text.replace(f"robot {event.robot + 1}", name)
                    message = f"{said}{check.during(self._dance, event.robot, event.time)}"
                    when = (event.time, event.time)
                    yield Finding(kind, message, serious, time=when, robots=(name,), place=event.place)


def _told_by(finding: Finding, met: list[Finding]) -> bool:
    """Whether a collision says all that a finding of two robots that come too close does."""
    return finding.kind == "collision" and any(
        set(other.robots) == set(finding.robots)
        and finding.time is not None
        and other.time is not None
        and finding.time[0] - 1 <= other.time[0] <= finding.time[1] + 1
        for other in met
    )


def _stretches(what: Array) -> Iterator[tuple[int, int]]:
    """First and last tick of what lasts, with short pauses left out."""
    ticks = np.flatnonzero(what)
    for part in np.split(ticks, np.flatnonzero(np.diff(ticks) > _PAUSE) + 1):
        if len(part):
            yield int(part[0]), int(part[-1])
