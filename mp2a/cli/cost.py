"""``mp2a cost``: the paper's cost model."""

import argparse
from typing import TYPE_CHECKING, Any

from mp2a.cli.options import WIDTH, add_network, command, positive, ranks

if TYPE_CHECKING:
    from rich.table import Table


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "cost",
        _cost,
        "Work out the paper's cost model (eq. 11-13, Table I) for chosen constants.",
        "  mp2a cost --n 8,64,512 --serial-time 6.4 --latency 1e-7 --speed 1e9\n"
        "  mp2a cost --n 512 --bits 2                as eq. 13 is printed",
    )
    parser.add_argument("--n", type=ranks, default=[512], metavar="N,N,…", help="numbers of robots (default: 512)")
    parser.add_argument("--samples", type=positive, default=2000, help="p_t, sample points (default: 2000)")
    add_network(parser)
    parser.set_defaults(serial_time=6.4, latency=1e-6, speed=1e9)


def _cost(options: argparse.Namespace) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    from mp2a import cost_model

    network = cost_model.Network(options.serial_time, options.latency, options.speed, options.bits)
    out = Table(
        title=f"modelled: T_s = {network.serial_time:g} s, L_a = {network.latency:g} s, "
        f"N_TS = {network.speed:g} bit/s, p_t = {options.samples}, {network.bits:g} bits a number",
        box=box.SIMPLE,
        title_justify="left",
    )
    for heading in ("n", "counts", "D_v", "D_mv", "D_C", "D_T (12)", "T_p (11), s", "T (13), s", "T_s / T"):
        out.add_column(heading, justify="left" if heading == "counts" else "right")
    for n in options.n:
        for label, count in cost_model.COUNTS.items():
            messages = count(n)
            total = cost_model.total_time(n, options.samples, messages, network)
            out.add_row(
                *(str(x) for x in (n, label, messages.vectors, messages.matrices, messages.total)),
                str(cost_model.numbers_sent(n, messages)),
                f"{cost_model.parallel_time(n, messages, network):.4g}",
                f"{total:.4g}",
                f"{network.serial_time / total:.3g}" if total else "-",
            )
    console = Console(width=WIDTH)
    console.print(out)
    console.print(_methods(options))
    console.print("counts: 'true' is what recursive doubling sends; 'table I' as the paper prints it.", highlight=False)


def _methods(options: argparse.Namespace) -> "Table":
    """Build the table of the library's methods, of which messages of a round are in flight together."""
    from rich import box
    from rich.table import Table

    from mp2a.methods import METHODS
    from mp2a.methods.cost import cost

    out = Table(
        title=f"modelled: {options.samples} samples in each message, messages of a round in flight together",
        box=box.SIMPLE,
        title_justify="left",
    )
    for heading in ("n", "method", "rounds", "messages", "bytes", "time, s"):
        out.add_column(heading, justify="left" if heading == "method" else "right")
    for n in options.n:
        for name in METHODS:
            costs = cost(name, n, options.samples, options.latency, options.speed)
            out.add_row(str(n), name, *(str(x) for x in costs[:3]), f"{costs.seconds:.4g}")
    return out
