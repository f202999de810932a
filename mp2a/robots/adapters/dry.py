"""Ideal robots that exist only here."""

from mp2a.robots.adapters import Made, Order
from mp2a.robots.dry import DryRobot, VirtualPace


def make(order: Order) -> Made:
    """Make the robots of this process."""
    places = dict(zip(order.scenario.robots, order.places, strict=True))
    robots = [DryRobot(order.found.interfaces[role].model, places[role]) for role in order.roles]
    return Made(robots, VirtualPace(order.period, robots))
