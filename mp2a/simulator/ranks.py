"""One simulated world for robots on ranks: rank 0 has it, and every rank is a robot that knows what it senses itself.

What goes between rank 0 and the others here stands for the air and the wheels: a scan and a pose in, a command out.
Robots tell each other nothing by it.
"""

from collections.abc import Callable

import numpy as np

from mp2a.exceptions import InputError
from mp2a.mpi import MPI
from mp2a.simulator.driver import SimulationDriver
from mp2a.simulator.loop import Controller
from mp2a.simulator.observation import Observation
from mp2a.spatial import Array
from mp2a.transport.agreement import raise_together
from mp2a.transport.wait import wait

_ROW = 11
"""Numbers of what a robot knows: whether the run is over, time, pose, twist, stamp, arrival, new, number of points."""
_REPLY = 4
"""Command, whether the robot is done, and whether something is wrong with it."""

_Run = Callable[[Controller], None]
"""Run a simulation with a controller."""


def simulate_over_ranks(comm: MPI.Intracomm, robot: SimulationDriver, run: _Run | None) -> None:
    """Let every rank drive one robot of a simulated world; collective.

    Parameters
    ----------
    comm
        Rank i drives robot i.
    robot
        What drives this rank's robot.
    run
        Runs the simulation with the controller it is given; on rank 0 only, None on others. The controller ends the run
        when all robots are done.

    Raises
    ------
    InputError
        On every rank, if the run or a robot of any raises it; the run ends there.
    """
    wrong: InputError | None = None
    if run is None:
        while (sensed := _receive(comm)) is not None:
            reply, wrong = _reply(robot, sensed)
            wait(comm.Igather(reply, None, 0))
        _end(comm, wrong)
        return

    def everyone(sensed: Observation) -> Array | None:
        nonlocal wrong
        own = _send(comm, sensed)
        replies = np.empty((comm.size, _REPLY))
        reply, wrong = _reply(robot, own)
        wait(comm.Igather(reply, replies, 0))
        return None if replies[:, 2].all() or replies[:, 3].any() else replies[:, :2]

    try:
        run(everyone)
    except InputError as error:
        wrong = wrong or error
    finally:
        over = np.zeros((comm.size, _ROW))
        over[:, 0] = 1
        wait(comm.Iscatter(over, np.empty(_ROW), 0))
    _end(comm, wrong)


def _reply(robot: SimulationDriver, sensed: Observation) -> tuple[Array, InputError | None]:
    try:
        command = robot.step(sensed)[0]
    except InputError as error:
        return np.array([0.0, 0.0, 0.0, 1.0]), error
    return np.array([*command, float(robot.done), 0.0]), None


def _end(comm: MPI.Intracomm, wrong: InputError | None) -> None:
    """Raise the same error on every rank if there was one on any."""
    texts = comm.allgather(None if wrong is None else str(wrong))
    if wrong is not None and len(set(texts)) == 1:
        raise wrong  # the robots have agreed on it already
    raise_together(comm, wrong)


def _send(comm: MPI.Intracomm, sensed: Observation) -> Observation:
    counts = np.array([len(points) for points in sensed.points])
    times = np.tile([0.0, sensed.time], (comm.size, 1))
    scans = np.column_stack((sensed.stamps, sensed.arrivals, sensed.new, counts))
    rows = np.column_stack((times, sensed.poses, sensed.twists, scans))
    wait(comm.Iscatter(rows, np.empty(_ROW), 0))
    points = np.ascontiguousarray(np.concatenate(sensed.points), dtype=float)
    own = np.empty((counts[0], 2))
    wait(comm.Iscatterv([points, 2 * counts, None, MPI.DOUBLE], own, 0))
    return _observation(rows[0], own)


def _receive(comm: MPI.Intracomm) -> Observation | None:
    row = np.empty(_ROW)
    wait(comm.Iscatter(None, row, 0))
    if row[0]:
        return None
    own = np.empty((int(row[10]), 2))
    wait(comm.Iscatterv(None, own, 0))
    return _observation(row, own)


def _observation(row: Array, points: Array) -> Observation:
    one = row[None]
    return Observation(float(row[1]), one[:, 2:5], one[:, 5:7], [points], one[:, 7], one[:, 8], one[:, 9] > 0)
