"""Forward dynamics in one process, ours beside pinocchio's best form, in one interleaved run.

    python benchmarks/aba.py                       # T = 2000 samples, n = 8, 32, 128, 512; one sample; long chains
    python benchmarks/aba.py --n 8,32 --long 1000

Times are medians of turns, ratios medians of the ratios of turns that follow each other. Everything is written to
results/aba.json.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
from measure import Contender, finish, need_kernels, ratio, script_parser, spread, take_turns
from rich.console import Console

import mp2a
from mp2a import Model
from mp2a.bench.machine import describe_machine
from mp2a.cli.options import ranks as numbers
from mp2a.exceptions import DependencyError
from mp2a.reference import need_memory
from mp2a.tables import Column, Table, show_plain, show_ratio

RATIOS = (("pinocchio", "rows"), ("pinocchio", "columns"), ("pinocchio 2", "rows 2"), ("pinocchio 2", "columns 2"))
HEADINGS = {
    "pinocchio": "pinocchio, 1 thread", "pinocchio 2": "pinocchio, 2 threads", "rows": "(T, n)", "columns": "(n, T)",
    "rows 2": "(T, n), 2 threads", "columns 2": "(n, T), 2 threads",
}  # fmt: skip
_CALLS = 100


def main() -> None:
    """Measure, save and print."""
    parser = script_parser(__doc__, "aba.json")
    parser.add_argument("--n", type=numbers, default=[8, 32, 128, 512], help="numbers of bodies")
    parser.add_argument("--samples", type=int, default=2000, help="T (default: 2000)")
    parser.add_argument("--one", type=numbers, default=[7, 32], help="numbers of bodies, one sample a call")
    parser.add_argument("--long", type=numbers, default=[10**3, 10**5], help="numbers of bodies of long chains")
    options = parser.parse_args()
    need_kernels()
    results: dict[str, Any] = {"machine": describe_machine(), "samples": options.samples}
    notes: list[str] = []
    with Console(stderr=True).status("") as spinner:
        kinds, many = ("batch", "one", "long"), partial(batch, options.samples)
        for key, lengths, contenders in zip(
            kinds, (options.n, options.one, options.long), (many, one, long), strict=True
        ):
            results[key] = []
            for n in lengths:
                spinner.update(f"{key}, n = {n}")
                found, left_out = contenders(n)
                notes += [f"n = {n}: {left_out}"] if left_out else []
                results[key].append({"n": n, "seconds": take_turns(found, options.repeats)})
    finish(results, tables(results), notes, options)


Contenders = tuple[dict[str, Contender], str]
"""By name, and why one is not among them."""


def batch(samples: int, n: int) -> Contenders:
    """Many samples of a random chain of revolute joints."""
    model = Model.random(n)
    state = model.random_state(samples)
    found = {}
    for layout, order in (("rows", "C"), ("columns", "F")):
        arrays = [np.asarray(x, order=order) for x in state]  # type: ignore[call-overload]
        out = np.empty_like(arrays[1])
        for threads, name in ((1, layout), (2, f"{layout} 2")):
            found[name] = Contender(partial(mp2a.aba, model, *arrays, threads=threads, out=out), samples)
    try:
        need_memory(model.nv, copies=3)  # the pool is filled by copying
    except DependencyError as error:
        return found, str(error)
    pool = pin.ModelPool(model.to_pinocchio(), 2)
    columns = [np.asfortranarray(x.T) for x in state]
    result = np.zeros((n, samples), order="F")
    for threads, name in ((1, "pinocchio"), (2, "pinocchio 2")):
        found[name] = Contender(partial(pin.abaInParallel, threads, pool, *columns, result), samples)
    found["pinocchio"].run()
    np.testing.assert_allclose(found["rows"].run(), result.T, rtol=0, atol=1e-8 * np.abs(result).max())
    return found, ""


def one(n: int) -> Contenders:
    """One sample a call; some calls are timed together."""
    model = Model.random(n)
    q, v, tau = model.random_state()
    theirs, out = model.to_pinocchio(), np.empty(n)
    data = theirs.createData()
    calls: dict[str, Callable[[], object]] = {
        "aba": lambda: mp2a.aba(model, q, v, tau),
        "aba, out=": lambda: mp2a.aba(model, q, v, tau, out=out),
        "pinocchio": lambda: pin.aba(theirs, data, q, v, tau),
    }
    np.testing.assert_allclose(calls["aba"](), calls["pinocchio"](), rtol=1e-8)
    return {name: Contender(partial(_repeat, call), _CALLS) for name, call in calls.items()}, ""


def long(n: int) -> Contenders:
    """One sample of a long chain, one thread."""
    model = Model.random(n)
    q, v, tau = model.random_state()
    return {"aba": Contender(partial(mp2a.aba, model, q, v, tau, out=np.empty(n)))}, ""


def _repeat(call: Callable[[], object]) -> None:
    for _ in range(_CALLS):
        call()


def tables(results: dict[str, Any]) -> list[Table]:
    """Make the tables."""
    runs, samples = results["batch"], results["samples"]
    columns = [Column("n"), *(Column(heading, show_plain) for heading in HEADINGS.values())]
    rows = [[run["n"], *(spread(run["seconds"], name, 1e9 / run["n"]) for name in HEADINGS)] for run in runs]
    out = [Table(f"ns a body and sample, T = {samples}, revolute joints", columns, rows)]
    columns = [Column("n")]
    columns += [Column(f"{HEADINGS[slow]}, over {HEADINGS[fast]}", show_ratio) for slow, fast in RATIOS]
    rows = [[run["n"], *(ratio(run["seconds"], *pair) for pair in RATIOS)] for run in runs]
    out.append(Table("how many times longer pinocchio takes", columns, rows))
    names = ("aba", "aba, out=", "pinocchio")
    columns = [Column("n"), *(Column(name, show_plain) for name in names), Column("aba, of pinocchio", show_ratio)]
    rows = [
        [run["n"], *(spread(run["seconds"], name, 1e6) for name in names), ratio(run["seconds"], "aba", "pinocchio")]
        for run in results["one"]
    ]
    out.append(Table("one sample, µs a call", columns, rows))
    rows = [[run["n"], spread(run["seconds"], "aba", 1e9 / run["n"])] for run in results["long"]]
    out.append(Table("one sample, one thread, ns a body", [Column("n"), Column("aba", show_plain)], rows))
    return out


if __name__ == "__main__":
    main()
