"""The planner's end of the pipe to the watchdog."""

import contextlib
import json
import os
import select
import subprocess
import sys
import time
from dataclasses import asdict
from typing import Any

from mp2a.exceptions import DependencyError
from mp2a.robots import watchdog
from mp2a.robots.launcher import launcher_pid
from mp2a.robots.table import RobotInterface

_START_PATIENCE = 30.0
"""s for the watchdog to be connected."""
_END_PATIENCE = 5.0


class WatchdogGoneError(DependencyError):
    """The watchdog has ended: nothing reaches the robot any more, and it stands."""


class Sender:
    """Sends commands to a robot through a watchdog of its own, which is a process.

    Parameters
    ----------
    interface
        Of the robot.
    publisher
        One of `mp2a.robots.publishers.PUBLISHERS`.
    more
        Settings of that publisher alone.

    Raises
    ------
    DependencyError
        If the watchdog cannot reach the robot; says why.
    """

    def __init__(self, interface: RobotInterface, publisher: str, **more: Any) -> None:
        limits = {"max_speed": interface.model.max_speed, "max_turn_rate": interface.model.max_turn_rate}
        settings = {**asdict(interface), **limits, **more, "publisher": publisher, "launcher": launcher_pid()}
        del settings["model"]
        command = [sys.executable, "-m", "mp2a.robots.watchdog", json.dumps(settings)]
        # A session of its own: what ends the planner's group must not end the watchdog before the robot stands.
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True
        )
        self._wait_until_ready()
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
            status = self._process.poll()
            raise WatchdogGoneError(f"the watchdog takes no more commands ({_reason(status)}); the robot stands") from error

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

    def _wait_until_ready(self) -> None:
        output = self._process.stdout
        assert output is not None
        deadline, said = time.monotonic() + _START_PATIENCE, b""
        while b"\n" not in said:
            left = deadline - time.monotonic()
            new = os.read(output.fileno(), 4096) if left > 0 and select.select([output], [], [], left)[0] else b""
            if not new:
                break
            said += new
        if said.decode() == watchdog.READY:
            return
        self._process.kill()
        self._process.wait()
        raise DependencyError(
            f"no watchdog: {said.decode().strip() or f'it was not ready within {_START_PATIENCE:g} s'}"
        )


def _reason(status: int | None) -> str:
    reasons = {
        None: "it does not read", watchdog.PLANNER_GONE: "its pipe was closed",
        watchdog.STALLED: "it has got no command for too long", watchdog.SIGNALLED: "it got a signal",
        watchdog.LAUNCHER_GONE: "mpirun has ended",
    }  # fmt: skip
    return reasons.get(status, f"it ended with status {status}")
