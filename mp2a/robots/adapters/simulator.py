"""Robots of the 2-D simulator: in one process, or in each rank the same simulation of all."""

from mp2a.robots.adapters import Made, Order
from mp2a.robots.simulated import SimulatedPace
from mp2a.simulator import Simulation, World, read_world


def make(order: Order) -> Made:
    """Make the simulation, and the robots of this process."""
    found, roles = order.found, order.scenario.robots
    world = World() if found.world is None else read_world(found.world)
    simulation = Simulation(world, [found.interfaces[role].model for role in roles], order.places)
    pace = SimulatedPace(simulation, order.period, [roles.index(role) for role in order.roles], order.comm)
    return Made(pace.robots, pace)
