"""``mp2a march``: robots in the 2-D simulator, by a choreography or by dynamics, in one process or a robot a rank."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from mp2a.cli.options import WIDTH, as_rank, command, positive, positive_number, words
from mp2a.cli.stage import Plan, danced, marched
from mp2a.exceptions import DependencyError, InputError
from mp2a.mpi_environment import under_mpi

if TYPE_CHECKING:
    from mp2a.formation.record import Record
    from mp2a.mpi import MPI
    from mp2a.simulator import Event, Recorder, Recording, Simulation
    from mp2a.spatial import Array

_BY_DYNAMICS: dict[str, Any] = {
    "n": None, "shape": "line", "spacing": 2.0, "path": ((0.0, 0.0), (20.0, 0.0), (20.0, 15.0)), "radius": 3.0,
    "spline": False, "speed": None,
}  # fmt: skip
"""What only a march by dynamics has, and what it is if not given."""
_DANCED: dict[str, Any] = {"max_speed": None, "start": (0.0, 0.0, 0.0)}
"""What only a choreography has."""
_TOLD = 12
"""Events that are printed; the recording has all."""


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "march",
        _march,
        "Robots in the 2-D simulator, by a choreography (FILE) or by dynamics along a path that only the leader knows. "
        "Writes pictures, an animation and recordings.",
        "  mp2a march examples/scenarios/listing_7_1.txt --world examples/worlds/thesis.toml --out results/7_1\n"
        '  mp2a march --n 8 --path "0,0 20,0 20,15" --obstacle 10,0,0.5 --out results/line\n'
        "  mp2a march --shape triangle --n 6 --spacing 3\n"
        "  mp2a run -n 8 mp2a march --obstacle 10,0,0.5         a rank a robot, the same result",
    )
    parser.add_argument("file", nargs="?", type=Path, metavar="FILE", help="a choreography; none: by dynamics")
    parser.add_argument("--world", type=Path, metavar="FILE", help="walls and obstacles, TOML (default: nothing)")
    parser.add_argument(
        "--obstacle", type=_disc, action="append", default=[], metavar="X,Y,R", help="a disc, m; any number of them"
    )
    parser.add_argument("--robots", default="husky", help="a model for all, or ROLE=MODEL,… (default: husky)")
    parser.add_argument("--seconds", type=positive_number, help="how long at most (default: until all have finished)")
    parser.add_argument(
        "--slip", choices=("none", "mild", "hard"), default="mild", help="of turning wheels (default: mild)"
    )
    parser.add_argument("--method", default="sweep", help="of the scan (default: sweep)")
    parser.add_argument("--out", type=Path, default=Path("results/march"), help="files to write, without an ending")
    parser.add_argument(
        "--write", type=words, default=tuple(_WRITERS), metavar=",".join(_WRITERS), help="which (default: all)"
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    dance = parser.add_argument_group("a choreography")
    dance.add_argument("--max-speed", type=positive_number, metavar="V", help="v_max, m/s (default: slowest robot's)")
    dance.add_argument(
        "--start", type=_pose, metavar="X,Y,DEG",
        help="where its virtual leader begins, m and degrees (default: 0,0,0)",
    )  # fmt: skip
    dynamics = parser.add_argument_group("by dynamics")
    dynamics.add_argument("--n", type=positive, help="how many robots (default: 8, or one a rank)")
    dynamics.add_argument("--shape", help="line (follow the leader, default), row, column, triangle, …")
    dynamics.add_argument("--spacing", type=positive_number, help="between neighbours, m (default: 2)")
    dynamics.add_argument("--path", type=_points, metavar='"X,Y X,Y …"', help="waypoints of the leader, m")
    dynamics.add_argument("--radius", type=positive_number, help="of rounded corners, m (default: 3)")
    dynamics.add_argument("--spline", action="store_true", default=None, help="a smooth curve through the waypoints")
    dynamics.add_argument(
        "--speed", type=positive_number, help="of the leader at most, m/s (default: 70 %% of a robot's)"
    )


def _march(options: argparse.Namespace) -> None:
    _settle_options(options)
    if under_mpi():
        as_rank(_march_here, options)
        return
    from mp2a.simulator import Recorder, run

    plan = danced(options) if options.file else marched(options, None)
    simulation = _simulation(options, plan)
    recorder = Recorder(simulation)
    with plan.robots(None) as robots:

        def controller(sensed: Any) -> Any:
            commands = robots.step(sensed)
            return None if robots.done else commands

        run(simulation, controller, plan.until, recorder, quiet=options.quiet)
    _keep(options, recorder, [_Part.of(robots)])


def _march_here(options: argparse.Namespace) -> None:
    """March as one rank of a running mpirun; rank 0 has the world, too."""
    from mp2a.mpi import MPI
    from mp2a.simulator.ranks import perform

    comm = MPI.COMM_WORLD
    plan, simulation = _agree(comm, options)
    with plan.robots(comm) as robots:
        if simulation is None:
            perform(comm, robots, None)
            comm.gather(_Part.of(robots))
            return
        from mp2a.simulator import Recorder, run

        recorder = Recorder(simulation)
        perform(comm, robots, lambda everyone: run(simulation, everyone, plan.until, recorder, quiet=options.quiet))
        parts = comm.gather(_Part.of(robots))
    assert parts is not None
    _keep(options, recorder, parts)


class _Part(NamedTuple):
    """What the robots of a process leave behind."""

    leaders: "Array"
    events: "list[Event]"
    record: "Record | None"

    @classmethod
    def of(cls, robots: Any) -> "_Part":
        """Take it from what drove them."""
        import numpy as np

        return cls(np.array(robots.leaders), robots.events, getattr(robots, "record", None))


def _agree(comm: "MPI.Intracomm", options: argparse.Namespace) -> "tuple[Plan, Simulation | None]":
    """Plan on rank 0 and tell all; the path is the leader's alone."""
    from mp2a.transport.agreement import raise_together

    plan: Any = None
    simulation: Any = None
    wrong: InputError | None = None
    if comm.rank == 0:
        try:
            plan = danced(options) if options.file else marched(options, comm.size)
            if len(plan.models) != comm.size:
                raise InputError(f"FILE: got {len(plan.models)} robots for {comm.size} ranks, expected one a rank")
            simulation = _simulation(options, plan)
        except InputError as error:
            wrong = error
    raise_together(comm, wrong)
    told = comm.bcast(plan if options.file or plan is None else plan._replace(path=None))
    return (told if plan is None else plan), simulation


def _settle_options(options: argparse.Namespace) -> None:
    """Fill in what was not given, and refuse what does not belong together."""
    foreign, why = (_BY_DYNAMICS, "with a FILE") if options.file else (_DANCED, "without a FILE")
    for name in foreign:
        if getattr(options, name) is not None:
            raise InputError(f"--{name.replace('_', '-')}: got {getattr(options, name)} {why}, expected none")
    for name, value in (_BY_DYNAMICS | _DANCED).items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    unknown = [name for name in options.write if name not in _WRITERS]
    if unknown:
        raise InputError(f"--write: got {unknown[0]!r}, expected one of {', '.join(_WRITERS)}")


def _simulation(options: argparse.Namespace, plan: Plan) -> "Simulation":
    from mp2a.simulator import Simulation, World, disc, read_world
    from mp2a.simulator.drive import SLIPS

    world = World() if options.world is None else read_world(options.world)
    if options.obstacle:
        discs = [disc((x, y), radius) for x, y, radius in options.obstacle]
        world = World(world.walls, [*world.obstacles, *discs], world.name)
    try:
        options.out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out: {options.out} cannot be written ({error.strerror})") from error
    return Simulation(world, plan.models, plan.poses, slip=SLIPS[options.slip])


def _keep(options: argparse.Namespace, recorder: "Recorder", parts: "list[_Part]") -> None:
    """Write and print what the robots left behind."""
    import numpy as np

    from mp2a.formation.record import save, together

    leaders = np.concatenate([part.leaders for part in parts], axis=1)
    recording = recorder.recording(leaders, [event for part in parts for event in part.events])
    written = []
    for name in options.write:
        try:
            written.append(_WRITERS[name](recording, options))
        except DependencyError as error:
            if not options.quiet:
                print(f"no {name}: {error}")
    records = [part.record for part in parts if part.record is not None]
    if records:
        about = {name: getattr(options, name) for name in _BY_DYNAMICS} | {
            "n": len(recording.models), "method": options.method,
        }  # fmt: skip
        written.append(options.out.with_name(f"{options.out.name}-scan.npz"))
        save(written[-1], together(records), about)
    if not options.quiet:
        _show(recording, options, written)


def _named(options: argparse.Namespace, ending: str) -> Path:
    out: Path = options.out.with_name(options.out.name + ending)
    return out


def _paths(recording: "Recording", options: argparse.Namespace) -> Path:
    from mp2a.plot.march import march

    return march(recording, _named(options, ".png"))


def _speeds(recording: "Recording", options: argparse.Namespace) -> Path:
    from mp2a.plot.speeds import speeds

    return speeds(recording, _named(options, "-speeds.png"))


def _animation(recording: "Recording", options: argparse.Namespace) -> Path:
    from mp2a.plot.animation import animation

    return animation(recording, _named(options, ".gif"), quiet=options.quiet)


_WRITERS: "dict[str, Callable[[Recording, argparse.Namespace], Path]]" = {
    "npz": lambda recording, options: recording.save(_named(options, ".npz")),
    "mcap": lambda recording, options: recording.save(_named(options, ".mcap")),
    "paths": _paths,
    "speeds": _speeds,
    "animation": _animation,
}
"""What is written of a march. A new kind is a line here."""


def _show(recording: "Recording", options: argparse.Namespace, written: list[Path]) -> None:
    import numpy as np
    from rich.console import Console
    from rich.table import Table

    n = len(recording.models)
    way = np.hypot(*np.moveaxis(np.diff(recording.poses[..., :2], axis=0), -1, 0)).sum(axis=0)
    off = np.abs(recording.gaps - recording.leaders[..., 2])
    table = Table(title=f"{n} robots, {recording.times[-1]:.1f} s, simulated")
    for heading in ("robot", "way, m", "ends at, m", "fastest, m/s", "off its distance at most, m"):
        table.add_column(heading, justify="right")
    for i in range(n):
        x, y, _ = recording.poses[-1, i]
        fastest, most = np.abs(recording.twists[:, i, 0]).max(), np.nanmax(off[:, i])
        table.add_row(f"{i + 1}", f"{way[i]:.2f}", f"{x:.2f}, {y:.2f}", f"{fastest:.2f}", f"{most:.2f}")
    console = Console(width=WIDTH, highlight=False)
    console.print(table)
    for event in recording.events[:_TOLD]:
        console.print(f"{event.time:6.1f} s  {event.text}")
    if len(recording.events) > _TOLD:
        console.print(f"and {len(recording.events) - _TOLD} more events, see the recording")
    for path in written:
        console.print(str(path), soft_wrap=True)


def _numbers(text: str, count: int) -> tuple[float, ...]:
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected {count} numbers with commas between them")
    return numbers


def _points(text: str) -> tuple[tuple[float, ...], ...]:
    return tuple(_numbers(word, 2) for word in text.split())


def _disc(text: str) -> tuple[float, ...]:
    return _numbers(text, 3)


def _pose(text: str) -> tuple[float, ...]:
    return _numbers(text, 3)
