"""Robots of a scenario, made ready in the processes that drive them."""

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mp2a.exceptions import InputError
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.choreography.scenario import Scenario
from mp2a.robots.channel import Channel, MpiChannel, agree
from mp2a.robots.driver import Driver
from mp2a.robots.dry import DryRobot, VirtualPace
from mp2a.robots.interface import Pace, Robot
from mp2a.robots.pace import Ticker
from mp2a.robots.planner import ChoreographyPlanner
from mp2a.robots.ready import wait_until_ready
from mp2a.robots.robots_file import RobotsFile
from mp2a.robots.start import Start
from mp2a.robots.table import RobotInterface

if TYPE_CHECKING:
    from mpi4py import MPI

REAL = ("ros1", "ros2")
"""Adapters whose time is real."""


def roles_of_this_process(
    scenario: Scenario, adapter: str, role: str | None, comm: "MPI.Comm | None"
) -> tuple[str, ...]:
    """Tell which robots this process drives: one a rank, or the named one, or (virtual robots only) all.

    Raises
    ------
    InputError
        If there is not a rank a robot, the role is unknown, or a real robot has not got its own process.
    """
    roles = scenario.robots
    if role is not None:
        if role not in roles:
            raise InputError(f"--role: got {role!r}, expected one of {', '.join(roles)}")
        if comm is not None:
            raise InputError(f"--role: got {role} under mpirun, expected no role there: every rank is a robot")
        if adapter == "simulator":
            raise InputError(
                "--role: got the adapter simulator, expected all its robots in one process or under mpirun"
            )
        return (role,)
    if comm is not None:
        if comm.size != len(roles):
            raise InputError(
                f"mpirun: got {comm.size} ranks, expected {len(roles)}, one for each of {', '.join(roles)}"
            )
        return (roles[comm.rank],)
    if adapter in REAL and len(roles) > 1:
        raise InputError(f"--role: got none, expected one of {', '.join(roles)}, or mpirun -n {len(roles)}")
    return roles


def build(
    scenario: Scenario,
    found: RobotsFile,
    roles: Sequence[str],
    comm: "MPI.Comm | None",
    *,
    armed: bool = False,
    max_speed: float | None = None,
) -> tuple[list[Driver], Pace]:
    """Make this process' robots ready, and agree with the others when to start.

    Parameters
    ----------
    scenario
        What is driven.
    found
        Robots and what is behind them.
    roles
        Of this process.
    comm
        With a rank a robot; None: the others, if any, are reached over ROS topics.
    armed
        Whether real robots get commands.
    max_speed
        v_max, m/s; None: that of the slowest robot.

    Returns
    -------
    drivers : list of Driver
        One for each of ``roles``.
    pace : Pace
        Whose time 0 is the start.

    Raises
    ------
    InputError, MissingError
        If the robots do not fit the scenario, or one cannot be reached.
    """
    rates = {found.interfaces[role].rate for role in scenario.robots}
    if found.adapter not in REAL and len(rates) > 1:
        raise InputError(f"rate: got {', '.join(f'{rate:g}' for rate in sorted(rates))} Hz, expected one for all here")
    models = {role: found.interfaces[role].model for role in scenario.robots}

    def dance() -> Choreography:
        return Choreography(scenario, models, max_speed)

    robots, pace = _robots(scenario, found, roles, comm, armed, dance().places())
    in_place = found.adapter in REAL and found.origin == "in-place"
    drivers = []
    for role, robot in zip(roles, robots, strict=True):
        planner = ChoreographyPlanner(dance(), role, robot.has_lidar)
        drivers.append(Driver(role, robot, found.interfaces[role], planner, in_place))
    if pace is not None:
        return drivers, pace
    role, interface = roles[0], found.interfaces[roles[0]]
    try:
        wait_until_ready(robots[0], role)
        start = agree(Start(role, scenario.robots), _channel(found.adapter, role, interface, comm))
    except BaseException:
        robots[0].close()
        raise
    return drivers, Ticker(1.0 / interface.rate, time.monotonic() + start - time.time())


def _robots(
    scenario: Scenario, found: RobotsFile, roles: Sequence[str], comm: "MPI.Comm | None", armed: bool,
    places: np.ndarray,
) -> tuple[Sequence[Robot], Pace | None]:  # fmt: skip
    """Make robots, and their clock if it is not the real one."""
    interfaces = found.interfaces
    own = [scenario.robots.index(role) for role in roles]
    period = 1.0 / interfaces[roles[0]].rate
    if found.adapter == "dry":
        dry = [DryRobot(interfaces[role].model, places[i]) for role, i in zip(roles, own, strict=True)]
        return dry, VirtualPace(period, dry)
    if found.adapter == "simulator":
        from mp2a.robots.simulated import SimulatedPace
        from mp2a.simulator import Simulation, World, read_world

        world = World() if found.world is None else read_world(found.world)
        simulation = Simulation(world, [interfaces[role].model for role in scenario.robots], places)
        simulated = SimulatedPace(simulation, period, own, comm)
        return simulated.robots, simulated
    role = roles[0]
    if found.adapter == "ros1":
        from mp2a.robots.ros1 import Ros1Robot

        return [Ros1Robot(role, interfaces[role], armed)], None
    from mp2a.robots.ros2 import Ros2Robot

    return [Ros2Robot(role, interfaces[role], armed)], None


def _channel(adapter: str, role: str, interface: RobotInterface, comm: "MPI.Comm | None") -> Channel:
    if comm is not None:
        return MpiChannel(comm)
    if adapter == "ros1":
        from mp2a.robots.ros1 import Ros1Channel

        return Ros1Channel(role, interface.ready_topic)
    from mp2a.robots.ros2 import Ros2Channel

    return Ros2Channel(interface.ready_topic)
