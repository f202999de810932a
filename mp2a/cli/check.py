"""``mp2a check``: what is wrong with a scenario."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mp2a.cli.options import WIDTH, bounded, command, progress, read_scenario, robot_models, speed
from mp2a.exceptions import InputError

if TYPE_CHECKING:
    from mp2a.formation.choreography.check import CheckReport


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
    from mp2a.formation.choreography import check

    if options.demo:
        print(check.demo(), end="")
        return 0
    if options.file is None:
        raise InputError("FILE: got none, expected a scenario, or --demo")
    text, models = read_scenario(options.file), robot_models(options.robots)
    margin = check.MARGIN if options.margin is None else options.margin
    with progress(options.quiet) as say:
        common: dict[str, Any] = {
            "max_speed": options.max_speed, "margin": margin, "tell": lambda time: say(f"running, {time:.0f} s")
        }  # fmt: skip
        if options.world is None:
            result = check.check(text, models, **common)
        else:
            from mp2a.simulator import read_world
            from mp2a.simulator.check import report_simulated

            result = report_simulated(text, models, read_world(options.world), **common)
    return _print(result, options.file, "ideal" if options.world is None else "simulated")


def _print(result: "CheckReport", path: Path, kind: str) -> int:
    from rich.console import Console

    serious = [finding for finding in result.findings if finding.serious]
    console = Console(width=WIDTH, highlight=False)
    if result.run is not None:
        console.print(_timeline(result))
    for finding in result.findings:
        console.print(f"{'mistake' if finding.serious else 'note   '}  {finding}", markup=False, soft_wrap=True)
    ran = "not run" if result.run is None else f"runs {result.run.time[-1]:.1f} s with {kind} robots"
    notes = len(result.findings) - len(serious)
    counts = f"{len(serious)} mistake{'s' * (len(serious) != 1)}, {notes} note{'s' * (notes != 1)}"
    console.print(f"{path}: {ran}; {counts}", markup=False, soft_wrap=True)
    return 1 if serious else 0


def _timeline(result: "CheckReport") -> Any:
    """Build the table of when each instruction began and ended, robots with the same times together."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from mp2a.formation.choreography.scenario import as_text

    table = Table(box=box.SIMPLE)
    for heading in ("line", "instruction", "robots", "began, s", "ended, s"):
        table.add_column(heading, justify="right" if heading[-1] == "s" and "," in heading else "left")
    spans: dict[tuple[int, str], list[float]] = {}
    said = {}
    for event in result.events:
        spans.setdefault((event.number, event.robot), []).append(event.time)
        said[event.number] = event.instruction
    rows: dict[tuple[int, tuple[float, ...]], list[str]] = {}
    for (index, robot), times in spans.items():
        rows.setdefault((index, tuple(times)), []).append(robot)
    for (index, span), who in sorted(rows.items()):
        ended = f"{span[1]:.1f}" if len(span) > 1 else "-"
        line = said[index].line
        table.add_row(str(line), Text(as_text(said[index])), Text(" ".join(who)), f"{span[0]:.1f}", ended)
    return table
