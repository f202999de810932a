"""The process that sends a robot its commands, and stops it when the planner is gone.

``python -m mp2a.robots.watchdog SETTINGS`` (`mp2a.robots.sender` starts it) reads commands from its standard input, 16
bytes each: speed and turn rate as doubles. It repeats the newest one at the robot's rate. No new one for the patience:
the planner stalls. End of input: the planner has ended or was killed, or MPI ended it. The launcher of the planner's
rank has ended: mpirun was killed. A signal: somebody ends all this. In each case it sends zero for half a second and
ends. It never takes up driving again.

Nobody but this process sends to the robot, so that a planner that wakes up later cannot. It runs in a session of its
own, so that what ends the planner does not end it. If it is killed itself, nothing is sent any more, and the robot's
own controller stops (HUSKY's after 0.25 s).
"""

import importlib
import json
import math
import os
import select
import signal
import struct
import sys
import time
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

from mp2a.exceptions import DependencyError
from mp2a.robots.child import READY
from mp2a.robots.launcher import open_launcher

COMMAND = struct.Struct("<dd")
"""A command on the pipe; not a number: the planner has come to its end."""
ENDED, PLANNER_GONE, STALLED, SIGNALLED, LAUNCHER_GONE = 0, 3, 4, 5, 6
"""Exit status: as told; end of input; patience over; signal; mpirun gone."""
_ZERO_FOR = 0.5
"""s for which zero is sent before the end."""
_PIPE = 4096

Settings = Mapping[str, Any]
"""Fields of `mp2a.robots.robot_config.RobotConfig` by name, and what `mp2a.robots.sender.Sender` adds."""


class CommandPublisher(Protocol):
    """Sends commands to one robot."""

    def send(self, speed: float, turn_rate: float) -> None:
        """Publish a command, m/s and rad/s."""

    def human(self) -> bool:
        """Return whether a human drives the robot at present."""

    def close(self) -> None:
        """Let go of the robot."""


class PlannerInput(NamedTuple):
    """What has come from the planner."""

    command: tuple[float, float] | None
    """The newest, m/s and rad/s; None before the first."""
    at: float
    """When it came, s."""
    rest: bytes
    """Of a command that has not come whole."""
    ended: int | None
    """Exit status if this is the end."""


def main() -> int:
    """Run until the planner ends, stalls or dies; returns the exit status."""
    settings = json.loads(sys.argv[1])
    signalled = []
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda got, _frame: signalled.append(got))
    try:
        module, _, name = settings["publisher"].partition(":")
        publisher: CommandPublisher = getattr(importlib.import_module(module), name)(settings)
    except (DependencyError, ImportError) as error:
        sys.stdout.write(f"{error}\n")
        return 1
    sys.stdout.write(READY)
    sys.stdout.flush()
    os.set_blocking(0, False)
    status = ENDED
    try:
        status = _relay(publisher, settings, signalled)
    finally:  # whatever went wrong: the robot stops
        _stop(publisher, settings)
        publisher.close()
    return status


def _relay(publisher: CommandPublisher, settings: Settings, signalled: list[int]) -> int:
    period, patience = 1.0 / settings["rate"], settings["patience"]
    received = PlannerInput(None, 0.0, b"", None)
    try:
        launcher = open_launcher(settings["launcher"])
    except ProcessLookupError:
        return LAUNCHER_GONE
    due = time.monotonic()
    while True:
        received = _listen(received, max(0.0, due - time.monotonic()), launcher)
        now = time.monotonic()
        if signalled:
            return SIGNALLED
        if received.ended is not None:
            return received.ended
        if received.command is not None and now - received.at > patience:
            return STALLED
        if now < due:
            continue
        due += period * max(1, math.ceil((now - due) / period))
        if received.command is not None and not publisher.human():
            publisher.send(*_within(received.command, settings))


def _listen(before: PlannerInput, longest: float, launcher: int | None) -> PlannerInput:
    """Wait for commands for at most ``longest`` s, and take the newest."""
    readable, _, _ = select.select([0] if launcher is None else [0, launcher], [], [], longest)
    if launcher in readable:
        return before._replace(ended=LAUNCHER_GONE)
    if not readable:
        return before
    data = os.read(0, _PIPE)
    if not data:
        return before._replace(ended=PLANNER_GONE)
    data = before.rest + data
    whole = len(data) - len(data) % COMMAND.size
    if not whole:
        return before._replace(rest=data)
    command = COMMAND.unpack(data[whole - COMMAND.size : whole])
    if not all(map(math.isfinite, command)):
        return before._replace(ended=ENDED)
    return PlannerInput(command, time.monotonic(), data[whole:], None)


def _within(command: tuple[float, float], settings: Settings) -> tuple[float, float]:
    """Cut to the limits once more: the last instance before the robot trusts nobody."""
    speed, turn_rate = settings["max_speed"], settings["max_turn_rate"]
    return min(max(command[0], -speed), speed), min(max(command[1], -turn_rate), turn_rate)


def _stop(publisher: CommandPublisher, settings: Settings) -> None:
    period = 1.0 / settings["rate"]
    for _ in range(max(2, round(_ZERO_FOR / period))):
        if not publisher.human():
            publisher.send(0.0, 0.0)
        time.sleep(period)


if __name__ == "__main__":
    sys.exit(main())
