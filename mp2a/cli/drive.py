"""``mp2a drive``: robots drive a scenario."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mp2a.cli.options import by_role, command, positive_number
from mp2a.exceptions import DependencyError, InputError, OutputError
from mp2a.file_kinds import read_text
from mp2a.mpi_environment import under_mpi
from mp2a.robots.adapters import ADAPTERS, REAL

if TYPE_CHECKING:
    from mp2a.mpi import MPI

_BAGS = ("mcap", "ros2", "ros1", "none")
"""Those of `mp2a.robots.records.bag_writer`, which is not loaded to parse options, and none."""
_WRONG = 2
"""Exit status if something is wrong or missing, as of `mp2a.cli`."""


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "drive",
        _drive,
        "Drive robots through a scenario. Without --armed nothing is sent to a real robot: it prints what would be.\n"
        "Ends with a table of who arrived; exit status 3 if a robot did not, or touched something.",
        "  mp2a drive dance.txt                                      ideal HUSKYs, prints commands\n"
        "  mp2a drive dance.txt --robots robots.toml --adapter simulator --record results/drive\n"
        "  mp2a drive dance.txt --robots robots.toml --recording results/drive  what would be sent on what was seen\n"
        "  mp2a run -n 4 mp2a drive dance.txt --robots robots.toml     a rank a robot, by the file's adapter\n"
        "  mp2a run -n 4 mp2a drive dance.txt --robots robots.toml --armed\n"
        "  mp2a drive dance.txt --robots robots.toml --role R1 --armed    on each robot, without MPI between them",
    )
    parser.add_argument("scenario", type=Path, metavar="SCENARIO", help="a choreography; see mp2a check")
    parser.add_argument("--robots", default="husky", help="a robots file (.toml), a model for all, or ROLE=MODEL,…")
    parser.add_argument(
        "--adapter", choices=tuple(ADAPTERS), help="what the robots are (default: the file's, else dry)"
    )
    parser.add_argument("--armed", action="store_true", help="send commands to real robots")
    parser.add_argument("--role", help="drive this robot alone, and start with the others over ROS topics")
    parser.add_argument("--max-speed", type=positive_number, metavar="V", help="v_max, m/s (default: slowest robot's)")
    parser.add_argument(
        "--longest", type=positive_number, metavar="S", default=3600.0, help="end after S s in any case"
    )
    parser.add_argument("--record", type=Path, metavar="DIR", help="write ROLE.csv and a bag of every tick")
    parser.add_argument(
        "--bag",
        choices=_BAGS,
        help="with --record: rosbag2 in MCAP (for Foxglove), rosbag2 in SQLite, rosbag, or no bag (default: mcap)",
    )
    parser.add_argument(
        "--recording", type=Path, metavar="PATH", help="robots out of this bag, or folder of bags: adapter recording"
    )
    parser.add_argument(
        "--begin",
        type=positive_number,
        metavar="S",
        help="begin S s into the recording (default: as soon as it has pose and odometry)",
    )
    parser.add_argument("--quiet", action="store_true", help="do not print commands")


def _drive(options: argparse.Namespace) -> int:
    """Drive; a rank that fails ends all, and every watchdog stops its robot."""
    comm = None
    if under_mpi():
        from mp2a.mpi import MPI
        from mp2a.robots.launcher import end_with_launcher

        end_with_launcher()
        comm = MPI.COMM_WORLD if MPI.COMM_WORLD.size > 1 else None
    if comm is None:
        return _drive_as(options, None)
    try:
        return _drive_as(options, comm)
    except (InputError, DependencyError, OutputError) as error:
        # Often the same on all ranks; one that fails alone must not leave the others waiting.
        print(f"mp2a: rank {comm.rank}: {error}", file=sys.stderr, flush=True)
        comm.Abort(2)
        raise
    except BaseException:
        import traceback

        traceback.print_exc()
        comm.Abort(1)
        raise


def _drive_as(options: argparse.Namespace, comm: "MPI.Comm | None") -> int:
    from mp2a.cli.outcome import show_outcomes
    from mp2a.formation.choreography.reading import parse
    from mp2a.formation.outcome import exit_status
    from mp2a.robots.drive_setup import roles_of_this_process, set_up_drive
    from mp2a.robots.driver import run_drivers
    from mp2a.robots.sender import WatchdogGoneError

    scenario = parse(read_text(options.scenario, "a scenario", "text"))
    robots = _robots(options, scenario.robots)
    roles = roles_of_this_process(scenario, robots.adapter, options.role, comm)
    if options.armed and robots.adapter not in REAL:
        raise InputError(f"--armed: got adapter {robots.adapter}, expected one of {', '.join(REAL)}")
    recorder, lost = _recorder(options, robots, roles), ""
    printer = _Printer(robots, options.armed, options.quiet)
    try:
        setup = set_up_drive(scenario, robots, roles, comm, armed=options.armed, max_speed=options.max_speed)

        def tell(driver: Any, tick: Any) -> None:
            printer.tell(driver.role, tick)
            if recorder is not None:
                recorder.add(driver.role, setup.epochs[driver.role] + round(1e9 * tick.time), tick)

        def outcomes(error: str = "") -> Any:
            touched = setup.adapter.touched()
            return [driver.outcome(touched.get(driver.role, ()), error) for driver in setup.drivers]

        try:
            run_drivers(setup.drivers, setup.clock, options.longest, tell)
        except WatchdogGoneError as error:
            show_outcomes(outcomes(f"{error}"), printer.title(len(roles)))
            raise
    finally:
        if recorder is not None:
            lost = recorder.close()
    everyone = outcomes() if comm is None else _gather(comm, outcomes())
    failed = exit_status(everyone)
    if comm is None or comm.rank == 0:
        show_outcomes(everyone, printer.title(len(everyone)))
    for line in setup.adapter.report(not failed):
        print(line, flush=True)
    if lost:  # no exception: under mpirun it would end robots that still drive
        print(f"mp2a: --record: {lost}", file=sys.stderr, flush=True)
        return _WRONG
    return failed


def _gather(comm: "MPI.Comm", own: Any) -> Any:
    """Return the outcomes of all robots, once all have ended; until then this rank sleeps, for the others drive."""
    from mp2a.transport.wait import wait_unless

    wait_unless(comm.Ibarrier(), lambda: False)
    return [outcome for outcomes in comm.allgather(own) for outcome in outcomes]


def _recorder(options: argparse.Namespace, robots: Any, roles: Any) -> Any:
    """Start what writes the record, if there is to be one."""
    if options.record is None:
        if options.bag is not None:
            raise InputError(f"--bag: got {options.bag} without --record, expected --record DIR as well")
        return None
    from mp2a.robots.records.recorder import DriveRecorder, RecordConfig

    real = robots.adapter in REAL
    unarmed = ", not armed: commands are not sent" if real and not options.armed else ""
    headline = f"starts, adapter {robots.adapter}{unarmed}"
    configs = {role: robots.configs[role] for role in roles}
    return DriveRecorder(RecordConfig(options.record, options.bag or _BAGS[0], configs, headline), wait=not real)


def _robots(options: argparse.Namespace, roles: Any) -> Any:
    from mp2a.robots.robots_file import read_robots, robots_of

    if options.robots.endswith(".toml"):
        robots = read_robots(options.robots, roles)
    else:
        models = by_role(options.robots) if "=" in options.robots else dict.fromkeys(roles, options.robots)
        robots = robots_of({"robots": {role: {"model": model} for role, model in models.items()}}, roles, "--robots")
    adapter = options.adapter or robots.adapter
    if options.recording is not None:
        if options.adapter not in (None, "recording"):
            raise InputError(f"--recording: got adapter {options.adapter}, expected recording")
        adapter, robots = "recording", robots._replace(recording=options.recording)
    if options.begin is not None and adapter != "recording":
        raise InputError(f"--begin: got adapter {adapter}, expected recording")
    return robots._replace(adapter=adapter, begin=options.begin)


class _Printer:
    """Prints commands twice a second, at once when something happens, and the zero that stops a robot."""

    def __init__(self, robots: Any, armed: bool, quiet: bool) -> None:
        self._topics = {role: config.command_topic for role, config in robots.configs.items()}
        self._adapter, self._quiet = robots.adapter, quiet
        self._verb = "sent" if armed else "would be sent"
        self._next: dict[str, float] = {}
        self._flags: dict[str, tuple[bool, ...]] = {}
        self._time = 0.0

    def title(self, robots: int) -> str:
        """Return the headline of the summary of so many robots."""
        return f"{robots} robot{'s' * (robots != 1)}, {self._time:.1f} s, adapter {self._adapter}"

    def tell(self, role: str, tick: Any) -> None:
        """Print a tick of a robot, if there is something to say."""
        self._time, flags = tick.time, tick.flags
        unchanged = flags == self._flags.get(role, flags)
        if self._quiet or (tick.time < self._next.get(role, 0.0) and unchanged and not tick.stands):
            return
        self._next[role], self._flags[role] = tick.time + 0.5, flags
        names = ("blocked", "ERROR STATE", "human drives", "done")
        said = ", ".join(name for name, flag in zip(names, flags, strict=True) if flag)
        print(
            f"{role:<8} {tick.time:8.2f} s  {self._topics[role]}  linear.x {tick.command[0]:6.3f} m/s  "
            f"angular.z {tick.command[1]:6.3f} rad/s  {self._verb}{'  ' + said if said else ''}",
            flush=True,
        )
