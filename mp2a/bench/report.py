"""The benchmark's tables: what was measured, modelled and extrapolated, each named so, and two files compared."""

from collections.abc import Iterator
from typing import Any

from mp2a.bench.contenders import BASELINES, LABELS
from mp2a.bench.machine import machine_line
from mp2a.bench.scaling import scaling_table, scalings
from mp2a.exceptions import InputError
from mp2a.tables import Column, Spread, Table, show_ratio, show_seconds

Run = dict[str, Any]

_SIZES = {"batch": "samples in one message", "single": "one sample at a time"}
_MODELLED = {
    "kogge-stone": "kogge-stone",
    "kogge-stone, table I": "kogge-stone, Table I",
    "serial": "pipeline's messages",
}


def latest(runs: list[Run]) -> list[Run]:
    """Return runs by rising n, of several for one n the last.

    Raises
    ------
    InputError
        If there is no run.
    """
    if not runs:
        raise InputError("results: got no run, expected at least one")
    return sorted({run["n"]: run for run in runs}.values(), key=lambda run: int(run["n"]))


def bench_tables(runs: list[Run]) -> list[Table]:
    """Make the tables of runs with the same settings.

    Parameters
    ----------
    runs
        One for each n, rising, with the key ``"kept"`` if they were not made now.

    Returns
    -------
    list of Table
        What is sent and how exact it is, what was measured, how chains in blocks scale, what the times extrapolate to,
        and what the paper's model says.
    """
    tables = [_messages(runs), _times(runs), *map(scaling_table, scalings(runs)), _extrapolated(runs)]
    return [*tables, _modelled(runs)] if any(run["modelled"] for run in runs) else tables


def bench_notes(runs: list[Run]) -> list[str]:
    """Say what the tables' words mean, where and when they were measured, and what is missing and why."""
    out = [
        "Measured times are medians over repeats (csv and json have quartiles as well). Extrapolated: processor time "
        "that a machine with a core a robot would need, its network not counted: the largest of a rank; for the "
        "pipeline that and all hops one after another.",
    ]
    if any(run["modelled"] for run in runs):
        out.append(
            "Modelled: eq. 13 of the paper, which adds the latencies of all messages as if none overlapped. T_s is "
            "the pipeline's time for all samples, L_a the time of 6 numbers between two ranks and N_TS the speed of "
            "84 000, unless they were given; Table I counts fewer messages than are needed."
        )
    out += [
        f"Not measured now: n = {run['n']} is from {run['kept']}, measured {run['date']} on "
        f"{run['machine']['host']} ({run['machine']['processor']})."
        for run in runs
        if "kept" in run
    ]
    # The same is missing for the same reason in all runs, in which only figures differ.
    out += {reason.partition(":")[0]: reason for run in runs for reason in run["missing"]}.values()
    against = {facts["error"]["against"] for run in runs for facts in run["methods"].values()}
    out.append(f"Error: largest difference from {' or '.join(sorted(against))} over the largest torque.")
    return out + [f"Measured on {line}." for line in sorted({machine_line(run["machine"]) for run in runs[-1:]})]


def comparison(before: list[Run], after: list[Run]) -> tuple[Table, list[str]]:
    """Compare the runs of two results files that have the same n and settings.

    Parameters
    ----------
    before, after
        The runs of each file; of several alike the last counts.

    Returns
    -------
    Table
        How many times as long each contender took afterwards, a row a contender of a run: the median and the quartiles
        of the ratios of every repeat to every repeat before.
    list of str
        Where both were measured, and what only one of them holds.

    Raises
    ------
    InputError
        If they have no run in common.
    """
    first, second = ({_identity(run): run for run in runs} for runs in (before, after))
    common = [key for key in first if key in second]
    if not common:
        raise InputError("--compare: got files without a run of the same n and settings, expected at least one")
    rows: list[list[Any]] = []
    notes = [
        "B over A: below 1, B is faster. Median and quartiles of the ratios of each repeat of B to each repeat of A."
    ]
    for key in sorted(common, key=lambda key: (key[0], str(key))):
        a, b = first[key], second[key]
        names = [name for name in _names([a, b]) if name in a["measured"] and name in b["measured"]]
        for name in names:
            old, new = a["measured"][name], b["measured"][name]
            ratios = [_ratio(old[size], new[size]) if size in old and size in new else None for size in _SIZES]
            rows.append([a["n"], _network(a), name, *ratios])
        notes += _differences(a, b)
    for label, mine, other in (("A", first, second), ("B", second, first)):
        alone = [f"n = {key[0]}" for key in mine if key not in other]
        notes += [f"Only in {label}: {', '.join(alone)} with settings that the other has no run of."] if alone else []
    columns = [
        Column("n"), Column("network", left=True), Column("contender", left=True),
        *(Column(f"B / A, {what}", show_ratio) for what in _SIZES.values()),
    ]  # fmt: skip
    return Table("time in B over time in A", columns, rows, keys=3), list(dict.fromkeys(notes))


def _ratio(old: dict[str, Any], new: dict[str, Any]) -> Spread:
    return Spread.of(b / a for a in old["walls"] for b in new["walls"])


def _identity(run: Run) -> tuple[Any, ...]:
    return (run["n"], *(str(run.get(name)) for name in ("samples", "seed", "emulated", "bodies", "bodies_per_rank")))


def _differences(a: Run, b: Run) -> Iterator[str]:
    """Say in which way the machines of two runs differ, or that they do not."""
    ours, theirs = a["machine"], b["machine"]
    yield f"A: {a['date']}, {machine_line(ours)}."
    yield f"B: {b['date']}, {machine_line(theirs)}."
    if (ours["processor"], ours["cores"]) == (theirs["processor"], theirs["cores"]):
        yield "Both on the same kind of processor and as many cores."
    else:
        yield "NOT the same processor or number of cores: the ratios are those of the machines as well."
    if ours["kernels"] != theirs["kernels"]:
        yield "NOT the same kernels: the ratios are those of the kernels as well."


def _messages(runs: list[Run]) -> Table:
    columns = [
        Column("n"), Column("method", left=True), Column("rounds"), Column("messages sent"), Column("bytes sent"),
        Column("messages by formula"), Column("relative error", lambda error: f"{error:.0e}"),
    ]  # fmt: skip
    rows = [
        [
            *(run["n"], name, facts["rounds"], facts["sent"]["messages"], facts["sent"]["bytes"]),
            *(facts["messages"], facts["error"]["relative"]),
        ]
        for run in runs
        for name, facts in run["methods"].items()
    ]
    return Table("messages for one sample, all robots together", columns, rows, keys=2)


def _times(runs: list[Run]) -> Table:
    """Return the wall times: a row a contender and way in which samples travel, a column a number of ranks."""
    rows = [
        [_together(runs, size), name, *(_spread(run["measured"].get(name, {}).get(size)) for run in runs)]
        for size in _sizes(runs)
        for name in _names(runs)
    ]
    return Table(f"measured: wall time a sample{_network_of(runs)}", _columns(runs, "contender"), rows, keys=2)


def _extrapolated(runs: list[Run]) -> Table:
    names = dict.fromkeys(name for run in runs for name in run["extrapolated"])
    rows = [
        [_together(runs, size), name, *(run["extrapolated"].get(name, {}).get(size) for run in runs)]
        for size in _sizes(runs)
        for name in names
    ]
    title = "extrapolated to a core a robot, network not counted: time a sample"
    return Table(title, _columns(runs, "contender"), rows, keys=2)


def _modelled(runs: list[Run]) -> Table:
    columns = [
        Column("n"), Column("T_s", show_seconds, "s"), Column("L_a", show_seconds, "s"),
        Column("N_TS, Gbit/s", lambda speed: f"{speed:.3g}"),
        *(Column(label, show_seconds, "s") for label in _MODELLED.values()),
    ]  # fmt: skip
    rows = []
    for run in runs:
        if run["modelled"]:
            constants = run["constants"]
            row = [run["n"], constants["serial_time"], constants["latency"], constants["speed"] / 1e9]
            rows.append(row + [run["modelled"][name]["single"] for name in _MODELLED])
    return Table("modelled: time a sample by eq. 13, and the constants in it", columns, rows)


def _columns(runs: list[Run], what: str) -> list[Column]:
    times = [Column(f"n = {run['n']}", _median, "s") for run in runs]
    return [Column("samples a message"), Column(what, left=True), *times]


def _sizes(runs: list[Run]) -> list[str]:
    """Ways in which samples travelled, one at a time first."""
    held = {size for run in runs for sizes in run["measured"].values() for size in sizes}
    return [size for size in ("single", "batch") if size in held]


def _together(runs: list[Run], size: str) -> int:
    return 1 if size == "single" else int(runs[-1]["samples"])


def _median(value: Spread | float) -> str:
    """Write a median alone: columns of quartiles would not fit beside each other."""
    return show_seconds(value.median if isinstance(value, Spread) else value)


def _names(runs: list[Run]) -> list[str]:
    """Contenders that were measured, methods first, as they are shown everywhere."""
    measured = dict.fromkeys(name for run in runs for name in run["measured"])
    methods = [name for name in measured if name not in BASELINES]
    return [*sorted(methods, key=list(LABELS).index), *(name for name in BASELINES if name in measured)]


def _spread(timing: dict[str, Any] | None) -> Spread | None:
    return None if timing is None else Spread.of(timing["walls"])


def _network_of(runs: list[Run]) -> str:
    network = _network(runs[-1])
    return f", over an emulated network of {network}" if network != "-" else ""


def _network(run: Run) -> str:
    emulated = run["emulated"]
    return f"{1e3 * emulated[0]:g} ms, {emulated[1] / 1e6:g} Mbit/s" if emulated else "-"
