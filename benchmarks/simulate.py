"""Simulate formations of up to 65 536 robots on networks this machine does not have, by SimGrid; table and figure."""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mp2a.bench import simulated as bench
from mp2a.bench.simgrid import NETWORKS
from mp2a.exceptions import DependencyError, InputError
from mp2a.plot import save_figure, simulated_figure

SIZES = (8, 32, 128, 512, 4096, 65536)
LARGEST_BATCHED = 4096


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=_numbers, default=SIZES, metavar="N,N,…", help="numbers of robots")
    parser.add_argument("--samples", type=_numbers, default=(1, 2000), metavar="T,T,…", help="samples in each message")
    parser.add_argument(
        "--networks", type=lambda text: text.split(","), default=list(NETWORKS), help="names, with commas"
    )
    parser.add_argument("--limit", type=float, default=600.0, help="real time a simulation may take, s (default: 600)")
    parser.add_argument(
        "--costs",
        type=Path,
        help="JSON file with what is computed, as under 'costs' of the results; else measured here",
    )
    parser.add_argument("--out", type=Path, default=Path("results/simulated.json"), help="results file to add to")
    options = parser.parse_args()
    if unknown := set(options.networks) - set(NETWORKS):
        parser.error(f"--networks: got {', '.join(sorted(unknown))}, expected some of {', '.join(NETWORKS)}")
    try:
        given = json.loads(options.costs.read_text(encoding="utf-8")) if options.costs else None
        for samples in options.samples:
            sizes = [n for n in options.n if samples == 1 or n <= LARGEST_BATCHED]
            held = bench.sweep(options.out, sizes, [samples], options.networks, options.limit, given, say)
        table(held)
        print(save_figure(simulated_figure(held), options.out.with_suffix(".png")))
    except (InputError, DependencyError, OSError) as error:
        parser.exit(2, f"{error}\n")


def table(held: Mapping[str, Any]) -> None:
    """Print simulated times, a line a network and number of robots."""
    times = {(p["samples"], p["network"], p["n"], p["contender"]): p["seconds"] for p in held["points"]}
    print(f"simulated ({held['simulated']}), time of one call")
    print(f"{'network':<34} {'samples':>7} {'n':>6} " + " ".join(f"{name:>12}" for name in bench.CONTENDERS))
    order = list(NETWORKS)
    for samples, network, n in sorted(
        {key[:3] for key in times}, key=lambda key: (key[0], order.index(key[1]), key[2])
    ):
        row = (times.get((samples, network, n, name)) for name in bench.CONTENDERS)
        cells = " ".join(f"{'-' if t is None else f'{t * 1e3:.5g} ms':>12}" for t in row)
        print(f"{held['networks'][network]['label']:<34} {samples:>7} {n:>6} {cells}")
    for gap in held["left_out"]:
        print(f"left out from n = {gap['n']} on: {gap['contender']}, {gap['network']}: {gap['why']}")


def say(what: str) -> None:
    """Print a line at once."""
    print(what, flush=True)


def _numbers(text: str) -> list[int]:
    return [int(word) for word in text.split(",")]


if __name__ == "__main__":
    main()
