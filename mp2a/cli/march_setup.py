"""What ``mp2a march`` is to do, ready to begin: which robots stand where, and what drives them."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mp2a.cli.options import robot_models
from mp2a.exceptions import InputError
from mp2a.file_kinds import read_text

if TYPE_CHECKING:
    from mp2a.formation import Formation, Path
    from mp2a.formation.choreography.scenario import Scenario
    from mp2a.formation.exchange import Exchange
    from mp2a.formation.robot_models import RobotModel
    from mp2a.model import Model
    from mp2a.mpi import MPI
    from mp2a.simulator.driver import SimulationDriver
    from mp2a.spatial import Array

_MOST_SECONDS = 3600.0
"""s of a choreography that are simulated at most, unless more are asked for."""
_SETTLING = 8.0
"""s after the leader has stopped in which the last ones close up and come back to the path."""
_MOST_ROBOTS = 10_000


class ChoreographySetup(NamedTuple):
    """A choreography."""

    roles: tuple[str, ...]
    """Names of n robots."""
    models: "tuple[RobotModel, ...]"
    poses: "Array"
    """``(n, 3)``: where they stand."""
    until: float
    """s it may take."""
    scenario: "Scenario"
    max_speed: float
    method: str

    @contextmanager
    def driver(self, comm: "MPI.Intracomm | None") -> "Iterator[SimulationDriver]":
        """Tie the robots here to the others by the scan, which tells them where their leaders are."""
        from mp2a.formation.choreography.leader_broadcast import planar_chain
        from mp2a.formation.choreography.runner import Choreography
        from mp2a.simulator.choreography_driver import ChoreographySimulationDriver

        models = dict(zip(self.roles, self.models, strict=True))
        with _exchange(comm, planar_chain(len(models)), self.method) as exchange:
            choreography = Choreography(self.scenario, models, self.max_speed, self.poses, exchange)
            yield ChoreographySimulationDriver(choreography)


class FormationSetup(NamedTuple):
    """A march by dynamics."""

    roles: tuple[str, ...]
    models: "tuple[RobotModel, ...]"
    poses: "Array"
    until: float
    formation: "Formation"
    path: "Path | None"
    """None where it is not known: it is for the leader's process alone."""
    method: str

    @contextmanager
    def driver(self, comm: "MPI.Intracomm | None") -> "Iterator[SimulationDriver]":
        """Tie the robots here to the others by the scan."""
        from mp2a.formation.controller import FormationController
        from mp2a.simulator.formation_driver import FormationSimulationDriver

        with _exchange(comm, self.formation.model, self.method) as exchange:
            yield FormationSimulationDriver(FormationController(self.formation, self.path, exchange), self.models[0])


MarchSetup = ChoreographySetup | FormationSetup


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


def set_up_march(options: argparse.Namespace, ranks: int | None) -> MarchSetup:
    """Set a march up, in one process: it takes a parser, and the path is for the leader's process alone.

    Raises
    ------
    InputError
        If the options do not fit one another or the number of ranks (None: all robots are in this process).
    """
    setup = _choreography(options) if options.file else _by_dynamics(options, ranks)
    if ranks not in (None, len(setup.roles)):
        raise InputError(f"FILE: got {len(setup.roles)} robots for {ranks} ranks, expected one a rank")
    return setup


def _choreography(options: argparse.Namespace) -> ChoreographySetup:
    from mp2a.formation.choreography.reading import parse
    from mp2a.formation.choreography.runner import Choreography
    from mp2a.se2 import compose

    scenario = parse(read_text(options.file, "a scenario", "text"))
    choreography = Choreography(scenario, robot_models(options.robots), options.max_speed)
    x, y, degrees = options.start
    poses = compose(np.array([x, y, np.deg2rad(degrees)]), choreography.slot_poses())
    seconds = options.seconds or _MOST_SECONDS
    return ChoreographySetup(
        scenario.robots, choreography.models, poses, seconds, scenario, choreography.max_speed, options.method
    )  # fmt: skip


def _by_dynamics(options: argparse.Namespace, ranks: int | None) -> FormationSetup:
    from mp2a.formation import Formation, Limits, spline, waypoints
    from mp2a.formation.constants import LEADER_SPEED_SHARE
    from mp2a.formation.robot_models import RobotModel
    from mp2a.simulator.events import numbered

    model = robot_models(options.robots)
    if not isinstance(model, RobotModel):
        raise InputError(f"--robots: got {options.robots!r}, expected one model for all in a march by dynamics")
    if ranks is not None and options.n not in (None, ranks):
        raise InputError(f"--n: got {options.n} on {ranks} ranks, expected as many or none")
    n = options.n or ranks or 8
    if n > _MOST_ROBOTS:
        raise InputError(f"--n: got {n}, expected at most {_MOST_ROBOTS}")
    formation = Formation.of(options.shape, n, options.spacing)
    speed = LEADER_SPEED_SHARE * model.max_speed if options.speed is None else options.speed
    if speed > model.max_speed:
        raise InputError(f"--speed: got {speed}, expected at most {model.max_speed} m/s of a {model.name}")
    limits = Limits(speed=speed, acceleration=min(Limits().acceleration, model.max_acceleration))
    path = spline(options.path, limits) if options.spline else waypoints(options.path, options.radius, limits)
    poses = formation.layout.poses(path.at(0.0).pose)
    seconds = options.seconds or path.duration + _SETTLING + 0.1 * n
    return FormationSetup(numbered(n), (model,) * n, poses, seconds, formation, path, options.method)
