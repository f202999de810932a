"""``mp2a schedule``: who talks to whom."""

import argparse
from typing import Any

from mp2a.cli.options import add_format, command, positive
from mp2a.exceptions import InputError


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "schedule",
        _schedule,
        "Print who sends what to whom in which round.",
        "  mp2a schedule --n 8\n"
        "  mp2a schedule --n 8 --method pipeline\n"
        "  mp2a schedule --n 512 --method sweep --format csv       a line a message",
    )
    parser.add_argument("--n", type=positive, default=8, help="number of robots (default: 8)")
    parser.add_argument("--method", default="kogge-stone", help="method or pipeline (default: kogge-stone)")
    add_format(parser)


def _schedule(options: argparse.Namespace) -> None:
    from mp2a.bench.simulated import SCHEDULES
    from mp2a.tables import Column, Table, show

    if options.method not in SCHEDULES:
        raise InputError(f"--method: got {options.method!r}, expected one of {', '.join(SCHEDULES)}")
    rows: list[list[Any]] = []
    for round_ in SCHEDULES[options.method](options.n).rounds:
        for kind, source, target in round_.transfers:
            about = [round_.recurrence, round_.index, kind]
            pairs = [(s + 1, t + 1) for s, t in zip(source.tolist(), target.tolist(), strict=True)]
            if options.format in ("csv", "json"):
                rows += [[*about, *pair] for pair in pairs]
            else:
                rows.append([*about, "  ".join(f"{s}→{t}" for s, t in pairs)])
    ends = ["from", "to"] if options.format in ("csv", "json") else ["messages"]
    columns = [Column("recurrence", left=True), Column("round"), Column("kind", left=True)]
    columns += [Column(end, left=end == "messages") for end in ends]
    show([Table(f"{options.method}, n = {options.n}: who sends to whom", columns, rows, keys=3)], style=options.format)
