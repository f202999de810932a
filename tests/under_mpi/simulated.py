"""A simulated world on rank 0: every rank drives one robot, as it does in one process, and loads no geometry."""

import sys

import numpy as np
from _formation import COMM, RANK, SIZE, Checks

import mp2a
from mp2a.formation import Formation, FormationController, LocalExchange, MPIExchange, waypoints
from mp2a.formation.robot_models import HUSKY
from mp2a.simulator import FormationSimulationDriver
from mp2a.simulator.ranks import simulate_over_ranks

check = Checks()
SECONDS = 6.0
PATH = waypoints([[0, 0], [9, 0]])
formation = Formation.of("line", SIZE)


def world_for(controller):
    """Run the simulation; the last robot's sensor falls silent."""
    from mp2a.simulator import Simulation, World, disc

    simulation = Simulation(World([], [disc((4.5, 0.1), 0.3)]), HUSKY, formation.layout.poses(np.zeros(3)))
    while simulation.time < SECONDS - 1e-9:
        simulation.silence(SIZE - 1, simulation.time > 2.95)
        simulation.step(controller(simulation.sense()))
    return simulation.poses


with mp2a.DistributedModel(COMM, formation.model, "sweep") as ranks:
    mine = FormationSimulationDriver(
        FormationController(formation, PATH if RANK == 0 else None, MPIExchange(ranks)), HUSKY
    )
    poses = []
    simulate_over_ranks(COMM, mine, (lambda controller: poses.append(world_for(controller))) if RANK == 0 else None)
if RANK:
    check(not {"shapely", "matplotlib", "rich", "lark", "numba", "pinocchio"} & set(sys.modules), RANK)
parts = COMM.gather((np.array(mine.leaders), mine.events, mine.record))
check(bool(mine.march.state.errors.failed[0]) == (RANK == SIZE - 1))
if RANK == 0:
    whole = FormationSimulationDriver(
        FormationController(formation, PATH, LocalExchange(formation.model, "sweep")), HUSKY
    )
    expected = world_for(whole.step)
    check(np.abs(expected - poses[0]).max() < 1e-9)
    leaders = np.concatenate([part[0] for part in parts], axis=1)
    check(np.abs(leaders - np.array(whole.leaders)).max() < 1e-9)
    events = sorted((event for part in parts for event in part[1]), key=str)
    for ours, theirs in zip(events, sorted(whole.events, key=str), strict=True):
        check(np.allclose(ours.place, theirs.place, atol=1e-9), ours)
        check(ours._replace(place=None) == theirs._replace(place=None), ours)
    check(np.abs(whole.record.push).max() > 10)
    check(np.abs(parts[-1][2].force[:, 0] - whole.record.force[:, -1]).max() < 1e-6)


class Odd:
    """Drives on, and on the last rank finds something wrong after a while."""

    done, steps = False, 0

    def step(self, sensed):
        self.steps += 1
        if self.steps == 5 and RANK == SIZE - 1:
            raise mp2a.InputError("what I found")
        return np.zeros((1, 2))


def short_world(controller):
    """A run that itself finds something wrong, if no robot does."""
    from mp2a.simulator import Simulation, World

    simulation = Simulation(World(), HUSKY, formation.layout.poses(np.zeros(3)))
    for _ in range(8):
        commands = controller(simulation.sense())
        if commands is None:
            return
        simulation.step(commands)
    simulation.step(commands[:, :1])


class Fine(Odd):
    """Finds nothing wrong."""

    def step(self, sensed):
        return np.zeros((1, 2))


for robot, expected in ((Odd(), f"rank {SIZE - 1}: what I found"), (Fine(), "rank 0: commands: got shape")):
    try:
        simulate_over_ranks(COMM, robot, short_world if RANK == 0 else None)
        text = ""
    except mp2a.InputError as error:
        text = str(error)
    check(len(set(COMM.allgather(text))) == 1 and (text.startswith(expected) or SIZE == 1), text)
check.done()
