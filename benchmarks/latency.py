"""Who is fastest where messages take time: emulated latencies of 0.1 to 20 ms, 8 to 512 robots, one sample at a time.

    python benchmarks/latency.py --ranks 8,64 --latencies 1,20

Appends to results/latency.json, goes on where it was, draws results/latency.png and prints a table in Markdown.
"""

import argparse
from pathlib import Path

from mp2a.bench.sweep import sweep
from rich.console import Console

from mp2a.bench import results
from mp2a.bench.settings import Settings
from mp2a.network import EmulatedNetwork
from mp2a.plot import latency_figure, save_figure
from mp2a.plot.latency import CONTENDERS, emulated


def main() -> None:
    """Run, draw and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ranks", default="8,16,32,64,128,256,512", help="numbers of robots")
    parser.add_argument("--latencies", default="0.1,1,5,20", help="ms")
    parser.add_argument("--bandwidth", type=float, default=54e6, help="bit/s (default: 54e6)")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=20.0, help="for the repeats of all contenders")
    parser.add_argument("--out", type=Path, default=Path("results/latency.json"))
    options = parser.parse_args()
    console = Console(stderr=True)
    for n in map(int, options.ranks.split(",")):
        for milliseconds in map(float, options.latencies.split(",")):
            network = EmulatedNetwork(milliseconds * 1e-3, options.bandwidth)
            settings = Settings(samples=1, repeats=options.repeats, seconds=options.seconds, network=network)
            with console.status("") as status:
                sweep([n], settings, options.out, fresh=False, say=status.update)
    found = results.load(options.out)
    print(table(found))
    print(save_figure(latency_figure(found), options.out.with_suffix(".png")))


def table(found: dict[str, object]) -> str:
    """Write times of one sample in ms, and how many times faster the sweep is, as Markdown."""
    lines = [
        f"| network | n | {' | '.join(CONTENDERS)} | sweep over kogge-stone | sweep over pipeline |",
        "|" + "---|" * (len(CONTENDERS) + 4),
    ]
    for network, runs in emulated(found).items():
        for run in runs:
            walls = {name: run["measured"][name]["single"]["wall"] for name in CONTENDERS if name in run["measured"]}
            cells = [f"{1e3 * walls[name]:.3g}" if name in walls else "-" for name in CONTENDERS]
            ratios = [f"{walls[name] / walls['sweep']:.1f}×" for name in ("kogge-stone", "pipeline")]
            lines.append(f"| {network} | {run['n']} | {' | '.join([*cells, *ratios])} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
