"""Collects what arrives on a topic of ROS 1."""

import time


class Listener:
    """Collects what arrives on a topic."""

    def __init__(self, topic, kind):
        import rospy

        from mp2a.robots.ros1.node import Ros1Node

        Ros1Node("test")
        self.heard = []
        self._subscriber = rospy.Subscriber(topic, kind, self._put, queue_size=100, tcp_nodelay=True)

    def _put(self, message):
        self.heard.append((time.monotonic(), message))

    def close(self):
        self._subscriber.unregister()
