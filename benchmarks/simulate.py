"""Simulate formations of up to 65 536 robots on networks this machine does not have, by SimGrid; table and figure."""

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mp2a.bench import simulated as bench
from mp2a.bench.machine import machine_line
from mp2a.bench.simgrid import NETWORKS
from mp2a.cli.options import add_format, ranks
from mp2a.exceptions import DependencyError, InputError
from mp2a.plot import save_figure, simulated_figure
from mp2a.tables import Column, Table, show, show_seconds

SIZES = (8, 32, 128, 512, 4096, 65536)
LARGEST_BATCHED = 4096


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=ranks, default=SIZES, metavar="N,N,…", help="numbers of robots")
    parser.add_argument("--samples", type=ranks, default=(1, 2000), metavar="T,T,…", help="samples in each message")
    parser.add_argument(
        "--networks", type=lambda text: text.split(","), default=list(NETWORKS), help="names, with commas"
    )
    parser.add_argument("--limit", type=float, default=600.0, help="real time a simulation may take, s (default: 600)")
    parser.add_argument(
        "--costs",
        type=Path,
        help="JSON file with what is computed, as under 'costs' of the results; else measured here",
    )
    add_format(parser)
    parser.add_argument("--out", type=Path, default=Path("results/simulated.json"), help="results file to add to")
    options = parser.parse_args()
    if unknown := set(options.networks) - set(NETWORKS):
        parser.error(f"--networks: got {', '.join(sorted(unknown))}, expected some of {', '.join(NETWORKS)}")
    try:
        costs = json.loads(options.costs.read_text(encoding="utf-8")) if options.costs else None
        for samples in options.samples:
            sizes = [n for n in options.n if samples == 1 or n <= LARGEST_BATCHED]
            held = bench.run_simulations(options.out, sizes, [samples], options.networks, options.limit, costs, say)
        notes = [
            f"Left out from n = {gap['n']} on: {gap['contender']}, {gap['network']}: {gap['why']}."
            for gap in held["left_out"]
        ]
        show([table(held)], [*notes, f"Costs measured on {machine_line(held['machine'])}."], options.format)
        print(save_figure(simulated_figure(held), options.out.with_suffix(".png")))
    except (InputError, DependencyError, OSError) as error:
        parser.exit(2, f"{error}\n")


def table(held: Mapping[str, Any]) -> Table:
    """Make the table of simulated times, a row a network and number of robots."""
    times = {(p["samples"], p["network"], p["n"], p["contender"]): p["seconds"] for p in held["points"]}
    order = list(NETWORKS)
    keys = sorted({key[:3] for key in times}, key=lambda key: (key[0], order.index(key[1]), key[2]))
    columns = [Column("network", left=True), Column("samples"), Column("n")]
    columns += [Column(name, show_seconds, "s") for name in bench.CONTENDERS]
    rows = [
        [
            held["networks"][network]["label"],
            samples,
            n,
            *(times.get((samples, network, n, name)) for name in bench.CONTENDERS),
        ]
        for samples, network, n in keys
    ]
    return Table(f"simulated ({held['simulated']}): time of one call", columns, rows, keys=3)


def say(what: str) -> None:
    """Say at once what is being done."""
    print(what, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
