"""A robot over ROS 2."""

from mp2a.robots.adapters import Made, Order
from mp2a.robots.ros2.robot import Ros2Channel, Ros2Robot


def make(order: Order) -> Made:
    """Reach the robot of this process."""
    [role] = order.roles
    interface = order.found.interfaces[role]
    robot = Ros2Robot(role, interface, order.armed)
    return Made([robot], channel=lambda: Ros2Channel(interface.ready_topic))
