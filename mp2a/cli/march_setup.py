"""What ``mp2a march`` is to do, ready to begin: which robots stand where, and what drives them."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mp2a.exceptions import InputError

if TYPE_CHECKING:
    from mp2a.formation import Formation, Path
    from mp2a.formation.choreography.scenario import Scenario
    from mp2a.formation.exchange import Exchange
    from mp2a.formation.robot_models import RobotModel
    from mp2a.model import Model
    from mp2a.mpi import MPI
    from mp2a.simulator.dance import Dance
    from mp2a.simulator.marchers import Marchers
    from mp2a.spatial import Array

LONGEST = 3600.0
"""s of a choreography that are simulated at most."""
_SETTLING = 8.0
"""s after the leader has stopped in which the last ones close up and come back to the path."""


class Danced(NamedTuple):
    """A choreography."""

    models: "tuple[RobotModel, ...]"
    """Of n robots."""
    poses: "Array"
    """``(n, 3)``: where they stand."""
    until: float
    """s it may take."""
    scenario: "Scenario"
    max_speed: float
    method: str

    @contextmanager
    def robots(self, comm: "MPI.Intracomm | None") -> "Iterator[Dance]":
        """Tie the robots here to the others by the scan, which tells them where their leaders are."""
        from mp2a.formation.choreography.runner import Choreography
        from mp2a.formation.choreography.leader_broadcast import planar_chain
        from mp2a.simulator.dance import Dance

        models = dict(zip(self.scenario.robots, self.models, strict=True))
        with _exchange(comm, planar_chain(len(models)), self.method) as exchange:
            dance = Choreography(self.scenario, models, self.max_speed, self.poses, exchange)
            yield Dance(dance, exchange.robots)


class Marched(NamedTuple):
    """A march by dynamics."""

    models: "tuple[RobotModel, ...]"
    poses: "Array"
    until: float
    formation: "Formation"
    path: "Path | None"
    method: str

    @contextmanager
    def robots(self, comm: "MPI.Intracomm | None") -> "Iterator[Marchers]":
        """Tie the robots here to the others by the scan."""
        from mp2a.formation.controller import FormationController
        from mp2a.simulator.marchers import Marchers

        with _exchange(comm, self.formation.model, self.method) as exchange:
            yield Marchers(FormationController(self.formation, self.path, exchange), self.models[0])


Plan = Danced | Marched


@contextmanager
def _exchange(comm: "MPI.Intracomm | None", model: "Model", method: str) -> "Iterator[Exchange]":
    """All robots here, or one a rank."""
    if comm is None:
        from mp2a.formation.exchange import LocalExchange

        yield LocalExchange(model, method)
        return
    from mp2a.distributed import DistributedModel
    from mp2a.formation.exchange import MPIExchange

    with DistributedModel(comm, model, method) as ranks:
        yield MPIExchange(ranks)


def danced(options: argparse.Namespace) -> Danced:
    """Read a choreography and put its robots in place; on one rank, since it takes a parser."""
    from mp2a.cli.check import read, robots
    from mp2a.formation.choreography.places import compose
    from mp2a.formation.choreography.reading import parse
    from mp2a.formation.choreography.runner import Choreography, models

    scenario = parse(read(options.file))
    given = models(scenario, robots(options.robots))
    dance = Choreography(scenario, dict(zip(scenario.robots, given, strict=True)), options.max_speed)
    x, y, degrees = options.start
    poses = compose(np.array([x, y, np.deg2rad(degrees)]), dance.places())
    return Danced(given, poses, options.seconds or LONGEST, scenario, dance.max_speed, options.method)


def marched(options: argparse.Namespace, ranks: int | None) -> Marched:
    """Lay out a march by dynamics; its path is for the leader's process alone."""
    from mp2a.cli.check import robots
    from mp2a.formation import Formation, Limits, spline, waypoints
    from mp2a.formation.constants import LEADER_SPEED_SHARE
    from mp2a.formation.robot_models import RobotModel

    model = robots(options.robots)
    if not isinstance(model, RobotModel):
        raise InputError(f"--robots: got {options.robots!r}, expected one model for all in a march by dynamics")
    if ranks is not None and options.n not in (None, ranks):
        raise InputError(f"--n: got {options.n} on {ranks} ranks, expected as many or none")
    formation = Formation.of(options.shape, options.n or ranks or 8, options.spacing)
    speed = LEADER_SPEED_SHARE * model.max_speed if options.speed is None else options.speed
    if speed > model.max_speed:
        raise InputError(f"--speed: got {speed}, expected at most {model.max_speed} m/s of a {model.name}")
    limits = Limits(speed=speed, acceleration=min(Limits().acceleration, model.max_acceleration))
    path = spline(options.path, limits) if options.spline else waypoints(options.path, options.radius, limits)
    poses = formation.layout.poses(path.at(0.0).pose)
    seconds = options.seconds or path.duration + _SETTLING + 0.1 * len(formation)
    return Marched((model,) * len(formation), poses, seconds, formation, path, options.method)
