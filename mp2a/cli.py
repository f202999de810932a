"""The ``mp2a`` command. Each subcommand imports what it runs when it runs."""

import argparse
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mp2a import __version__
from mp2a.bench.settings import ERROR, PROGRESS, Settings
from mp2a.exceptions import InputError, MissingError

_INTERRUPTED = 130
_WIDTH = 136


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except (InputError, MissingError) as error:
        return _fail(str(error))
    except KeyboardInterrupt:
        print("interrupted; what was measured is kept", file=sys.stderr)
        return _INTERRUPTED
    except BrokenPipeError:
        return 0
    return 0


def _fail(message: str) -> int:
    # Under mpirun every rank has the same error, and one of them says it.
    if os.environ.get("OMPI_COMM_WORLD_RANK", os.environ.get("PMI_RANK", "0")) == "0":
        print(f"{ERROR}{message}", file=sys.stderr)
    return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="mp2a",
        description="A formation of robots computes its own dynamics in O(log2 n) exchanges.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"mp2a {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for add in (_add_bench, _add_plot, _add_model, _add_schedule, _add_trace):
        add(commands)
    return parser


def _command(
    commands: Any, name: str, run: Callable[[argparse.Namespace], None], summary: str, examples: str
) -> argparse.ArgumentParser:
    command: argparse.ArgumentParser = commands.add_parser(
        name,
        help=summary,
        description=summary,
        epilog=f"examples:\n{examples}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.set_defaults(run=run)
    return command


# ---- bench ---------------------------------------------------------------------------------------------------------


def _add_bench(commands: Any) -> None:
    command = _command(
        commands,
        "bench",
        _bench,
        "Time inverse dynamics of a formation, one rank a robot, against relay, centre and pinocchio.",
        "  mp2a bench --ranks 1,2,4,8                start mpirun for each number of ranks\n"
        "  mpirun -n 8 mp2a bench                    measure on the ranks that are there\n"
        "  mp2a bench --ranks 8 --samples 500 --out results/short.json",
    )
    command.add_argument("--ranks", type=_ranks, metavar="N,N,…", help="numbers of ranks to start (default: 1,2,4,8)")
    _add_run_options(command)
    command.add_argument("--repeats", type=_positive, default=5, help="repeats of each contender (default: 5)")
    command.add_argument(
        "--seconds", type=_positive_number, default=10.0, help="time for the repeats of all contenders (default: 10)"
    )
    command.add_argument("--out", type=Path, default=Path("results/bench.json"), help="results file to append to")
    command.add_argument("--fresh", action="store_true", help="measure again what the results file holds already")
    _add_network(command)


def _bench(options: argparse.Namespace) -> None:
    from mp2a.bench import results

    if options.out.exists():
        results.load(options.out)  # said now if it cannot be appended to, not after the measurement
    if under_mpirun():
        if options.ranks is not None:
            raise InputError("--ranks: given under mpirun, expected one or the other")
        _as_rank(_bench_here, options)
        return
    from mp2a.bench.sweep import sweep

    with _progress(options.quiet) as say:
        runs = sweep(options.ranks or [1, 2, 4, 8], _settings(options), options.out, fresh=options.fresh, say=say)
    _show(runs, options.out)


def _bench_here(options: argparse.Namespace) -> None:
    """Measure as one rank of a running mpirun."""
    from mp2a.bench import results
    from mp2a.bench.rank import run

    done = run(_settings(options), _say_line if options.quiet else lambda what: None)
    if done is None:
        return
    results.append(options.out, done)
    if not options.quiet:
        _show([done], options.out)


def _show(runs: list[dict[str, Any]], path: Path) -> None:
    from rich.console import Console

    from mp2a.bench.table import SIZES, notes, table

    console = Console(width=_WIDTH)
    for size in SIZES:
        console.print(table(runs, size))
    for note in notes(runs):
        console.print(note, highlight=False)
    console.print(f"kept in {path}", highlight=False)


def _settings(options: argparse.Namespace) -> Settings:
    return Settings(*(getattr(options, name) for name in Settings._fields))


# ---- plot ----------------------------------------------------------------------------------------------------------


def _add_plot(commands: Any) -> None:
    command = _command(
        commands,
        "plot",
        _plot,
        "Draw time and speedup of a results file, or the timeline of a trace.",
        "  mp2a plot time results/bench.json\n"
        "  mp2a plot speedup results/bench.json --against pinocchio --out speedup.pdf\n"
        "  mp2a plot timeline results/trace.json",
    )
    command.add_argument("picture", choices=("time", "speedup", "timeline"))
    command.add_argument("file", type=Path, help="a results file of mp2a bench, or a trace file of mp2a trace")
    command.add_argument("--out", type=Path, help="picture to write (default: beside the file)")
    command.add_argument(
        "--period", type=_positive_number, default=0.01, help="control period of the real-time line, s (default: 0.01)"
    )
    command.add_argument("--against", default="relay", help="contender that speedup is over (default: relay)")


def _plot(options: argparse.Namespace) -> None:
    import json

    from mp2a import plot
    from mp2a.bench import results

    out = options.out or options.file.with_name(f"{options.picture}.png")
    if options.picture == "timeline":
        try:
            trace = json.loads(options.file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"file: {options.file} cannot be read as a trace ({error})") from error
        written = plot.timeline(trace, out)
    elif options.picture == "time":
        written = plot.time(results.load(options.file), out, period=options.period)
    else:
        written = plot.speedup(results.load(options.file), out, against=options.against)
    print(written)


# ---- model ---------------------------------------------------------------------------------------------------------


def _add_model(commands: Any) -> None:
    command = _command(
        commands,
        "model",
        _model,
        "Work out the paper's cost model (eq. 11-13, Table I) for chosen constants.",
        "  mp2a model --n 8,64,512 --serial-time 6.4 --latency 1e-7 --speed 1e9\n"
        "  mp2a model --n 512 --bits 2                as eq. 13 is printed",
    )
    command.add_argument("--n", type=_ranks, default=[512], metavar="N,N,…", help="numbers of robots (default: 512)")
    command.add_argument("--samples", type=_positive, default=2000, help="p_t, sample points (default: 2000)")
    _add_network(command)
    command.set_defaults(serial_time=6.4, latency=1e-6, speed=1e9)


def _model(options: argparse.Namespace) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from mp2a import model

    network = model.Network(options.serial_time, options.latency, options.speed, options.bits)
    out = Table(
        title=f"modelled: T_s = {network.serial_time:g} s, L_a = {network.latency:g} s, "
        f"N_TS = {network.speed:g} bit/s, p_t = {options.samples}, {network.bits:g} bits a number",
        box=box.SIMPLE,
        title_justify="left",
    )
    for heading in ("n", "counts", "D_v", "D_mv", "D_C", "D_T (12)", "T_p (11), s", "T (13), s", "T_s / T"):
        out.add_column(heading, justify="left" if heading == "counts" else "right")
    for n in options.n:
        for label, count in model.COUNTS.items():
            messages = count(n)
            total = model.total_time(n, options.samples, messages, network)
            out.add_row(
                *(str(x) for x in (n, label, messages.vectors, messages.matrices, messages.total)),
                str(model.numbers_sent(n, messages)),
                f"{model.parallel_time(n, messages, network):.4g}",
                f"{total:.4g}",
                f"{network.serial_time / total:.3g}" if total else "-",
            )
    console = Console(width=_WIDTH)
    console.print(out)
    console.print("counts: 'true' is what recursive doubling sends; 'table I' as the paper prints it.", highlight=False)


# ---- schedule and trace --------------------------------------------------------------------------------------------


def _add_schedule(commands: Any) -> None:
    command = _command(
        commands,
        "schedule",
        _schedule,
        "Print who sends what to whom in which round.",
        "  mp2a schedule --n 8\n  mp2a schedule --n 8 --method relay",
    )
    command.add_argument("--n", type=_positive, default=8, help="number of robots (default: 8)")
    command.add_argument("--method", default="kogge-stone")


def _schedule(options: argparse.Namespace) -> None:
    from mp2a.schedule import SCHEDULES

    if options.method not in SCHEDULES:
        raise InputError(f"--method: got {options.method!r}, expected one of {', '.join(SCHEDULES)}")
    print(SCHEDULES[options.method](options.n))


def _add_trace(commands: Any) -> None:
    command = _command(
        commands,
        "trace",
        _trace,
        "Record one call with real time stamps; the file opens in https://ui.perfetto.dev and in mp2a plot timeline.",
        "  mp2a trace --ranks 8 --out results/trace.json\n  mpirun -n 8 mp2a trace",
    )
    command.add_argument("--ranks", type=_positive, help="number of ranks to start (default: 8)")
    _add_run_options(command)
    command.add_argument("--out", type=Path, default=Path("results/trace.json"), help="trace file to write")


def _trace(options: argparse.Namespace) -> None:
    if under_mpirun():
        if options.ranks is not None:
            raise InputError("--ranks: given under mpirun, expected one or the other")
        _as_rank(_trace_here, options)
        return
    from mp2a.bench.sweep import child

    arguments = ["trace", "--samples", options.samples, "--seed", options.seed, "--method", options.method]
    with _progress(options.quiet) as say:
        trace = child([str(word) for word in arguments], options.ranks or 8, say)
    _keep(trace, options)


def _trace_here(options: argparse.Namespace) -> None:
    """Trace as one rank of a running mpirun."""
    from mp2a.bench.timeline import record

    trace = record(options.samples, options.seed, options.method)
    if trace is not None:
        _keep(trace, options)


def _keep(trace: dict[str, Any], options: argparse.Namespace) -> None:
    from mp2a.bench import results

    results.write(options.out, trace)
    if not options.quiet:
        print(options.out)


# ---- ranks ---------------------------------------------------------------------------------------------------------


def under_mpirun() -> bool:
    """Whether this process is a rank that some launcher started."""
    return any(name in os.environ for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK", "PMI_RANK"))


def _as_rank(run: Callable[[argparse.Namespace], None], options: argparse.Namespace) -> None:
    """Run a rank's part; what goes wrong on one rank alone ends all, since the others would wait for it."""
    from mpi4py import MPI

    from mp2a.cores import settle

    settle()
    try:
        run(options)
    except (InputError, MissingError):
        raise  # the same on every rank
    except BaseException:
        traceback.print_exc()
        MPI.COMM_WORLD.Abort(1)


# ---- shared options ------------------------------------------------------------------------------------------------


def _add_run_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("--samples", type=_positive, default=2000, help="samples of the trajectory (default: 2000)")
    command.add_argument("--seed", type=int, default=0, help="of the random chain and its motion (default: 0)")
    command.add_argument("--method", default="kogge-stone", help="distributed method (default: kogge-stone)")
    command.add_argument("--quiet", action="store_true", help=argparse.SUPPRESS)


def _add_network(command: argparse.ArgumentParser) -> None:
    group = command.add_argument_group("constants of eq. 11-13 (bench measures those that are not given)")
    group.add_argument("--serial-time", type=_positive_number, metavar="T_s", help="O(n) time of all samples, s")
    group.add_argument("--latency", type=_positive_number, metavar="L_a", help="of a message, s")
    group.add_argument("--speed", type=_positive_number, metavar="N_TS", help="of the network, bit/s")
    group.add_argument(
        "--bits", type=_positive_number, default=64.0, help="bits a number; eq. 13 prints 2 (default: 64)"
    )


def _ranks(text: str) -> list[int]:
    return [_positive(word) for word in text.split(",")]


def _positive(text: str) -> int:
    if not text.strip().isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a whole number of at least 1")
    return int(text)


def _positive_number(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    if not 0 < number < float("inf"):
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a positive number")
    return number


def _say_line(what: str) -> None:
    print(f"{PROGRESS}{what}", flush=True)


def _progress(quiet: bool) -> Any:
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
