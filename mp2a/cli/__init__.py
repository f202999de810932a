"""The ``mp2a`` command, a file a subcommand. Each imports what it runs when it runs."""

import argparse
import sys
import time
from collections.abc import Sequence

from mp2a import __version__
from mp2a.bench.settings import ERROR
from mp2a.cli import bench, check, cost, drive, march, plot, run, schedule, trace
from mp2a.exceptions import DependencyError, InputError, OutputError
from mp2a.mpi_environment import rank_info

COMMANDS = {
    module.__name__.rpartition(".")[2]: module
    for module in (bench, check, plot, cost, schedule, trace, march, drive, run)
}
"""The module of each subcommand, by its name."""
_INTERRUPTED = 130
_HEAD_START = 1.0
_EXAMPLES = """examples:
  mp2a bench --ranks 1,2,4,8                         time all methods, one rank a robot
  mp2a plot time results/bench.json                  draw what was measured
  mp2a march --n 8 --obstacle 10,0,0.5               robots in the simulator
  mp2a bench --help                                  options and examples of a command"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        return options.run(options) or 0
    except (InputError, DependencyError) as error:
        return _fail(str(error))
    except OutputError as error:
        if error.unsaved:
            print(error.unsaved)  # it would be lost otherwise
        return _fail(str(error))
    except KeyboardInterrupt:
        print("interrupted; what was measured is kept", file=sys.stderr)
        return _INTERRUPTED
    except BrokenPipeError:
        return 0


def _fail(message: str) -> int:
    # Under mpirun every rank has the same error, and one of them says it.
    info = rank_info()
    if info is None or info.rank == 0:
        print(f"{ERROR}{message}", file=sys.stderr)
    else:
        time.sleep(_HEAD_START)  # mpirun ends all ranks once one has failed, and the first has not spoken yet
    return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="mp2a",
        description="A formation of robots computes its own dynamics in O(log2 n) exchanges.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"mp2a {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for module in COMMANDS.values():
        module.add(commands)
    return parser
