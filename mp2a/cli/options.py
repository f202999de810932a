"""What the subcommands share: options, how to read them, progress, being a rank."""

import argparse
import sys
import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

from mp2a.bench.settings import ERROR, PROGRESS
from mp2a.exceptions import DependencyError, InputError, OutputError
from mp2a.network import EmulatedNetwork, parse

if TYPE_CHECKING:
    from mp2a.formation.robot_models import RobotModel

T = TypeVar("T")


def command(
    commands: Any, name: str, run: Callable[[argparse.Namespace], int | None], summary: str, examples: str
) -> argparse.ArgumentParser:
    """Add a subcommand with a summary and examples; ``run`` gets the options and may return an exit status."""
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=summary,
        description=summary,
        epilog=f"examples:\n{examples}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    return parser


def as_rank(run: Callable[[argparse.Namespace], T], options: argparse.Namespace) -> T:
    """Return the result of a rank's part; what goes wrong on one rank alone ends all, for the others would wait for it.

    What only one rank does, after the last message, is better done outside: its errors are its own.
    """
    from mp2a.cores import restore_timer_slack
    from mp2a.mpi import MPI, check_launcher

    check_launcher()
    restore_timer_slack()
    try:
        return run(options)
    except (InputError, DependencyError):
        raise  # the same on every rank
    except OutputError as error:
        print(f"{ERROR}{error}", file=sys.stderr, flush=True)
        MPI.COMM_WORLD.Abort(2)
        raise  # never reached: Abort ends the process
    except BaseException:
        traceback.print_exc()
        MPI.COMM_WORLD.Abort(1)
        raise  # never reached: Abort ends the process


def add_run_options(
    command: argparse.ArgumentParser, samples: int | None = 2000, explained: str = "%(default)s"
) -> None:
    """Add the options of what is run; ``explained`` says what the default number of samples is."""
    command.add_argument(
        "--samples", type=positive, default=samples, help=f"samples of the trajectory (default: {explained})"
    )
    command.add_argument("--seed", type=int, default=0, help="of the random chain and its motion (default: 0)")
    command.add_argument("--quiet", action="store_true", help=argparse.SUPPRESS)


def add_format(command: argparse.ArgumentParser) -> None:
    """Add the option of how tables are written."""
    from mp2a.tables import STYLES

    command.add_argument(
        "--format", choices=tuple(STYLES), default="text",
        help="how tables are written; csv and json have plain numbers in the units of the SI (default: text)",
    )  # fmt: skip


def add_network(command: argparse.ArgumentParser) -> None:
    """Add the constants of the cost model."""
    group = command.add_argument_group("constants of eq. 11-13 (bench measures those that are not given)")
    group.add_argument("--serial-time", type=positive_number, metavar="T_s", help="O(n) time of all samples, s")
    group.add_argument("--latency", type=positive_number, metavar="L_a", help="of a message, s")
    group.add_argument("--speed", type=positive_number, metavar="N_TS", help="of the network, bit/s")
    group.add_argument(
        "--bits", type=positive_number, default=64.0, help="bits a number; eq. 13 prints 2 (default: 64)"
    )


def ranks(text: str) -> list[int]:
    """Read numbers of ranks, as in ``1,2,8``."""
    return [positive(word) for word in text.split(",")]


def words(text: str) -> tuple[str, ...]:
    """Read words, as in ``sweep,compact``."""
    return tuple(text.split(","))


def network(text: str) -> EmulatedNetwork:
    """Read a network, as in ``5ms,54Mbit``."""
    try:
        return parse(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def positive(text: str) -> int:
    """Read a whole number of at least 1."""
    if not text.strip().isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a whole number of at least 1")
    return int(text)


def positive_number(text: str) -> float:
    """Read a positive number."""
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    if not 0 < number < float("inf"):
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a positive number")
    return number


def bounded(least: float, most: float, unit: str) -> Callable[[str], float]:
    """Return a reader of numbers between two bounds, which stand in the error."""

    def read(text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            number = float("nan")
        if not least <= number <= most:
            raise argparse.ArgumentTypeError(f"got {text!r}, expected a number from {least:g} to {most:g} {unit}")
        return number

    return read


speed = bounded(1e-3, 100.0, "m/s")
"""Read a speed of a robot."""


def robot_models(text: str) -> "RobotModel | dict[str, RobotModel]":
    """Read models of robots, as in ``husky`` or ``R1=husky,R2=tradr``."""
    from mp2a.formation.robot_models import ROBOTS

    def model(name: str) -> "RobotModel":
        if name.lower() not in ROBOTS:
            raise InputError(f"--robots: got model {name!r}, expected one of {', '.join(ROBOTS)}")
        return ROBOTS[name.lower()]

    return {role: model(name) for role, name in by_role(text).items()} if "=" in text else model(text)


def by_role(text: str) -> dict[str, str]:
    """Read what each role has, as in ``R1=husky,R2=tradr``."""
    return {role: name for role, _, name in (part.partition("=") for part in text.split(","))}


def say_line(what: str) -> None:
    """Tell the launcher what this rank does."""
    print(f"{PROGRESS}{what}", flush=True)


def progress(quiet: bool) -> Any:
    """Context whose value is called with what is being done: a spinner on a terminal, nothing elsewhere."""
    from contextlib import contextmanager

    from rich.console import Console

    @contextmanager
    def shown() -> Any:
        console = Console(stderr=True)
        if quiet or not console.is_terminal:
            yield lambda what: None
            return
        with console.status("starting") as status:
            yield status.update

    return shown()
