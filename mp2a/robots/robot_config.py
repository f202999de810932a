"""Every robot's topics, frames, rates and limits, in one table."""

from dataclasses import dataclass, fields, replace

from mp2a.checks import positive
from mp2a.exceptions import InputError
from mp2a.formation.robot_models import HUSKY, TRADR, RobotModel

LEAST_RATE = 10.0
"""Hz below which the robots ignore commands (thesis, chapter 2)."""
_LARGEST = {
    "rate": 200.0, "patience": 1.0, "human_pause": 60.0, "pose_age": 1.0, "points_age": 1.0, "length": 10.0,
    "width": 10.0, "max_speed": 20.0, "max_turn_rate": 20.0, "max_acceleration": 100.0, "max_turn_acceleration": 100.0,
}  # fmt: skip
"""What no ground robot here exceeds: Hz, s, m, m/s, rad/s, m/s², rad/s². Ours, against slips of the pen, with which a
drive would take for ever, or a robot would drive on for long when it is lost."""
COMMAND_MESSAGES = ("Twist", "TwistStamped")
POSES = ("tf", "odometry", "stamped")


@dataclass(frozen=True)
class RobotConfig:
    """How to talk to one robot.

    Attributes
    ----------
    model
        Size and limits.
    command_topic
        Where commands go.
    human_topic
        Where a human's commands go, who wins: nothing of ours is sent while there are any. Empty: nowhere to look.
    message
        ``Twist`` or ``TwistStamped``.
    rate
        Commands a second, Hz.
    patience
        s without a new command from the planner after which the watchdog stops the robot and ends.
    human_pause
        s after a human's last command until ours are sent again.
    acquire, release
        Services of a mux that hands out the command topic; empty: it has none.
    pose
        Where the pose is from: ``tf``, ``odometry``, or ``stamped``, messages of their own.
    fixed_frame, body_frame
        Between which the pose is, m and rad.
    pose_age
        s: an older pose counts as a look-up that failed.
    tf_topic
        ``tf2_msgs/TFMessage``; those that do not move come on the same with ``_static`` added.
    odometry_topic
        ``nav_msgs/Odometry``; its turn rate must be measured (by a gyroscope), not made of the wheels' turns.
    pose_topic, twist_topic
        ``geometry_msgs/PoseStamped`` and ``TwistStamped``, only used if the pose is ``stamped``.
    points_topic
        ``sensor_msgs/PointCloud2`` without the robot's own body; empty: it has no LIDAR.
    points_age
        s that points are old when they come (thesis, chapter 2: "approximately 300 ms").
    sound_topic
        ``sound_play/SoundRequest``; empty: it is mute.
    ready_topic
        ``std_msgs/Bool``: whether all robots have been reached (thesis, chapter 3).
    stop_front_topic, stop_rear_topic
        ``std_msgs/Bool``: something is too close to drive forward, or backward (thesis, chapter 3 and section 5.2).
        Published for the robot's other programs, and obeyed if one of those publishes it. Empty: neither.
    obstacles_topic
        ``sensor_msgs/PointCloud2``: the points that count, in the body's frame. Empty: not published.

    Raises
    ------
    InputError
        If a field is not what it has to be.
    """

    model: RobotModel
    command_topic: str = "/nav/cmd_vel"
    human_topic: str = "/cmd_vel"
    message: str = "Twist"
    rate: float = 20.0
    patience: float = 0.3
    human_pause: float = 0.5
    acquire: str = ""
    release: str = ""
    pose: str = "tf"
    fixed_frame: str = "map"
    body_frame: str = "base_link"
    pose_age: float = 0.3
    tf_topic: str = "/tf"
    odometry_topic: str = "/odometry/filtered"
    pose_topic: str = "/pose"
    twist_topic: str = "/twist"
    points_topic: str = "/points_filtered"
    points_age: float = 0.3
    sound_topic: str = "/robotsound"
    ready_topic: str = "/all_ready"
    stop_front_topic: str = "/stop_front"
    stop_rear_topic: str = "/stop_rear"
    obstacles_topic: str = "/obstacles"

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.type is float:
                positive(field.name, value)
            elif field.type is str and (not isinstance(value, str) or value != "".join(value.split())):
                raise InputError(f"{field.name}: got {value!r}, expected a name without blanks")
        self._check_largest()
        for name, allowed in (("message", COMMAND_MESSAGES), ("pose", POSES)):
            if getattr(self, name) not in allowed:
                raise InputError(f"{name}: got {getattr(self, name)!r}, expected one of {', '.join(allowed)}")
        for name in ("command_topic", "odometry_topic"):
            if not getattr(self, name):
                raise InputError(f"{name}: got nothing, expected a topic")
        if self.rate < LEAST_RATE:
            raise InputError(f"rate: got {self.rate:g} Hz, expected at least {LEAST_RATE:g}, or the robot ignores it")
        if self.patience < 2 / self.rate:
            raise InputError(f"patience: got {self.patience:g} s, expected at least two ticks ({2 / self.rate:g} s)")
        if self.command_topic == self.human_topic:
            raise InputError(f"command_topic: got {self.command_topic}, expected another one than the human's")
        if bool(self.acquire) != bool(self.release):
            raise InputError(f"acquire, release: got {self.acquire!r}, {self.release!r}, expected both or none")

    def _check_largest(self) -> None:
        for name, largest in _LARGEST.items():
            value = getattr(self if hasattr(self, name) else self.model, name)
            if value > largest:
                raise InputError(f"{name}: got {value:g}, expected at most {largest:g}")


ROBOT_CONFIGS = {
    "husky": RobotConfig(HUSKY),
    "tradr": RobotConfig(
        TRADR, acquire="/mux_cmd_vel/acquire", release="/mux_cmd_vel/release", odometry_topic="/odom"
    ),
    "husky-jazzy": RobotConfig(
        replace(HUSKY, max_turn_rate=1.0, max_acceleration=1.0, max_turn_acceleration=1.0),
        command_topic="/cmd_vel", human_topic="/joy_teleop/cmd_vel", message="TwistStamped", pose="odometry",
        fixed_frame="odom", odometry_topic="/platform/odom/filtered", points_topic="/sensors/lidar3d_0/points",
    ),
}  # fmt: skip
"""By lower-case name. `husky`, `tradr`: the thesis, chapters 2 and 3, and (mux, limits) the robots' published software.
`husky-jazzy`: Clearpath's software for ROS 2, whose lower-priority command topic is ``cmd_vel`` itself; its limits are
those of ROS 2 Humble, and its points hold the robot's own body unless they are filtered."""
