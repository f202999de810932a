"""Robots of a scenario, made ready in the processes that drive them."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from mp2a.exceptions import InputError
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.choreography.scenario import Scenario
from mp2a.robots.adapters import ADAPTERS, EPOCH, Made, Order
from mp2a.robots.channel import MpiChannel, agree
from mp2a.robots.driver import Driver
from mp2a.robots.interface import Pace
from mp2a.robots.pace import Ticker
from mp2a.robots.planner import ChoreographyPlanner
from mp2a.robots.ready import wait_until_ready
from mp2a.robots.robots_file import RobotsFile
from mp2a.robots.start import Start

if TYPE_CHECKING:
    from mp2a.mpi import MPI


class Crew(NamedTuple):
    """Robots that are ready to drive."""

    drivers: list[Driver]
    """One for each robot of this process."""
    pace: Pace
    """Whose time 0 is the start."""
    epochs: Mapping[str, int]
    """ns by role: what records call time 0. The clock's reading where time is real."""
    report: Callable[[bool], list[str]]
    """Lines to print when all is over, told whether all came to the end."""


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
        if not ADAPTERS[adapter].alone:
            raise InputError(
                f"--role: got the adapter {adapter}, expected all its robots in one process or under mpirun"
            )
        return (role,)
    if comm is not None:
        if comm.size != len(roles):
            raise InputError(
                f"mpirun: got {comm.size} ranks, expected {len(roles)}, one for each of {', '.join(roles)}"
            )
        return (roles[comm.rank],)
    if ADAPTERS[adapter].real and len(roles) > 1:
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
) -> Crew:
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
    Crew
        A driver for each of ``roles``, and the clock.

    Raises
    ------
    InputError, DependencyError
        If the robots do not fit the scenario, or one cannot be reached.
    """
    adapter = ADAPTERS[found.adapter]
    rates = {found.interfaces[role].rate for role in scenario.robots}
    if not adapter.real and len(rates) > 1:
        raise InputError(f"rate: got {', '.join(f'{rate:g}' for rate in sorted(rates))} Hz, expected one for all here")
    models = {role: found.interfaces[role].model for role in scenario.robots}

    def dance() -> Choreography:
        return Choreography(scenario, models, max_speed)

    order = Order(scenario, found, roles, comm, armed, dance().slot_poses())
    made = adapter.make(order)
    in_place = adapter.own_frames and found.origin == "in-place"
    drivers = []
    for role, robot in zip(roles, made.robots, strict=True):
        interface = found.interfaces[role]
        planner = ChoreographyPlanner(dance(), role, robot.has_lidar, interface.points_age)
        drivers.append(Driver(role, robot, interface, planner, in_place))
    if made.pace is not None:
        epochs = made.epochs or [EPOCH] * len(roles)
        return Crew(drivers, made.pace, dict(zip(roles, epochs, strict=True)), made.report)
    pace = _start_together(order, made)
    return Crew(drivers, pace, {roles[0]: time.time_ns() - round(1e9 * pace.now())}, made.report)


def _start_together(order: Order, made: Made) -> Ticker:
    """Wait until the robot is there, agree with the others when to start, and return the clock."""
    [role], [robot] = order.roles, made.robots
    try:
        wait_until_ready(robot, role)
        assert made.channel is not None
        channel = made.channel() if order.comm is None else MpiChannel(order.comm)
        start = agree(Start(role, order.scenario.robots), channel)
    except BaseException:
        robot.close()
        raise
    return Ticker(order.period, time.monotonic() + start - time.time())
