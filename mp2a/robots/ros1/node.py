"""A node of ROS 1, over rospy, which comes with a ROS installation and not from the package index."""

import contextlib
import os
import re
import threading
import time
from collections import deque
from collections.abc import Callable
from importlib import import_module
from typing import Any

from mp2a.exceptions import DependencyError
from mp2a.robots.ros_backend import Take, TopicWriter

NO_ROS = (
    "ROS 1: {why}; on Debian: apt-get install ros-core python3-geometry-msgs python3-sensor-msgs python3-nav-msgs "
    "python3-tf2-msgs, and make /usr/lib/python3/dist-packages visible to this Python (docs/robots.md)"
)
_LARGEST = 1 << 24
"""Bytes of a message that are read at once; a cloud of points is large."""
_ASK_EVERY = 0.5
"""s between two requests for the command topic: the mux takes it away 2 s after the last message."""
_SERVICE = 5.0
"""s for a mux to be there."""
_SOUND_REQUEST = """int8 BACKINGUP = 1
int8 NEEDS_UNPLUGGING = 2
int8 NEEDS_PLUGGING = 3
int8 NEEDS_UNPLUGGING_BADLY = 4
int8 NEEDS_PLUGGING_BADLY = 5
int8 ALL = -1
int8 PLAY_FILE = -2
int8 SAY = -3
int8 sound
int8 PLAY_STOP = 0
int8 PLAY_ONCE = 1
int8 PLAY_START = 2
int8 command
float32 volume
string arg
string arg2
"""
"""As of ROS Noetic; its constants are part of the sum by which ROS 1 tells types apart. sound_play need not be
installed where the planner runs."""


class Ros1Node:
    """One's node of ROS 1, which a process has but once.

    Raises
    ------
    DependencyError
        If there is no rospy, or no ROS master answers.
    """

    name = "ROS 1"

    def __init__(self, role: str) -> None:
        try:
            import rosgraph
            import rospy
        except ImportError as error:
            raise DependencyError(NO_ROS.format(why=f"{error}")) from error
        if not rosgraph.is_master_online():
            where = os.environ.get("ROS_MASTER_URI", "unset")
            raise DependencyError(f"ROS 1: no master answers at ROS_MASTER_URI ({where}); start one: rosmaster --core")
        if not rospy.core.is_initialized():
            rospy.init_node(re.sub(r"\W", "_", f"mp2a_{role}"), anonymous=True, disable_signals=True)
        self._rospy = rospy

    def message(self, kind: str) -> Any:
        """Return the class of a type of messages."""
        package, _, name = kind.split("/")
        if package == "sound_play":
            from genpy.dynamic import generate_dynamic

            return generate_dynamic(f"{package}/{name}", _SOUND_REQUEST)[f"{package}/{name}"]
        try:
            return getattr(import_module(f"{package}.msg"), name)
        except ImportError as error:
            raise DependencyError(NO_ROS.format(why=f"{error}")) from error

    def header(self, frame: str) -> Any:
        """Return a ``std_msgs/Header`` of now."""
        return self.message("std_msgs/msg/Header")(0, self._rospy.Time.now(), frame)

    def clock(self) -> float:
        """Return the time that stamps go by, s; simulated, if ROS has it so."""
        now: float = self._rospy.get_time()
        return now

    def writer(self, topic: str, kind: str, *, depth: int = 10, kept: bool = False) -> TopicWriter:
        """Open a topic for writing."""
        opened = self._rospy.Publisher(topic, self.message(kind), queue_size=depth, latch=kept, tcp_nodelay=True)
        return TopicWriter(opened.publish, opened.get_num_connections)

    def reader(
        self, topic: str, kind: str, *, depth: int = 1, kept: bool = False, reliable: bool = False, own: bool = True
    ) -> Take:
        """Open a topic for reading; what is kept comes by itself, and all is reliable."""
        inbox: deque[tuple[float, Any]] = deque(maxlen=depth)  # its methods may be called from any thread
        name = self._rospy.get_name()

        def put(message: Any) -> None:
            if own or message._connection_header["callerid"] != name:
                inbox.append((time.monotonic(), message))

        self._rospy.Subscriber(topic, self.message(kind), put, queue_size=depth, buff_size=_LARGEST, tcp_nodelay=True)
        return lambda: [inbox.popleft() for _ in range(len(inbox))]

    def acquire(self, topic: str, acquire: str, release: str) -> Callable[[], None]:
        """Ask for a topic in a thread of its own, again and again: a human of higher priority may have it."""
        try:
            from nifti_teleop.srv import Acquire, Release
        except ImportError as error:
            message = (
                f"ROS 1: {error}, which the mux at {acquire} needs; install the robot's nifti_teleop, or let the robot "
                "ask: command_topic = '/private/nav/cmd_vel', acquire = '', release = ''"
            )
            raise DependencyError(message) from error
        rospy = self._rospy
        for name in (acquire, release):
            try:
                rospy.wait_for_service(name, _SERVICE)
            except rospy.ROSException as error:
                raise DependencyError(f"ROS 1: {error}; is the robot's mux on?") from error
        ask, let_go = rospy.ServiceProxy(acquire, Acquire), rospy.ServiceProxy(release, Release)
        over = threading.Event()

        def call(service: Any) -> None:
            with contextlib.suppress(rospy.ServiceException):  # a mux that is down lets nothing through either
                service(topic)

        def keep_asking() -> None:
            while not over.is_set():
                call(ask)
                over.wait(_ASK_EVERY)

        thread = threading.Thread(target=keep_asking, daemon=True)
        thread.start()

        def end() -> None:
            over.set()
            thread.join(2 * _ASK_EVERY)
            call(let_go)

        return end

    def close(self) -> None:
        """Leave ROS."""
        self._rospy.signal_shutdown("the robot stands")
