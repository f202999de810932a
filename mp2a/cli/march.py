"""``mp2a march``: robots in the 2-D simulator, by a choreography or by dynamics, in one process or a robot a rank."""

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mp2a.cli.march_setup import MarchSetup, set_up_march
from mp2a.cli.options import as_rank, bounded, command, positive, speed, words
from mp2a.exceptions import DependencyError, InputError, OutputError
from mp2a.formation.outcome import Outcome, exit_status
from mp2a.mpi_environment import under_mpi

if TYPE_CHECKING:
    from mp2a.formation.record import FormationRecord
    from mp2a.mpi import MPI
    from mp2a.simulator import Controller, Recording, RunRecorder, Simulation
    from mp2a.simulator.driver import Ending

_FAR = 1e5
"""m: coordinates beyond it are taken for a mistake, as in world files."""
_BY_DYNAMICS: dict[str, Any] = {
    "n": None, "shape": "line", "spacing": 2.0, "path": ((0.0, 0.0), (20.0, 0.0), (20.0, 15.0)), "radius": 3.0,
    "spline": False, "speed": None,
}  # fmt: skip
"""Options that only a march by dynamics has, and their defaults."""
_CHOREOGRAPHY: dict[str, Any] = {"max_speed": None, "start": (0.0, 0.0, 0.0)}
"""Options that only a choreography has."""
_ENDINGS = {"npz": ".npz", "mcap": ".mcap", "paths": ".png", "speeds": "-speeds.png", "animation": ".gif"}
"""What is written of a march, and how its file's name ends."""
_PRINTED = 12
"""Events that are printed; the recording has all."""
_NOT_WRITTEN = 2
"""Exit status if a file could not be written, as of whatever is wrong or missing."""


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "march",
        _march,
        "Robots in the 2-D simulator, by a choreography (FILE) or by dynamics along a path that only the leader knows. "
        "Writes pictures, an animation and recordings. Exit status 3 if a robot did not arrive or touched something.",
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
    parser.add_argument(
        "--seconds", type=bounded(0.1, 1e5, "s"), help="how long at most (default: until all have finished)"
    )
    parser.add_argument(
        "--slip", choices=("none", "mild", "hard"), default="mild", help="of turning wheels (default: mild)"
    )
    parser.add_argument("--method", default="sweep", help="of the scan (default: sweep)")
    parser.add_argument("--out", type=Path, default=Path("results/march"), help="files to write, without an ending")
    parser.add_argument(
        "--write", type=words, default=tuple(_ENDINGS), metavar=",".join(_ENDINGS), help="which (default: all)"
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    choreography = parser.add_argument_group("a choreography")
    choreography.add_argument("--max-speed", type=speed, metavar="V", help="v_max, m/s (default: slowest robot's)")
    choreography.add_argument(
        "--start", type=_pose, metavar="X,Y,DEG",
        help="where its virtual leader begins, m and degrees (default: 0,0,0)",
    )  # fmt: skip
    length = bounded(1e-3, _FAR, "m")
    dynamics = parser.add_argument_group("by dynamics")
    dynamics.add_argument("--n", type=positive, help="how many robots (default: 8, or one a rank)")
    dynamics.add_argument("--shape", help="line (follow the leader, default), row, column, triangle, …")
    dynamics.add_argument("--spacing", type=length, help="between neighbours, m (default: 2)")
    dynamics.add_argument("--path", type=_points, metavar='"X,Y X,Y …"', help="waypoints of the leader, m")
    dynamics.add_argument("--radius", type=length, help="of rounded corners, m (default: 3)")
    dynamics.add_argument("--spline", action="store_true", default=None, help="a smooth curve through the waypoints")
    dynamics.add_argument("--speed", type=speed, help="of the leader at most, m/s (default: 70 %% of a robot's)")


def _march(options: argparse.Namespace) -> int | None:
    _settle_options(options)
    return as_rank(_march_as_rank, options) if under_mpi() else _march_with(options, None)


def _march_as_rank(options: argparse.Namespace) -> int:
    from mp2a.mpi import MPI

    return _march_with(options, MPI.COMM_WORLD)


def _march_with(options: argparse.Namespace, comm: "MPI.Intracomm | None") -> int:
    """March with all robots in this process, or with one of them on each rank; rank 0 then has the world, too."""
    from mp2a.simulator import RunRecorder, simulate
    from mp2a.simulator.driver import Ending

    setup, simulation = _agree(options, comm)
    recorder = None if simulation is None else RunRecorder(simulation, setup.roles)

    def run(controller: "Controller") -> None:
        assert simulation is not None
        simulate(simulation, controller, setup.until, recorder, quiet=options.quiet)

    with setup.driver(comm) as driver:
        if comm is None:
            run(driver.step_until_done)
        else:
            from mp2a.simulator.ranks import simulate_over_ranks

            simulate_over_ranks(comm, driver, None if simulation is None else run)
        parts = [driver.ending] if comm is None else comm.gather(driver.ending)
    result = 0
    if simulation is not None and recorder is not None and parts is not None:
        result = _finish(options, simulation, recorder, setup, Ending.of_all(parts))
    return result if comm is None else _for_all(comm, result)


def _agree(options: argparse.Namespace, comm: "MPI.Intracomm | None") -> "tuple[MarchSetup, Simulation | None]":
    """Set up in the first process and tell all; the path is the leader's alone."""
    if comm is None:
        setup = set_up_march(options, None)
        return setup, _simulation(options, setup)
    from mp2a.transport.agreement import shared_errors

    own: Any = None
    simulation: Any = None
    with shared_errors(comm):
        if comm.rank == 0:
            own = set_up_march(options, comm.size)
            simulation = _simulation(options, own)
    common = comm.bcast(own._replace(path=None) if own is not None and hasattr(own, "path") else own)
    return (common if own is None else own), simulation


def _for_all(comm: "MPI.Intracomm", result: int) -> int:
    """Give every rank the exit status of the first, without a busy core while that one writes."""
    import numpy as np

    from mp2a.transport.wait import wait

    number = np.array([result], dtype=np.intc)
    wait(comm.Ibcast(number, 0))
    return int(number[0])


def _settle_options(options: argparse.Namespace) -> None:
    """Fill in what was not given, and refuse what does not belong together."""
    foreign, why = (_BY_DYNAMICS, "with a FILE") if options.file else (_CHOREOGRAPHY, "without a FILE")
    for name in foreign:
        if getattr(options, name) is not None:
            raise InputError(f"--{name.replace('_', '-')}: got {getattr(options, name)} {why}, expected none")
    for name, value in (_BY_DYNAMICS | _CHOREOGRAPHY).items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    unknown = [name for name in options.write if name not in _ENDINGS]
    if unknown:
        raise InputError(f"--write: got {unknown[0]!r}, expected one of {', '.join(_ENDINGS)}")


def _simulation(options: argparse.Namespace, setup: MarchSetup) -> "Simulation":
    from mp2a.files import check_writable
    from mp2a.simulator import Simulation, World, disc, read_world
    from mp2a.simulator.vehicle import SLIPS

    world = World() if options.world is None else read_world(options.world)
    if options.obstacle:
        discs = [disc((x, y), radius) for x, y, radius in options.obstacle]
        world = World(world.walls, [*world.obstacles, *discs], world.name)
    if options.out.exists() and not (options.out.is_file() or options.out.is_dir()):
        raise InputError(f"--out: got {options.out}, a device, expected what names of files begin with")
    try:
        check_writable(_named(options, ".npz"))
    except OutputError as error:
        raise InputError(f"--out: {error}") from error
    return Simulation(world, setup.models, setup.poses, slip=SLIPS[options.slip])


def _finish(
    options: argparse.Namespace,
    simulation: "Simulation",
    recorder: "RunRecorder",
    setup: MarchSetup,
    ending: "Ending",
) -> int:
    """Print and write what the robots left behind; return the exit status."""
    import numpy as np

    from mp2a.simulator.outcomes import outcomes

    recording = recorder.recording(ending.leaders, ending.events, ending.leader_paths)
    if not options.file:  # only the leader knows its path, and when that is over
        ending = ending._replace(over=np.full(len(setup.roles), ending.over.all()))
    ends = outcomes(simulation, setup.roles, ending)
    # First of all: where files cannot be written, this is what is left.
    if not options.quiet:
        _show(recording, ends)
    else:
        for line in (str(each) for each in ends if not each.good):
            print(f"mp2a: {line}", file=sys.stderr)
    wrong = False
    writers = {name: partial(_write, name, recording, options) for name in options.write}
    if ending.record is not None:
        writers["scan"] = partial(_scan, ending.record, options)
    for name, write in writers.items():
        try:
            path = write()
        except DependencyError as error:
            if not options.quiet:
                print(f"no {name}: {error}")
        except OutputError as error:
            wrong = True
            print(f"mp2a: no {name}: {error}", file=sys.stderr)
        else:
            if not options.quiet:
                print(path)
    return _NOT_WRITTEN if wrong else exit_status(ends)


def _named(options: argparse.Namespace, ending: str) -> Path:
    out: Path = options.out.with_name(options.out.name + ending)
    return out


def _write(name: str, recording: "Recording", options: argparse.Namespace) -> Path:
    """Write one of `_ENDINGS`."""
    path = _named(options, _ENDINGS[name])
    if name in ("npz", "mcap"):
        from mp2a.simulator import save_recording

        return save_recording(recording, path)
    from mp2a import plot

    if name == "animation":
        return plot.save_animation(recording, path, quiet=options.quiet)
    figure = plot.march_figure if name == "paths" else plot.speeds_figure
    return plot.save_figure(figure(recording), path)


def _scan(record: "FormationRecord", options: argparse.Namespace) -> Path:
    """Write what a march by dynamics keeps of its scan."""
    from mp2a.formation.record import save_record

    about = {name: getattr(options, name) for name in _BY_DYNAMICS}
    out = _named(options, "-scan.npz")
    save_record(out, record, about | {"n": record.pose.shape[1], "method": options.method})
    return out


def _show(recording: "Recording", ends: list[Outcome]) -> None:
    import numpy as np

    from mp2a.cli.outcome import show_outcomes

    way = np.hypot(*np.moveaxis(np.diff(recording.poses[..., :2], axis=0), -1, 0)).sum(axis=0)
    off = np.abs(recording.gaps - recording.leaders[..., 2])
    fastest = np.abs(recording.twists[..., 0]).max(axis=0)
    columns = {"way, m": way, "fastest, m/s": fastest, "farthest off, m": np.nanmax(off, axis=0)}
    for event in recording.events[:_PRINTED]:
        print(f"{event.time:6.1f} s  {event.text(recording.roles)}")
    if len(recording.events) > _PRINTED:
        print(f"and {len(recording.events) - _PRINTED} more events, see the recording")
    show_outcomes(ends, f"{len(ends)} robots, {recording.times[-1]:.1f} s, simulated", columns)


def _numbers(text: str, *most: float) -> tuple[float, ...]:
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != len(most):
        raise argparse.ArgumentTypeError(f"got {text!r}, expected {len(most)} numbers with commas between them")
    for number, bound in zip(numbers, most, strict=True):
        if not abs(number) <= bound:
            raise argparse.ArgumentTypeError(f"got {text!r}, expected numbers of at most {bound:g}")
    return numbers


def _points(text: str) -> tuple[tuple[float, ...], ...]:
    return tuple(_numbers(word, _FAR, _FAR) for word in text.split())


def _disc(text: str) -> tuple[float, ...]:
    return _numbers(text, _FAR, _FAR, _FAR)


def _pose(text: str) -> tuple[float, ...]:
    return _numbers(text, _FAR, _FAR, 360.0)
