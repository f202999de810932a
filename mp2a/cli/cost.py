"""``mp2a cost``: the paper's cost model."""

import argparse
from typing import TYPE_CHECKING, Any

from mp2a.cli.options import add_format, add_network, command, positive, ranks

if TYPE_CHECKING:
    from mp2a.tables import Table


def add(commands: Any) -> None:
    """Add the subcommand."""
    parser = command(
        commands,
        "cost",
        _cost,
        "Work out the paper's cost model (eq. 11-13, Table I) for chosen constants.",
        "  mp2a cost --n 8,64,512 --serial-time 6.4 --latency 1e-7 --speed 1e9\n"
        "  mp2a cost --n 512 --bits 2                as eq. 13 is printed\n"
        "  mp2a cost --n 8,64,512 --format csv       for a spreadsheet",
    )
    parser.add_argument("--n", type=ranks, default=[512], metavar="N,N,…", help="numbers of robots (default: 512)")
    parser.add_argument("--samples", type=positive, default=2000, help="p_t, sample points (default: 2000)")
    add_format(parser)
    add_network(parser)
    parser.set_defaults(serial_time=6.4, latency=1e-6, speed=1e9)


def _cost(options: argparse.Namespace) -> None:
    from mp2a.tables import show

    notes = (
        f"With T_s = {options.serial_time:g} s, what the O(n) computation of all samples takes; L_a = "
        f"{options.latency:g} s, the latency of a message; N_TS = {options.speed:g} bit/s, the speed of the network; "
        f"p_t = {options.samples} samples; {options.bits:g} bits a number.",
        "Counts: 'true' is what recursive doubling sends, 'table I' as the paper prints it: D_v messages of a vector, "
        "D_mv of a matrix and a vector, D_C of both, D_T numbers in all.",
    )
    show([_paper(options), _methods(options)], notes, options.format)


def _paper(options: argparse.Namespace) -> "Table":
    """Make the table of the paper's figures."""
    from mp2a import cost_model
    from mp2a.tables import Column, Table

    network = cost_model.Network(options.serial_time, options.latency, options.speed, options.bits)
    rows: list[list[Any]] = []
    for n in options.n:
        for label, count in cost_model.COUNTS.items():
            messages = count(n)
            total = cost_model.total_time(n, options.samples, messages, network)
            sent = cost_model.numbers_sent(n, messages)
            rows.append([n, label, messages.vectors, messages.matrices, messages.total, sent])
            rows[-1] += [
                cost_model.parallel_time(n, messages, network), total, network.serial_time / total if total else None
            ]  # fmt: skip
    columns = [Column("n"), Column("counts", left=True), *map(Column, ("D_v", "D_mv", "D_C", "D_T (12)"))]
    columns += [Column(name, "{:.4g}".format) for name in ("T_p (11), s", "T (13), s")]
    columns.append(Column("T_s / T", "{:.3g}".format))
    return Table("modelled: the paper's eq. 11-13", columns, rows, keys=2)


def _methods(options: argparse.Namespace) -> "Table":
    """Make the table of the library's methods, of which messages of a round are in flight together."""
    from mp2a.methods import METHODS
    from mp2a.methods.cost import cost
    from mp2a.tables import Column, Table

    rows: list[list[Any]] = []
    for n in options.n:
        for name in METHODS:
            rows.append([n, name, *cost(name, n, options.samples, options.latency, options.speed)])
    columns = [Column("n"), Column("method", left=True), *map(Column, ("rounds", "messages", "bytes"))]
    columns.append(Column("time, s", "{:.4g}".format))
    title = f"modelled: {options.samples} samples in each message, messages of a round in flight together"
    return Table(title, columns, rows, keys=2)
