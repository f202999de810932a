"""Who is fastest where messages take time: emulated latencies of 0.1 to 20 ms, 8 to 512 robots, one sample at a time.

    python benchmarks/latency.py --ranks 8,64 --latencies 1,20

Appends to results/latency.json, draws results/latency.png and prints a table. With --resume it goes on where it was.
"""

from typing import Any

from measure import ratio, script_parser
from rich.console import Console

from mp2a.bench import results
from mp2a.bench.campaign import run_campaign
from mp2a.bench.contenders import PIPELINE
from mp2a.bench.machine import machine_line
from mp2a.bench.settings import BenchSettings
from mp2a.cli.options import ranks
from mp2a.network import EmulatedNetwork
from mp2a.plot import latency_figure, save_figure
from mp2a.plot.latency import CONTENDERS, emulated
from mp2a.tables import Column, Spread, Table, show, show_ratio, show_seconds

RIVALS = ("kogge-stone", PIPELINE)
"""Those that the sweep is compared with."""


def main() -> None:
    """Run, print and draw."""
    parser = script_parser(__doc__, "latency.json", repeats=5)
    parser.add_argument("--ranks", type=ranks, default=[8, 16, 32, 64, 128, 256, 512], help="numbers of robots")
    parser.add_argument("--latencies", default="0.1,1,5,20", help="ms")
    parser.add_argument("--bandwidth", type=float, default=54e6, help="bit/s (default: 54e6)")
    parser.add_argument("--seconds", type=float, default=20.0, help="for the repeats of all contenders")
    parser.add_argument("--resume", action="store_true", help="leave out what the results file holds already")
    options = parser.parse_args()
    console = Console(stderr=True)
    for n in options.ranks:
        for milliseconds in map(float, options.latencies.split(",")):
            network = EmulatedNetwork(milliseconds * 1e-3, options.bandwidth)
            settings = BenchSettings(samples=1, repeats=options.repeats, seconds=options.seconds, network=network)
            with console.status("") as status:
                run_campaign([n], settings, options.out, resume=options.resume, say=status.update)
    content = results.load(options.out)
    machines = dict.fromkeys(f"Measured on {machine_line(run['machine'])}." for run in content["runs"])
    show([table(content)], list(machines), options.format)
    print(save_figure(latency_figure(content), options.out.with_suffix(".png")))


def table(content: dict[str, Any]) -> Table:
    """Make the table of the times of one sample, and how many times faster the sweep is."""
    columns = [Column("latency", show_seconds, "s"), Column("Mbit/s", "{:g}".format), Column("n")]
    columns += [Column(name, show_seconds, "s") for name in CONTENDERS]
    columns += [Column(f"sweep over {name}", show_ratio) for name in RIVALS]
    rows = []
    for network, runs in emulated(content).items():
        for run in runs:
            walls = {name: sizes["single"]["walls"] for name, sizes in run["measured"].items()}
            times = [Spread.of(walls[name]) if name in walls else None for name in CONTENDERS]
            rows.append(
                [
                    network.latency,
                    network.bandwidth / 1e6,
                    run["n"],
                    *times,
                    *(ratio(walls, name, "sweep") for name in RIVALS),
                ]
            )
    return Table("time of one sample", columns, rows, keys=3)


if __name__ == "__main__":
    main()
