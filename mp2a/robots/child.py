"""Processes of our own that outlive the planner: the watchdog and the one that writes records."""

import os
import select
import subprocess
import sys
import time

READY = "ready\n"
"""What such a process says once it can work; if it cannot, it says why instead."""
_PATIENCE = 30.0
"""s for the process to be there."""


def start_child(module: str, *arguments: str) -> "subprocess.Popen[bytes]":
    """Run a module of ours in a process, with pipes to its input and from its output.

    It gets a session of its own: what ends the planner's group must not end it before its work is done.
    """
    return subprocess.Popen(
        [sys.executable, "-m", module, *arguments],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, start_new_session=True,
    )  # fmt: skip


def wait_until_ready(process: "subprocess.Popen[bytes]") -> str:
    """Return an empty text once the process is ready; else end it, and return why it is not."""
    assert process.stdout is not None
    output = process.stdout.fileno()
    deadline, said = time.monotonic() + _PATIENCE, b""
    while b"\n" not in said:
        left = deadline - time.monotonic()
        new = os.read(output, 4096) if left > 0 and select.select([output], [], [], left)[0] else b""
        if not new:
            break
        said += new
    if said.decode() == READY:
        return ""
    process.kill()
    process.wait()
    return said.decode().strip() or f"it was not ready within {_PATIENCE:g} s"
