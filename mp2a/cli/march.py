"""``mp2a march``: a formation on the march, in one process or with a robot a rank."""

import argparse
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mp2a.cli.options import WIDTH, as_rank, command, positive, positive_number, progress, under_mpirun
from mp2a.exceptions import InputError

if TYPE_CHECKING:
    from mp2a.formation.paths import Path as LeadersPath
    from mp2a.formation.record import Record
    from mp2a.formation.sensing import Discs

_SETTLING = 8.0
"""s after the leader has stopped in which the last ones close up and come back to the path."""


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "march",
        _march,
        "March a formation along a path past obstacles; only the leader knows the path.",
        '  mp2a march --robots 8 --path "0,0 20,0 20,15" --obstacle 10,0,0.5 --out results/march.json\n'
        "  mpirun -n 8 mp2a march --obstacle 10,0,0.5           a rank a robot, the same result\n"
        "  mp2a march --shape triangle --robots 10 --spacing 3",
    )
    parser.add_argument("--robots", type=positive, help="how many (default: 8, or one a rank)")
    parser.add_argument("--shape", default="line", help="line (follow the leader), row, column, triangle, …")
    parser.add_argument("--spacing", type=positive_number, default=2.0, help="between neighbours, m (default: 2)")
    parser.add_argument(
        "--path", type=_points, default=((0.0, 0.0), (20.0, 0.0), (20.0, 15.0)), metavar='"X,Y X,Y …"',
        help="waypoints of the leader, m",
    )  # fmt: skip
    parser.add_argument("--radius", type=positive_number, default=3.0, help="of rounded corners, m (default: 3)")
    parser.add_argument("--spline", action="store_true", help="a smooth curve through the waypoints instead")
    parser.add_argument("--speed", type=positive_number, default=0.7, help="of the leader at most, m/s (default: 0.7)")
    parser.add_argument(
        "--obstacle", type=_disc, action="append", default=[], metavar="X,Y,R", help="a disc, m; any number of them"
    )
    parser.add_argument("--seconds", type=positive_number, help="how long (default: until all have come to rest)")
    parser.add_argument("--tick", type=positive_number, default=0.1, help="s (default: 0.1)")
    parser.add_argument("--method", default="sweep", help="method of the scan (default: sweep)")
    parser.add_argument("--out", type=Path, default=Path("results/march.json"), help="file to write, .json or .npz")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")


def _march(options: argparse.Namespace) -> None:
    if under_mpirun():
        as_rank(_march_here, options)
        return
    from mp2a.formation import Formation, March, OneProcess
    from mp2a.formation.record import run

    formation = Formation.of(options.shape, options.robots or 8, options.spacing)
    path, world = _path(options), _world(options)
    march = March(formation, path, OneProcess(formation.chain, options.method), tick=options.tick)
    with progress(options.quiet) as say:
        record = run(march, _ticks(options, path, len(formation)), world, say)
    _keep(record, options, len(formation), "one process")


def _march_here(options: argparse.Namespace) -> None:
    """March as one rank of a running mpirun."""
    from mpi4py import MPI

    from mp2a.distributed import DistributedChain
    from mp2a.formation import Formation, March, OverRanks
    from mp2a.formation.record import run, together
    from mp2a.transport.mpi import raise_together

    comm = MPI.COMM_WORLD
    if options.robots not in (None, comm.size):
        raise InputError(f"--robots: got {options.robots} on {comm.size} ranks, expected as many or none")
    formation = Formation.of(options.shape, comm.size, options.spacing)
    path, ticks = None, 0
    world, wrong = _world(options), None
    leads = comm.rank == 0
    if leads:
        try:
            path = _path(options)
            ticks = _ticks(options, path, comm.size)
        except InputError as error:
            wrong = error
    raise_together(comm, wrong)
    ticks = comm.bcast(ticks)
    with DistributedChain(comm, formation.chain, options.method) as ranks:
        march = March(formation, path, OverRanks(ranks), tick=options.tick)
        with progress(options.quiet) if leads else nullcontext(lambda what: None) as say:
            parts = comm.gather(run(march, ticks, world, say))
    if parts is not None:
        _keep(together(parts), options, comm.size, f"{comm.size} ranks")


def _path(options: argparse.Namespace) -> "LeadersPath":
    from mp2a.formation import Limits, spline, waypoints

    limits = Limits(speed=options.speed)
    return spline(options.path, limits) if options.spline else waypoints(options.path, options.radius, limits)


def _world(options: argparse.Namespace) -> "Discs":
    from mp2a.formation import Discs

    return Discs(options.obstacle)


def _ticks(options: argparse.Namespace, path: "LeadersPath", robots: int) -> int:
    """Whole ticks of the march; in a line each robot stops a tick after the one before."""
    seconds = options.seconds or path.duration + robots * options.tick + _SETTLING
    return max(1, round(seconds / options.tick))


def _keep(record: "Record", options: argparse.Namespace, robots: int, where: str) -> None:
    from mp2a.formation.record import save

    names = ("shape", "spacing", "path", "radius", "spline", "speed", "tick", "method")
    about = {name: getattr(options, name) for name in names}
    about |= {"robots": robots, "obstacles": options.obstacle, "ran in": where}
    save(options.out, record, about)
    if not options.quiet:
        _show(record, options)


def _show(record: "Record", options: argparse.Namespace) -> None:
    import numpy as np
    from rich.console import Console
    from rich.table import Table

    clearance = _world(options).clearance(record.pose).min(0)
    way = np.abs(np.diff(record.pose[..., 0] + 1j * record.pose[..., 1], axis=0)).sum(0)
    table = Table(title=f"{record.pose.shape[1]} robots, {options.shape}, {record.time[-1]:.0f} s")
    headings = ("robot", "way, m", "ends at, m", "fastest, m/s", "joint yielded, m", "push, N", "nearest obstacle, m")
    for heading in headings:
        table.add_column(heading, justify="right")
    for i in range(record.pose.shape[1]):
        x, y, _ = record.pose[-1, i]
        table.add_row(
            f"{i + 1}",
            f"{way[i]:.2f}",
            f"{x:.2f}, {y:.2f}",
            f"{np.hypot(*record.velocity[:, i, :2].T).max():.2f}",
            f"{np.hypot(*record.displacement[:, i, :2].T).max():.2f}",
            f"{np.hypot(*record.push[:, i].T).max():.0f}",
            f"{clearance[i]:.2f}" if np.isfinite(clearance[i]) else "-",
        )
    console = Console(width=WIDTH)
    console.print(table)
    console.print(f"kept in {options.out}", highlight=False)


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
