"""Being a node of ROS 1; without numpy, for the watchdog needs none."""

import os
import re
from typing import Any

from mp2a.exceptions import DependencyError

NO_ROS = (
    "ROS 1: {why}; on Debian: apt-get install ros-core python3-geometry-msgs python3-sensor-msgs python3-nav-msgs "
    "python3-tf2-ros, and make /usr/lib/python3/dist-packages visible to this Python (docs/robots.md)"
)

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
"""As of ROS Noetic; its constants are part of the sum by which ROS 1 tells types apart."""


def connect(name: str) -> Any:
    """Become a node, once a process; returns ``rospy``.

    Raises
    ------
    DependencyError
        If there is no rospy, or no ROS master answers.
    """
    try:
        import rosgraph
        import rospy
    except ImportError as error:
        raise DependencyError(NO_ROS.format(why=f"{error}")) from error
    if not rosgraph.is_master_online():
        where = os.environ.get("ROS_MASTER_URI", "unset")
        raise DependencyError(f"ROS 1: no master answers at ROS_MASTER_URI ({where}); start one: rosmaster --core")
    if not rospy.core.is_initialized():
        rospy.init_node(re.sub(r"\W", "_", f"mp2a_{name}"), anonymous=True, disable_signals=True)
    return rospy


def sound_request() -> Any:
    """Return the class of ``sound_play/SoundRequest``, which need not be installed where the planner runs."""
    from genpy.dynamic import generate_dynamic

    return generate_dynamic("sound_play/SoundRequest", _SOUND_REQUEST)["sound_play/SoundRequest"]
