"""Contenders on networks this machine does not have, up to 65 536 robots: every time in here is simulated."""

import itertools
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from mp2a.bench import costs
from mp2a.bench.contenders import GATHER_SCATTER, PIPELINE
from mp2a.bench.machine import describe_machine
from mp2a.bench.results import FORMAT, read_json, write_json
from mp2a.bench.simgrid import (
    NETWORKS,
    NEUTRAL,
    Phase,
    find_smpirun,
    gather_scatter_program,
    schedule_program,
    simulate,
)
from mp2a.exceptions import DependencyError, InputError
from mp2a.methods import METHODS
from mp2a.schedule import FORCE, MOTION, pipeline

CONTENDERS = (PIPELINE, GATHER_SCATTER, *METHODS)
SCHEDULES = {name: method.schedule for name, method in METHODS.items()} | {PIPELINE: pipeline}
"""Who sends what to whom, by the name of the contender; all messages of gather and scatter go to one robot."""

PIPELINE_DOUBLES = {MOTION: 12, FORCE: 6}
GATHER_SCATTER_DOUBLES = (3, 1)
"""q, q̇ and q̈ of a joint with one degree of freedom on the way in, its torque on the way out."""


def contender_program(name: str, n: int, samples: int, seconds: Mapping[str, Any]) -> Iterator[Phase]:
    """Program of a contender.

    Parameters
    ----------
    name
        One of `CONTENDERS`.
    n
        Number of robots.
    samples
        Samples in each message.
    seconds
        What they compute, as `measure_costs` gives it.
    """
    if name == GATHER_SCATTER:
        return gather_scatter_program(n, GATHER_SCATTER_DOUBLES, samples, seconds[name])
    doubles = METHODS[name].doubles if name in METHODS else PIPELINE_DOUBLES
    return schedule_program(SCHEDULES[name](n), doubles, samples, costs.ComputeCosts(**seconds[name]))


def measure_costs(samples: int) -> dict[str, Any]:
    """Measure here what each contender computes: `ComputeCosts` as a dict; of gather and scatter, seconds a robot."""
    methods = {name: costs.method_costs(name, samples)._asdict() for name in CONTENDERS if name in METHODS}
    return {
        PIPELINE: costs.pipeline_costs(samples)._asdict(),
        GATHER_SCATTER: costs.gather_scatter_cost(samples),
        **methods,
    }


def run_simulations(
    out: Path,
    sizes: Sequence[int],
    samples: Sequence[int],
    networks: Sequence[str] = tuple(NETWORKS),
    limit: float = 600.0,
    seconds: Mapping[str, Any] | None = None,
    say: Callable[[str], None] = lambda what: None,
) -> dict[str, Any]:
    """Simulate all contenders and keep each result as it comes; what the file holds is not simulated again.

    Parameters
    ----------
    out
        Results file, JSON.
    sizes
        Numbers of robots.
    samples
        Samples in each message.
    networks
        Names out of `NETWORKS`.
    limit
        Seconds of real time a simulation may take. After one that takes longer its contender is left out for more
        robots on that network, and the file says so.
    seconds
        What contenders compute, by the number of samples (as text, for JSON) and then as `measure_costs` gives it;
        measured here where it is missing.
    say
        Called with what is being done.

    Returns
    -------
    dict
        What the file holds.
    """
    find_smpirun()
    held = load(out) if out.exists() else _empty()
    if any(held["costs"].get(count, new) != new for count, new in (seconds or {}).items()):
        raise InputError(f"seconds: differ from those {out} was simulated with, expected the same or another file")
    held["costs"] |= seconds or {}
    held["left_out"] = [m for m in held["left_out"] if m["network"] not in networks or m["samples"] not in samples]
    held["networks"] |= {name: NETWORKS[name]._asdict() for name in networks}
    for count, n, network, name in itertools.product(samples, sorted(sizes), networks, CONTENDERS):
        where = {"network": network, "contender": name, "samples": count, "n": n}
        if any(where.items() <= point.items() for point in held["points"]):
            continue
        if any(({**where, "n": m["n"]}).items() <= m.items() and m["n"] <= n for m in held["left_out"]):
            continue
        if str(count) not in held["costs"]:
            say(f"costs of {count} samples")
            held["costs"][str(count)] = measure_costs(count)
        say(f"{name}, {NETWORKS[network].label}, n = {n}, samples {count}")
        began = time.monotonic()
        try:
            program = contender_program(name, n, count, held["costs"][str(count)])
            simulated = simulate(NETWORKS[network], n, program, limit)
            held["points"].append({**where, "seconds": simulated, "took": round(time.monotonic() - began, 2)})
        except (TimeoutError, DependencyError) as error:
            held["left_out"].append({**where, "why": str(error)})
        write_json(out, held)
    return held


def load(path: Path) -> dict[str, Any]:
    """Read a file of simulated times.

    Raises
    ------
    InputError
        If it cannot be read or is something else.
    """
    return read_json(path, "simulated times", "points")


def _empty() -> dict[str, Any]:
    return {
        **{"format": FORMAT, "simulated": _version(), "settings": NEUTRAL, "machine": describe_machine()},
        **{"networks": {}, "costs": {}, "points": [], "left_out": []},
    }


def _version() -> str:
    said = subprocess.run([find_smpirun(), "-version"], capture_output=True, text=True, check=False).stdout
    return said.strip().replace(" version", "") or "SimGrid"
