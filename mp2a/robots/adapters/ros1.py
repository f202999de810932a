"""A robot over ROS 1."""

from mp2a.robots.adapters import Made, Order
from mp2a.robots.ros1.robot import Ros1Channel, Ros1Robot


def make(order: Order) -> Made:
    """Reach the robot of this process."""
    [role] = order.roles
    interface = order.found.interfaces[role]
    robot = Ros1Robot(role, interface, order.armed)
    return Made([robot], channel=lambda: Ros1Channel(role, interface.ready_topic))
