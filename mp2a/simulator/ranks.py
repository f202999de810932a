"""One simulated world for robots on ranks: rank 0 has it, and every rank is a robot that knows what it senses itself.

What goes between rank 0 and the others here stands for the air and the wheels: a scan and a pose in, a command out.
Robots tell each other nothing by it.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from mp2a.exceptions import InputError
from mp2a.mpi import MPI
from mp2a.simulator.driver import SimulationDriver
from mp2a.simulator.loop import Controller
from mp2a.simulator.observation import Observation
from mp2a.spatial import Array
from mp2a.transport.agreement import raise_together
from mp2a.transport.wait import wait

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
        while (own := _when_all_are_there(comm, comm.scatter, None)) is not None:
            reply, wrong = _reply(robot, own)
            _when_all_are_there(comm, comm.gather, reply)
        _end(comm, wrong)
        return

    def everyone(sensed: Observation) -> Array | None:
        nonlocal wrong
        parts = [_part(sensed, number) for number in range(comm.size)]
        reply, wrong = _reply(robot, _when_all_are_there(comm, comm.scatter, parts))
        commands, done, failed = zip(*_when_all_are_there(comm, comm.gather, reply), strict=True)
        return None if all(done) or any(failed) else np.array(commands)

    try:
        run(everyone)
    except InputError as error:
        wrong = wrong or error
    finally:
        _when_all_are_there(comm, comm.scatter, [None] * comm.size)
    _end(comm, wrong)


def _when_all_are_there(comm: MPI.Intracomm, call: Callable[[Any], Any], value: Any) -> Any:
    """Make a collective call once nobody has to be waited for with a busy core."""
    wait(comm.Ibarrier())
    return call(value)


def _part(sensed: Observation, robot: int) -> Observation:
    """Return what one robot knows."""
    one = slice(robot, robot + 1)
    return Observation._make((sensed.time, *(values[one] for values in sensed[1:])))


def _reply(robot: SimulationDriver, own: Observation) -> tuple[tuple[Array, bool, bool], InputError | None]:
    """Return the command, whether the robot is done, and whether something is wrong with it; and what is."""
    try:
        command = robot.step(own)[0]
    except InputError as error:
        return (np.zeros(2), False, True), error
    return (command, robot.done, False), None


def _end(comm: MPI.Intracomm, wrong: InputError | None) -> None:
    """Raise the same error on every rank if there was one on any."""
    texts = comm.allgather(None if wrong is None else str(wrong))
    if wrong is not None and len(set(texts)) == 1:
        raise wrong  # the robots have agreed on it already
    raise_together(comm, wrong)
