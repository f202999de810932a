"""A robot between two walls drives straight: its turn rate does not swing, in a corridor and at its ends."""

from pathlib import Path

import numpy as np
import pytest

from mp2a.formation import Formation, FormationController, waypoints
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.robot_models import HUSKY, TRADR
from mp2a.simulator.choreography_driver import ChoreographySimulationDriver
from mp2a.simulator.formation_driver import FormationSimulationDriver
from mp2a.simulator.lidar import Lidar
from mp2a.simulator.simulation import Simulation
from mp2a.simulator.world import World
from mp2a.simulator.world_file import read_world

HALF = 1.2
CORRIDOR = World([[[0.0, -HALF], [12.0, -HALF]], [[0.0, HALF], [12.0, HALF]]])
CORNER = read_world(Path(__file__).parents[1] / "examples" / "worlds" / "corridor.toml")


def turn_rates(driver, simulation, seconds):
    """Commands of all robots, ``(ticks, n)`` rad/s."""
    rates = []
    while simulation.time < seconds - 1e-9 and not driver.done:
        commands = driver.step(simulation.sense())
        rates.append(commands[:, 1])
        simulation.step(commands)
    assert not simulation.collisions
    return np.array(rates)


def choreography(robots, model, world, moves, noise=0.0):
    names = [f"R{i + 1}" for i in range(robots)]
    text = f"robots {' '.join(names)}\ncolumn {';'.join(names)} {2 if robots > 1 else 0} 0\n{moves}"
    dance = Choreography(parse(text), model)
    off = np.random.default_rng(1).normal(scale=(0.02, 0.03, 0.03), size=(robots, 3))
    simulation = Simulation(world, model, dance.slot_poses() + off, lidar=Lidar(noise=noise))
    return ChoreographySimulationDriver(dance), simulation


@pytest.mark.parametrize("model", [HUSKY, TRADR])
@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("robots", [1, 2])
def test_a_choreography_goes_straight_through_a_corridor(robots, model, noise):
    """Where walls are ahead or behind on both sides, the sign of the force across is that of a millimetre."""
    driver, simulation = choreography(robots, model, CORRIDOR, "move 14 0", noise)
    rates = turn_rates(driver, simulation, 40.0)
    assert len(rates) > 150
    # It was a square wave of ±0.8 rad/s for seconds, up to 1.5. What is left are walls that go from cell to cell.
    assert np.abs(rates).max() < 0.3
    assert rates.std(axis=0).max() < 0.1
    assert np.abs(simulation.poses[:, 1:]).max() < 0.05


def test_a_choreography_goes_round_the_corner_of_a_corridor():
    driver, simulation = choreography(1, HUSKY, CORNER, "move 8 0\nmove 7 90")
    before = turn_rates(driver, simulation, 9.0)
    assert np.abs(before).max() < 0.3
    turn_rates(driver, simulation, 40.0)
    assert driver.done
    assert simulation.poses[0, 1] > 5.5


@pytest.mark.parametrize("robots", [1, 4])
def test_a_march_by_dynamics_goes_straight_through_a_corridor(robots):
    formation = Formation.of("line", robots)
    controller = FormationController(formation, waypoints([[0, 0], [14, 0]]))
    start = formation.layout.poses(np.array([0.0, 0.05, 0.0]))
    driver = FormationSimulationDriver(controller, HUSKY)
    rates = turn_rates(driver, Simulation(CORRIDOR, HUSKY, start), 24.0)
    assert np.abs(np.diff(rates, axis=0)).sum(axis=0).max() < 3.0
    assert np.abs(rates).max() < 0.5
