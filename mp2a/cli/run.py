"""``mp2a run``: a program of one's own on many ranks of this machine."""

import argparse
import os
import shutil
import sys
from pathlib import Path
from typing import Any

from mp2a import launch
from mp2a.cli.options import command, positive
from mp2a.exceptions import InputError
from mp2a.mpi_environment import under_mpi


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "run",
        _run,
        "Run a program on many ranks of this machine: mpirun of this Python's MPI, with more ranks than cores where "
        "asked, as root too, one thread a rank.",
        "  mp2a run -n 8 examples/formation.py       a Python file; a rank that raises ends all\n"
        "  mp2a run -n 8 mp2a march --obstacle 10,0,0.5\n"
        "  mp2a run -n 8 python -m mpi4py -m robots.main",
    )
    parser.add_argument("-n", "--ranks", type=positive, required=True, metavar="N", help="number of ranks to start")
    parser.add_argument(
        "program", metavar="PROGRAM", help="a Python file, or a program beside this Python or on the path"
    )
    parser.add_argument("arguments", nargs=argparse.REMAINDER, metavar="…", help="the program's own arguments")


def _run(options: argparse.Namespace) -> int:
    if under_mpi():
        raise InputError("mp2a run: given under mpirun, expected one or the other")
    program = [*_find(options.program), *options.arguments]
    status: int = launch.run(options.ranks, program, stdin=None).returncode
    return status


def _find(program: str) -> list[str]:
    """Return the words that start a program."""
    if program.endswith(".py"):
        if not Path(program).is_file():
            raise InputError(f"PROGRAM: {program} is no file")
        return [sys.executable, "-m", "mpi4py", program]
    beside = os.path.dirname(sys.executable)  # noqa: PTH120 - the link is not followed, out of a virtual environment
    path = shutil.which(program, path=os.pathsep.join((beside, os.environ.get("PATH", os.defpath))))
    if path is None:
        raise InputError(
            f"PROGRAM: got {program}, expected a Python file (….py) or a program beside this Python or on the path"
        )
    return [path]
