"""Inverse dynamics of many samples in one process, ours beside pinocchio's best form, in one interleaved run.

    python benchmarks/batch.py                          # the table: T = 2000 samples, n = 8, 32, 128, 512
    python benchmarks/batch.py --joints --features      # what joint types cost; without AVX-512, without AVX
    python benchmarks/batch.py --others --format markdown    # other libraries that are installed; tables for the docs

Times are wall clock, medians of turns in nanoseconds a body and sample; ratios are medians of the ratios of turns that
follow each other. Everything is written to results/batch.json.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from measure import Contender, Times, finish, need_kernels, ratio, script_parser, spread, take_turns
from others import LIBRARIES, is_there
from rich.console import Console

import mp2a
from mp2a import Model
from mp2a.bench.machine import describe_machine
from mp2a.cli.options import ranks as numbers
from mp2a.exceptions import DependencyError
from mp2a.joints import JOINTS
from mp2a.kernels.library import CPU_FEATURES
from mp2a.reference import need_memory
from mp2a.tables import Column, Spread, Table, show_plain, show_ratio

State = tuple[np.ndarray, np.ndarray, np.ndarray]
Say = Callable[[str], None]

HEADINGS = {
    "loop": "pinocchio, Python loop",
    "pinocchio": "pinocchio, 1 thread",
    "pinocchio 2": "pinocchio, 2 threads",
    "rows": "(T, n)",
    "columns": "(n, T)",
    "rows 2": "(T, n), 2 threads",
    "columns 2": "(n, T), 2 threads",
    "rows fresh": "(T, n), new result",
    "columns fresh": "(n, T), new result",
    "rows float32": "(T, n), float32",
    "columns float32": "(n, T), float32",
    "rows bodies": "(T, n), bodies",
    "columns bodies": "(n, T), bodies",
}
"""Contenders; "new result" is without ``out=``, and "bodies" with motion and force of every body."""

MAIN = tuple(HEADINGS)[:7]
"""Those of the first table."""

RATIOS = (
    ("pinocchio", "rows"), ("pinocchio", "columns"), ("pinocchio 2", "rows 2"), ("pinocchio 2", "columns 2"),
    ("loop", "rows 2"), ("loop", "columns 2"),
)  # fmt: skip
FEATURES = {"AVX2": "-avx512f", "SSE2": "-sse3"}
"""What the processor is made to lack."""

_LOOPED = 64_000
"""Bodies times samples of pinocchio's Python loop, which is measured on some of the samples."""

_JOINT_CHAIN = 32


def main() -> None:
    """Measure, save and print."""
    parser = script_parser(__doc__, "batch.json")
    parser.add_argument("--n", type=numbers, default=[8, 32, 128, 512], help="numbers of bodies")
    parser.add_argument("--samples", type=int, default=2000, help="T (default: 2000)")
    parser.add_argument("--contenders", type=lambda text: text.split(","), default=list(HEADINGS), help="some of them")
    parser.add_argument("--joints", action="store_true", help="also joint types, trees and external forces")
    parser.add_argument("--features", action="store_true", help="also kernels without AVX-512 and without AVX")
    parser.add_argument("--others", action="store_true", help="also other libraries, as far as they are installed")
    options = parser.parse_args()
    if unknown := set(options.contenders) - set(HEADINGS):
        parser.error(f"--contenders: got {', '.join(sorted(unknown))}, expected some of {', '.join(HEADINGS)}")
    need_kernels()
    results: dict[str, Any] = {"machine": describe_machine(), "samples": options.samples}
    with Console(stderr=True).status("") as spinner:
        say: Say = spinner.update
        results["runs"] = [run(n, options.samples, options.repeats, options.contenders, say) for n in options.n]
        if options.joints:
            results["joints"] = joints(options.samples, options.repeats, say)
        if options.features:
            results["features"] = features(options.n, options.samples, options.repeats, say)
        if options.others:
            results["others"] = others(options.n, options.samples, options.repeats, say)
    notes = [f"n = {run['n']}: {run['left out']}" for run in results["runs"] if run["left out"]]
    if options.others:
        absent = {name: library for name, library in LIBRARIES.items() if not is_there(library)}
        notes += [f"{name} is not installed: pip install {library.install}" for name, library in absent.items()]
    finish(results, tables(results), notes, options)


# ---- the table ---------------------------------------------------------------------------------------------------


def run(n: int, samples: int, repeats: int, names: Sequence[str], say: Say) -> dict[str, Any]:
    """Measure contenders on a random chain of n revolute joints."""
    say(f"n = {n}")
    model = Model.random(n)
    state = model.random_state(samples)
    contenders, left_out = {}, ""
    for name in names:
        kind, _, detail = name.partition(" ")
        if kind in ("rows", "columns"):
            contenders[name] = ours(model, state, kind, detail)
    theirs = [name for name in names if name not in contenders]
    if theirs:
        try:
            all_of_it = pinocchio(model, state, threads=2 if "pinocchio 2" in theirs else 1)
            contenders |= {name: all_of_it[name] for name in theirs}
        except DependencyError as error:
            left_out = str(error)
    # In the order of the headings, whatever was asked for in which.
    contenders = {name: contenders[name] for name in HEADINGS if name in contenders}
    errors = {name: error_of(contenders[name].run(), model, state) for name in contenders if name != "loop"}
    check(errors, "kogge-stone")
    return {"n": n, "seconds": take_turns(contenders, repeats), "errors": errors, "left out": left_out}


def ours(model: Model, state: State, layout: str, detail: str, forces: np.ndarray | None = None) -> Contender:
    """Make a contender of `mp2a.rnea`: a layout, and what is different from one thread and ``out=``."""
    order = "C" if layout == "rows" else "F"
    dtype = np.float32 if detail == "float32" else np.float64
    q, v, a = (np.asarray(x, dtype, order=order) for x in state)  # type: ignore[call-overload]
    out = np.empty(v.shape, dtype, order=order)  # type: ignore[call-overload]
    keywords: dict[str, Any] = {"threads": 2 if detail == "2" else 1, "dtype": dtype}
    if detail == "bodies":
        keywords["bodies"] = True
        earlier = mp2a.rnea(model, q, v, a, forces, **keywords)
        return Contender(lambda: mp2a.rnea(model, q, v, a, forces, out=earlier, **keywords).torque, len(q))
    if detail != "fresh":
        keywords["out"] = out
    return Contender(lambda: mp2a.rnea(model, q, v, a, forces, **keywords), len(q))


def pinocchio(model: Model, state: State, threads: int) -> dict[str, Contender]:
    """Make pinocchio's contenders; it gets columns, as it wants them, and an array for the result as well."""
    import pinocchio as pin

    need_memory(model.nv, copies=threads + 1)  # the pool is filled by copying
    pin_model = model.to_pinocchio()
    pool = pin.ModelPool(pin_model, threads)
    data = pool.getData(0)
    q, v, a = (np.asfortranarray(x.T) for x in state)
    torque = np.zeros((model.nv, len(state[0])), order="F")
    some = [x[: max(1, min(len(x), _LOOPED // len(model)))] for x in state]

    def loop() -> None:
        rnea = pin.rnea
        for sample in zip(*some, strict=True):
            rnea(pin_model, data, *sample)

    def parallel(count: int) -> Callable[[], np.ndarray]:
        def call() -> np.ndarray:
            pin.rneaInParallel(count, pool, q, v, a, torque)
            return torque.T

        return call

    serial = {"loop": Contender(loop, len(some[0])), "pinocchio": Contender(parallel(1), len(state[0]))}
    return serial | ({"pinocchio 2": Contender(parallel(2), len(state[0]))} if threads == 2 else {})


def error_of(result: Any, model: Model, state: State) -> float:
    """Largest difference from the paper's own method, in numpy, on a few samples; of the largest torque."""
    torque = result.torque if isinstance(result, mp2a.InverseDynamics) else result
    expected = mp2a.rnea(model, *(x[:3] for x in state), method="kogge-stone")
    return float(np.abs(torque[:3] - expected).max() / np.abs(expected).max())


def check(errors: dict[str, float], reference: str) -> None:
    """End the program where a contender computes something else; its time would mean nothing."""
    for name, error in errors.items():
        if not error <= (1e-2 if name.endswith("float32") else 1e-8):
            sys.exit(f"{HEADINGS.get(name, name)} is {error:.0e} of the largest torque away from {reference}")


# ---- joints, features, other libraries ---------------------------------------------------------------------------


def joints(samples: int, repeats: int, say: Say) -> dict[str, Any]:
    """Measure each joint type, trees and external forces on the same number of bodies, all in one run."""
    say("joint types")
    n = _JOINT_CHAIN
    rng = np.random.default_rng(0)
    cases: dict[str, tuple[Model, np.ndarray | None]] = {}
    for name in JOINTS:
        cases[name] = Model.random(n, joints=(name,)), None
    cases["all types in turn"] = Model.random(n, joints=tuple(JOINTS)), None
    cases["revolute, tree"] = Model.random(n, branching=4), None
    cases["revolute, constant forces"] = cases["revolute"][0], rng.normal(size=(n, 6))
    cases["revolute, forces in each sample"] = cases["revolute"][0], rng.normal(size=(samples, n, 6))
    contenders = {}
    for case, (model, forces) in cases.items():
        state = model.random_state(samples)
        for layout in ("rows", "columns"):
            contenders[f"{case}: {layout}"] = ours(model, state, layout, "", forces)
        if forces is None:
            contenders[f"{case}: pinocchio"] = pinocchio(model, state, 1)["pinocchio"]
    degrees = {case: model.nv / n for case, (model, _) in cases.items()}
    return {"n": n, "seconds": take_turns(contenders, repeats), "degrees": degrees}


def features(sizes: Sequence[int], samples: int, repeats: int, say: Say) -> dict[str, Any]:
    """Measure kernels for processors that have less, each in a process and with a cache of its own."""
    runs = {}
    for name, lacking in FEATURES.items():
        say(f"{name} only: compiling and measuring")
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "batch.json"
            environment = os.environ | {CPU_FEATURES: lacking, "XDG_CACHE_HOME": folder}
            command = [sys.executable, __file__, "--contenders", "pinocchio,rows,columns", "--out", str(out)]
            command += ["--n", ",".join(map(str, sizes)), "--samples", str(samples), "--repeats", str(repeats)]
            subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
            runs[name] = json.loads(out.read_text(encoding="utf-8"))["runs"]
    return runs


def others(sizes: Sequence[int], samples: int, repeats: int, say: Say) -> list[dict[str, Any]]:
    """Measure other libraries that are installed beside ours, and how far their torques are from ours."""
    runs = []
    for n in sizes:
        model = Model.random(n)
        state = model.random_state(samples)
        contenders = {"rows": ours(model, state, "rows", ""), "rows 2": ours(model, state, "rows", "2")}
        expected, errors = mp2a.rnea(model, *state), {}
        for name, library in LIBRARIES.items():
            if is_there(library) and n <= library.largest:
                say(f"n = {n}: {name}, which may have to compile")
                batch = library.prepare(model, state)
                errors[name] = float(np.abs(batch() - expected).max() / np.abs(expected).max())
                contenders[name] = Contender(batch, samples)
        check(errors, "ours")
        runs.append({"n": n, "seconds": take_turns(contenders, repeats), "errors": errors})
    return runs


# ---- tables ------------------------------------------------------------------------------------------------------


def tables(results: dict[str, Any]) -> list[Table]:
    """Make all tables of what was measured."""
    runs, samples = results["runs"], results["samples"]
    there = [name for name in HEADINGS if any(name in run["seconds"] for run in runs)]
    out = []
    for what, names in (
        ("", [name for name in there if name in MAIN]),
        (", one thread", [name for name in there if name not in MAIN]),
    ):
        rows = [[run["n"], *(nanoseconds(run["seconds"], name, run["n"]) for name in names)] for run in runs]
        if names:
            columns = [Column("n"), *(Column(HEADINGS[name], show_plain) for name in names)]
            out.append(Table(f"ns a body and sample{what}, T = {samples}, revolute joints", columns, rows))
    pairs = [pair for pair in RATIOS if all(name in there for name in pair)]
    if pairs:
        columns = [Column("n")]
        columns += [Column(f"{HEADINGS[slow]}, over {HEADINGS[fast]}", show_ratio) for slow, fast in pairs]
        rows = [[run["n"], *(ratio(run["seconds"], *pair) for pair in pairs)] for run in runs]
        out.append(Table("how many times longer pinocchio takes", columns, rows))
    names = [name for name in ("rows", "rows float32") if name in there]
    rows = [[run["n"], *(run["errors"][name] for name in names)] for run in runs]
    columns = [Column("n"), *(Column(HEADINGS[name], "{:.0e}".format) for name in names)]
    out.append(Table("largest difference from kogge-stone in numpy, of the largest torque", columns, rows))
    if "joints" in results:
        out.append(joint_table(results["joints"]))
    for name, narrow in results.get("features", {}).items():
        columns = [Column("n"), *(Column(heading, show_plain) for heading in ("pinocchio", "(T, n)", "(n, T)"))]
        columns += [Column(f"pinocchio, over {layout}", show_ratio) for layout in ("(T, n)", "(n, T)")]
        rows = []
        for run in narrow:
            each = [nanoseconds(run["seconds"], key, run["n"]) for key in ("pinocchio", "rows", "columns")]
            more = [ratio(run["seconds"], "pinocchio", key) for key in ("rows", "columns")]
            rows.append([run["n"], *each, *more])
        out.append(Table(f"{name} only, ns a body and sample, one thread", columns, rows))
    if "others" in results:
        out.append(other_table(results["others"]))
    return out


def joint_table(results: dict[str, Any]) -> Table:
    """Make the table of joint types."""
    seconds, n = results["seconds"], results["n"]
    columns = [Column("joints", left=True), Column("degrees of freedom", "{:.1f}".format)]
    columns += [Column(heading, show_plain) for heading in ("(T, n)", "(n, T)", "pinocchio")]
    columns += [Column(heading, show_ratio) for heading in ("(T, n), over revolute", "pinocchio, over (T, n)")]
    rows = []
    for case, degrees in results["degrees"].items():
        rowwise, columnwise, theirs = (f"{case}: {kind}" for kind in ("rows", "columns", "pinocchio"))
        each = [nanoseconds(seconds, key, n) for key in (rowwise, columnwise, theirs)]
        more = ratio(seconds, rowwise, "revolute: rows"), ratio(seconds, theirs, rowwise)
        rows.append([case, degrees, *each, *more])
    return Table(f"ns a body and sample, n = {n}, one thread", columns, rows)


def other_table(runs: Sequence[dict[str, Any]]) -> Table:
    """Make the table of other libraries."""
    columns = [Column("library", left=True), Column("form", left=True), Column("n")]
    columns += [Column("ns a body and sample", show_plain), Column("difference", "{:.0e}".format)]
    columns += [Column(heading, show_ratio) for heading in ("over 1 thread", "over 2 threads")]
    rows = []
    for name, library in LIBRARIES.items():
        for run in (run for run in runs if name in run["seconds"]):
            more = ratio(run["seconds"], name, "rows"), ratio(run["seconds"], name, "rows 2")
            each = nanoseconds(run["seconds"], name, run["n"]), run["errors"][name]
            rows.append([name, library.form, run["n"], *each, *more])
    return Table("other libraries, T samples on arrays (T, n); over ours on the same arrays", columns, rows, keys=3)


def nanoseconds(seconds: Times, name: str, n: int) -> Spread | None:
    """Return times in ns a body."""
    return spread(seconds, name, 1e9 / n)


if __name__ == "__main__":
    main()
