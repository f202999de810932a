"""``mp2a schedule``: who talks to whom."""

import argparse
from typing import Any

from mp2a.cli.options import command, positive
from mp2a.exceptions import InputError


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "schedule",
        _schedule,
        "Print who sends what to whom in which round.",
        "  mp2a schedule --n 8\n  mp2a schedule --n 8 --method relay",
    )
    parser.add_argument("--n", type=positive, default=8, help="number of robots (default: 8)")
    parser.add_argument("--method", default="kogge-stone")


def _schedule(options: argparse.Namespace) -> None:
    from mp2a.bench.simulated import SCHEDULES

    if options.method not in SCHEDULES:
        raise InputError(f"--method: got {options.method!r}, expected one of {', '.join(SCHEDULES)}")
    print(SCHEDULES[options.method](options.n))
