"""The planner's end of the pipe to the watchdog."""

import contextlib
import json
import os
import subprocess
from dataclasses import asdict
from typing import Any

from mp2a.exceptions import DependencyError
from mp2a.robots import watchdog
from mp2a.robots.child import start_child, wait_until_ready
from mp2a.robots.launcher import launcher_pid
from mp2a.robots.robot_config import RobotConfig

_END_PATIENCE = 5.0


class WatchdogGoneError(DependencyError):
    """The watchdog has ended: nothing reaches the robot any more, and it stands."""


class Sender:
    """Sends commands to a robot through a watchdog of its own, which is a process.

    Parameters
    ----------
    config
        Of the robot.
    backend
        One of `mp2a.robots.ros_backend.BACKENDS`.
    publisher
        What sends: module and class of a `mp2a.robots.watchdog.CommandPublisher`, loaded by the watchdog alone.
    more
        Further settings for it.

    Raises
    ------
    DependencyError
        If the watchdog cannot reach the robot; says why.
    """

    def __init__(
        self, config: RobotConfig, backend: str, publisher: str = "mp2a.robots.ros_commands:RosCommands", **more: Any
    ) -> None:
        limits = {"max_speed": config.model.max_speed, "max_turn_rate": config.model.max_turn_rate}
        settings = {**asdict(config), **limits, **more, "backend": backend, "publisher": publisher}
        settings["launcher"] = launcher_pid()
        del settings["model"]
        self._process = start_child("mp2a.robots.watchdog", json.dumps(settings))
        if why := wait_until_ready(self._process):
            raise DependencyError(f"no watchdog: {why}")
        assert self._process.stdin is not None
        self._pipe = self._process.stdin.fileno()
        os.set_blocking(self._pipe, False)

    @property
    def pid(self) -> int:
        """Process id of the watchdog."""
        return self._process.pid

    def send(self, speed: float, turn_rate: float) -> None:
        """Hand a command over, m/s and rad/s.

        Raises
        ------
        WatchdogGoneError
            If the watchdog has ended or does not read any more.
        """
        try:
            os.write(self._pipe, watchdog.COMMAND.pack(speed, turn_rate))
        except (BrokenPipeError, BlockingIOError, OSError) as error:
            why = _reason(self._process.poll())
            raise WatchdogGoneError(f"the watchdog takes no more commands ({why}); the robot stands") from error

    def close(self) -> None:
        """End the watchdog, which stops the robot first."""
        with contextlib.suppress(WatchdogGoneError):
            self.send(float("nan"), float("nan"))
        with contextlib.suppress(OSError):
            self._process.stdin.close()  # type: ignore[union-attr]
        try:
            self._process.wait(_END_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _reason(status: int | None) -> str:
    reasons = {
        None: "it does not read", watchdog.PLANNER_GONE: "its pipe was closed",
        watchdog.STALLED: "it has got no command for too long", watchdog.SIGNALLED: "it got a signal",
        watchdog.LAUNCHER_GONE: "mpirun has ended",
    }  # fmt: skip
    return reasons.get(status, f"it ended with status {status}")
