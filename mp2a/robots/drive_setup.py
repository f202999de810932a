"""Robots of a scenario, made ready in the processes that drive them."""

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mp2a.exceptions import DependencyError, InputError
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.choreography.scenario import Scenario
from mp2a.robots.adapters import ADAPTERS, EPOCH, AdapterConfig, AdapterResult
from mp2a.robots.channel import agree_on_start, agree_over_ranks
from mp2a.robots.clock import RealTimeClock
from mp2a.robots.driver import Driver
from mp2a.robots.interface import Clock, Robot
from mp2a.robots.planner import ChoreographyPlanner
from mp2a.robots.robots_file import RobotsFile
from mp2a.robots.start import Start
from mp2a.robots.terms import Terms, check_terms, terms_of

if TYPE_CHECKING:
    from mp2a.mpi import MPI

_THERE = 30.0
"""s for a robot's topics to tell where it is."""


class DriveSetup(NamedTuple):
    """Robots that are ready to drive."""

    drivers: list[Driver]
    """One for each robot of this process."""
    clock: Clock
    """Whose time 0 is the start."""
    epochs: Mapping[str, int]
    """ns by role: what records call time 0. The clock's reading where time is real."""
    adapter: AdapterResult
    """What is behind the robots."""


def roles_of_this_process(
    scenario: Scenario, adapter: str, role: str | None, comm: "MPI.Comm | None"
) -> tuple[str, ...]:
    """Return the robots that this process drives: one a rank, or the named one, or (virtual robots only) all.

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


def set_up_drive(
    scenario: Scenario,
    robots: RobotsFile,
    roles: Sequence[str],
    comm: "MPI.Comm | None",
    *,
    armed: bool = False,
    max_speed: float | None = None,
) -> DriveSetup:
    """Make this process' robots ready, and agree with the others when to start.

    Parameters
    ----------
    scenario
        What is driven.
    robots
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
    DriveSetup
        A driver for each of ``roles``, and the clock.

    Raises
    ------
    InputError, DependencyError
        If the robots do not fit the scenario, others drive by another one, or a robot cannot be reached.
    """
    adapter = ADAPTERS[robots.adapter]
    configs = robots.configs
    rates = sorted({config.rate for config in configs.values()})
    if not adapter.real and len(rates) > 1:
        raise InputError(f"rate: got {', '.join(f'{rate:g}' for rate in rates)} Hz, expected one for all here")
    models = {role: config.model for role, config in configs.items()}

    whole = Choreography(scenario, models, max_speed)
    terms = terms_of(scenario, models, whole.max_speed)
    if comm is not None:
        for role, others in zip(scenario.robots, comm.allgather(terms), strict=True):
            check_terms(roles[0], terms, role, others)
    config = AdapterConfig(robots, whole.slot_poses(), roles, comm, armed)
    result = adapter.make(config)
    in_place = adapter.own_frames and robots.origin == "in-place"
    drivers = []
    for role, robot in zip(roles, result.robots, strict=True):
        dance = Choreography(scenario, models, max_speed, here=[scenario.robots.index(role)])
        planner = ChoreographyPlanner(dance, robot.has_lidar, configs[role].points_age)
        drivers.append(Driver(role, robot, configs[role], planner, in_place))
    clock, epochs = result.clock, result.epochs or [EPOCH] * len(roles)
    if clock is None:
        clock = _start_together(config, result, terms)
        epochs = [time.time_ns() - round(1e9 * clock.now())]
    return DriveSetup(drivers, clock, dict(zip(roles, epochs, strict=True)), result)


def _start_together(config: AdapterConfig, result: AdapterResult, terms: Terms) -> RealTimeClock:
    """Wait until the robot is there, agree with the others when to start, and return the clock."""
    [role], [robot] = config.roles, result.robots
    try:
        _wait_until_there(robot, role)
        if config.comm is not None:
            start = agree_over_ranks(config.comm)
        else:
            assert result.channel is not None
            start = agree_on_start(Start(role, tuple(config.file.configs), terms), result.channel())
    except BaseException:
        robot.close()
        raise
    return RealTimeClock(config.period, time.monotonic() + start - time.time())


def _wait_until_there(robot: Robot, role: str) -> None:
    """Wait until a robot knows its pose and speed, and (if it has a LIDAR) has seen points."""
    deadline = time.monotonic() + _THERE
    missing = ["points"] * robot.has_lidar
    while True:
        sensed = robot.sense()
        if sensed.points is not None:
            missing = []
        unknown = {"pose": sensed.pose, "odometry": sensed.twist}
        lost = [name for name, values in unknown.items() if not np.isfinite(values).all()] + missing
        if not lost:
            return
        if time.monotonic() > deadline:
            what = " and no ".join(lost)
            raise DependencyError(f"{role}: no {what} for {_THERE:g} s; are its topics right and its nodes on?")
        time.sleep(0.05)
