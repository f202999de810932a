"""Commands, sounds and texts over a real ROS master."""

import os
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from listening import Listener

from mp2a.exceptions import DependencyError
from mp2a.robots import sound
from mp2a.robots.robot_config import ROBOT_CONFIGS
from mp2a.robots.robots_file import within
from mp2a.robots.sender import Sender

pytestmark = pytest.mark.ros


PLANNER = """
import sys, time
from mp2a.robots.robots_file import within
from mp2a.robots.sender import Sender
from mp2a.robots.robot_config import ROBOT_CONFIGS
sender = Sender(within(ROBOT_CONFIGS["husky"], "wire"), "ros1", role="wire")
print("up", flush=True)
while True:
    sender.send(0.5, 0.1)
    time.sleep(0.1)
"""


def test_commands_arrive_at_rate_and_after_sigkill_only_zeros(master, metronome):
    from geometry_msgs.msg import Twist

    listener = Listener("/wire/nav/cmd_vel", Twist)
    planner = subprocess.Popen([sys.executable, "-c", PLANNER], stdout=subprocess.PIPE, text=True)
    assert planner.stdout.readline() == "up\n"
    time.sleep(5)
    planner.kill()
    killed = time.monotonic()
    planner.wait()
    time.sleep(2)
    listener.close()
    metronome.check()
    driven = [(t, m) for t, m in listener.heard if m.linear.x]
    gaps = np.diff([t for t, _ in driven])
    print(f"{len(driven)} commands, median gap {np.median(gaps):.5f} s, longest {gaps.max():.4f} s")
    assert np.percentile(gaps, 99) <= 0.1
    assert np.mean(gaps) == pytest.approx(0.05, abs=0.001)
    assert all((m.linear.x, m.angular.z) == (0.5, 0.1) for _, m in driven)
    assert all(v == 0 for _, m in driven for v in (m.linear.y, m.linear.z, m.angular.x, m.angular.y))
    zeros = [t for t, m in listener.heard if not m.linear.x]
    print(f"first zero {zeros[0] - killed:.4f} s after SIGKILL")
    assert len(zeros) >= 5
    assert zeros[0] > driven[-1][0]
    assert zeros[0] - killed < 0.5


def test_stamped_commands(master):
    from geometry_msgs.msg import TwistStamped

    listener = Listener("/stamped/cmd_vel", TwistStamped)
    interface = replace(within(ROBOT_CONFIGS["husky-jazzy"], "stamped"), rate=20.0)
    sender = Sender(interface, "ros1", role="stamped")
    for _ in range(10):
        sender.send(0.3, 0.0)
        time.sleep(0.05)
    sender.close()
    time.sleep(0.2)
    listener.close()
    assert listener.heard[0][1].twist.linear.x == 0.3
    assert listener.heard[-1][1].twist.linear.x == 0.0
    stamps = [m.header.stamp.to_sec() for _, m in listener.heard]
    assert stamps == sorted(stamps)
    assert abs(stamps[-1] - time.time()) < 5


def test_the_human_wins(master):
    """While somebody publishes on the human's topic nothing of ours arrives."""
    import rospy
    from geometry_msgs.msg import Twist

    listener = Listener("/hand/nav/cmd_vel", Twist)
    human = rospy.Publisher("/hand/cmd_vel", Twist, queue_size=1)
    sender = Sender(within(ROBOT_CONFIGS["husky"], "hand"), "ros1", role="hand")

    def spell(seconds, by_hand):
        for _ in range(round(seconds / 0.05)):
            sender.send(0.4, 0.0)
            if by_hand:
                human.publish(Twist())
            time.sleep(0.05)

    spell(0.5, False)
    assert listener.heard
    spell(0.3, True)
    before = len(listener.heard)
    spell(1.0, True)
    assert len(listener.heard) == before
    spell(1.2, False)
    assert len(listener.heard) > before
    sender.close()
    listener.close()


# The services' own package is not on the index: these have its names, and messages that hold the same.
MUX = """
from std_msgs.msg import Bool, String

class Acquire:
    _type, _md5sum, _request_class, _response_class = "nifti_teleop/Acquire", "0" * 32, String, Bool

class Release(Acquire):
    _type = "nifti_teleop/Release"
"""


def test_a_mux_is_asked_again_and_again_and_released(master, tmp_path, monkeypatch):
    import rospy
    from geometry_msgs.msg import Twist
    from std_msgs.msg import Bool

    listener = Listener("/t/nav/cmd_vel", Twist)
    (tmp_path / "nifti_teleop").mkdir()
    (tmp_path / "nifti_teleop" / "__init__.py").touch()
    (tmp_path / "nifti_teleop" / "srv.py").write_text(MUX)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}")
    from nifti_teleop.srv import Acquire, Release

    asked = []

    def answer(what):
        def handle(request):
            asked.append((what, request.data))
            return Bool(True)

        return handle

    services = [
        rospy.Service("/t/mux_cmd_vel/acquire", Acquire, answer("acquire")),
        rospy.Service("/t/mux_cmd_vel/release", Release, answer("release")),
    ]
    sender = Sender(within(ROBOT_CONFIGS["tradr"], "t"), "ros1", role="t")
    for _ in range(30):
        sender.send(0.3, 0.0)
        time.sleep(0.05)
    sender.close()
    listener.close()
    for service in services:
        service.shutdown()
    assert len(asked) >= 4
    assert asked[:-1] == [("acquire", "/t/nav/cmd_vel")] * (len(asked) - 1)
    assert asked[-1] == ("release", "/t/nav/cmd_vel")
    assert listener.heard[-1][1].linear.x == 0.0


def test_a_mux_whose_package_is_missing_is_named(master):
    from geometry_msgs.msg import Twist

    listener = Listener("/u/nav/cmd_vel", Twist)
    with pytest.raises(DependencyError, match=r"nifti_teleop.*or let the robot ask: command_topic"):
        Sender(within(ROBOT_CONFIGS["tradr"], "u"), "ros1", role="u")
    listener.close()


def test_nobody_listens(master):
    with pytest.raises(DependencyError, match="nobody listens to /nowhere/nav/cmd_vel"):
        Sender(within(ROBOT_CONFIGS["husky"], "nowhere"), "ros1", role="nowhere")


def test_sound_requests_are_those_of_sound_play(master):
    """The sum by which ROS 1 tells types apart is that of Noetic's sound_play."""
    from mp2a.robots.ros1.node import Ros1Node

    kind = Ros1Node("test").message("sound_play/msg/SoundRequest")
    assert kind._type == "sound_play/SoundRequest"
    assert kind._md5sum == "d098ce4a040686259137ece23a625167"
    assert sound.sound_numbers("x") == (kind.SAY, kind.PLAY_ONCE)
    assert sound.sound_numbers(None) == (kind.BACKINGUP, kind.PLAY_ONCE)


def test_robots_without_mpi_start_together_over_sync(master):
    """Three processes, each a robot of its own, agree over the topic /sync alone."""
    program = (
        "import sys\nfrom mp2a.robots.channel import agree_on_start\nfrom mp2a.robots.ros_backend import open_backend\n"
        "from mp2a.robots.ros_robot import RosChannel\nfrom mp2a.robots.start import Start\n"
        "role, v_max = sys.argv[1:]\nstart = Start(role, ['R1', 'R2', 'R3'], {'v_max': v_max}, 2.0)\n"
        "print(repr(agree_on_start(start, RosChannel(open_backend('ros1', role), f'/{role}/all_ready'))))"
    )

    def start_all(*speeds):
        robots = []
        for role, speed in zip(("R1", "R2", "R3"), speeds, strict=True):
            robots.append(
                subprocess.Popen(
                    [sys.executable, "-c", program, role, speed], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                    text=True,
                )
            )  # fmt: skip
            time.sleep(0.4)
        return [robot.communicate(timeout=90) for robot in robots]

    agreed = {said for said, _ in start_all("0.7", "0.7", "0.7")}
    assert len(agreed) == 1
    assert float(agreed.pop()) == pytest.approx(time.time(), abs=2.0)
    for said, error in start_all("0.7", "0.7", "0.5"):  # two of them refuse the third, and it refuses them
        assert not said
        assert "were not given the same, expected no difference: v_max: " in error or "waited 60 s" in error
