"""``mp2a check``: what is wrong with a scenario."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mp2a import tables
from mp2a.cli.options import bounded, command, robot_models, speed
from mp2a.exceptions import InputError
from mp2a.file_kinds import read_text

if TYPE_CHECKING:
    from mp2a.simulator.check import CheckReport


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "check",
        _check,
        "Find every mistake in a scenario: read it, then run it with ideal robots, or in the 2-D simulator (--world). "
        "Exit status 1 if one is serious.",
        "  mp2a check examples/scenarios/listing_6_3.txt\n"
        "  mp2a check dance.txt --robots tradr\n"
        "  mp2a check dance.txt --world room.toml      among walls, with LIDAR, contacts and slip\n"
        "  mp2a check dance.txt --robots R1=husky,R2=tradr --max-speed 0.45\n"
        "  mp2a check --demo > dance.txt              a scenario that explains every instruction",
    )
    parser.add_argument("file", nargs="?", type=Path, metavar="FILE", help="the scenario")
    parser.add_argument("--world", type=Path, metavar="FILE", help="simulate in this world (TOML); none: ideal robots")
    parser.add_argument("--demo", action="store_true", help="print a commented scenario")
    parser.add_argument("--robots", default="husky", help="a model for all, or ROLE=MODEL,… (default: husky)")
    parser.add_argument("--max-speed", type=speed, metavar="V", help="v_max, m/s (default: slowest robot's)")
    parser.add_argument(
        "--margin", type=bounded(0.0, 100.0, "m"), metavar="M", help="between two robots, m (default: 0.1)"
    )
    parser.add_argument("--quiet", action="store_true", help=argparse.SUPPRESS)


def _check(options: argparse.Namespace) -> int:
    from mp2a.simulator import check, read_world

    if options.demo:
        print(check.demo(), end="")
        return 0
    if options.file is None:
        raise InputError("FILE: got none, expected a scenario, or --demo")
    text, models = read_text(options.file, "a scenario", "text"), robot_models(options.robots)
    margin = check.MARGIN if options.margin is None else options.margin
    world = None if options.world is None else read_world(options.world)
    result = check.check(text, models, world, max_speed=options.max_speed, margin=margin, quiet=options.quiet)
    return _print(result, options.file, "ideal" if options.world is None else "simulated")


def _print(result: "CheckReport", path: Path, kind: str) -> int:
    serious = [finding for finding in result.findings if finding.serious]
    if result.run is not None:
        tables.show([_timeline(result)])
    for finding in result.findings:
        print(f"{'mistake' if finding.serious else 'note   '}  {finding}")
    ran = "not run" if result.run is None else f"runs {result.run.time[-1]:.1f} s with {kind} robots"
    notes = len(result.findings) - len(serious)
    counts = f"{len(serious)} mistake{'s' * (len(serious) != 1)}, {notes} note{'s' * (notes != 1)}"
    print(f"{path}: {ran}; {counts}")
    return 1 if serious else 0


def _timeline(result: "CheckReport") -> tables.Table:
    """Return the table of when each instruction began and ended, robots with the same times together."""
    from mp2a.formation.choreography.scenario import instruction_text

    spans: dict[tuple[int, str], list[float]] = {}
    instructions = {}
    for event in result.events:
        spans.setdefault((event.number, event.robot), []).append(event.time)
        instructions[event.number] = event.instruction
    rows: dict[tuple[int, tuple[float, ...]], list[str]] = {}
    for (index, robot), times in spans.items():
        rows.setdefault((index, tuple(times)), []).append(robot)
    columns = (
        tables.Column("line"),
        tables.Column("began, s", "{:.1f}".format),
        tables.Column("ended, s", "{:.1f}".format),
        tables.Column("instruction", left=True),
        tables.Column("robots", left=True),
    )
    table = []
    for (index, span), who in sorted(rows.items()):
        began, ended = (*span, None)[:2]
        table.append((instructions[index].line, began, ended, instruction_text(instructions[index]), " ".join(who)))
    return tables.Table("instructions", columns, table)
