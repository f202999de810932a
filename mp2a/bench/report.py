"""The benchmark's tables: what was measured, modelled and extrapolated, each named so, and two files compared."""

from collections.abc import Iterator
from typing import Any

from mp2a.bench.contenders import BASELINES, LABELS
from mp2a.bench.machine import machine_line
from mp2a.exceptions import InputError
from mp2a.tables import Column, Spread, Table, show_ratio, show_seconds

Run = dict[str, Any]

_SIZES = {"batch": "samples in one message", "single": "one sample at a time"}
_MODELLED = {
    "kogge-stone": "kogge-stone, eq. 13",
    "kogge-stone, table I": "kogge-stone, eq. 13, Table I",
    "serial": "messages of the pipeline",
}


def bench_tables(runs: list[Run]) -> list[Table]:
    """Make the tables of runs with the same settings, of several with one n of the last.

    Parameters
    ----------
    runs
        Of a results file, with the key ``"kept"`` if they were not made now.

    Returns
    -------
    list of Table
        What is sent and how exact it is, what was measured, and what was not.

    Raises
    ------
    InputError
        If there is no run.
    """
    if not runs:
        raise InputError("results: got no run, expected at least one")
    latest = sorted({run["n"]: run for run in runs}.values(), key=lambda run: int(run["n"]))
    return [_messages(latest), *(_marked(table(latest), latest) for table in (_times, _not_measured))]


def bench_notes(runs: list[Run]) -> list[str]:
    """Say what the tables' signs mean, where and when they were measured, and what is missing and why."""
    out = [
        "Times are medians and quartiles over repeats. Extrapolated: processor time that a machine with a core a robot "
        "would need, its network not counted: the largest of a rank; for the pipeline that and all hops one after "
        "another.",
    ]
    crowded = sorted({run["cores"] for run in runs if run["oversubscribed"]})
    if crowded:
        cores = " or ".join(map(str, crowded))
        out.append(f"† oversubscribed: more ranks than the {cores} cores, so wall time is all robots' work on {cores}.")
    out += [
        f"‡ not measured now: n = {run['n']} is from {run['kept']}, measured {run['date']} on "
        f"{run['machine']['host']} ({run['machine']['processor']})."
        for run in runs
        if "kept" in run
    ]
    out += sorted({run["missing"] for run in runs if run["missing"]})
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
    return (run["n"], *(str(run[name]) for name in ("samples", "seed", "emulated")))


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
    rows = []
    for run in runs:
        for name in _names([run]):
            sizes = run["measured"][name]
            rows.append([run["n"], name, *(_spread(sizes.get(size)) for size in _SIZES)])
    return Table(f"measured: wall time a sample{_network_of(runs)}", _columns(runs, "contender"), rows, keys=2)


def _not_measured(runs: list[Run]) -> Table:
    rows = []
    for run in runs:
        for name, sizes in run["extrapolated"].items():
            rows.append([run["n"], f"{name}, extrapolated", *(sizes.get(size) for size in _SIZES)])
        for name, label in _MODELLED.items():
            rows.append([run["n"], f"{label}, modelled", *(run["modelled"][name].get(size) for size in _SIZES)])
    return Table("not measured: time a sample", _columns(runs, "what"), rows, keys=2)


def _columns(runs: list[Run], what: str) -> list[Column]:
    counts = "/".join(dict.fromkeys(str(run["samples"]) for run in runs))
    headings = {"batch": f"{counts} {_SIZES['batch']}", "single": _SIZES["single"]}
    times = [Column(heading, show_seconds, "s") for heading in headings.values()]
    return [Column("n"), Column(what, left=True), *times]


def _names(runs: list[Run]) -> list[str]:
    """Contenders that were measured, methods first, as they are shown everywhere."""
    measured = dict.fromkeys(name for run in runs for name in run["measured"])
    methods = [name for name in measured if name not in BASELINES]
    return [*sorted(methods, key=list(LABELS).index), *(name for name in BASELINES if name in measured)]


def _spread(timing: dict[str, Any] | None) -> Spread | None:
    return None if timing is None else Spread.of(timing["walls"])


def _marks(run: Run) -> str:
    return f"{'†' if run['oversubscribed'] else ''}{'‡' if 'kept' in run else ''}"


def _marked(table: Table, runs: list[Run]) -> Table:
    """Add a column that says which rows are marked, if any is; ``runs`` are those of the rows."""
    marks = {run["n"]: _marks(run) for run in runs}
    if not any(marks.values()):
        return table
    rows = [[*row, marks[row[0]]] for row in table.rows]
    return table._replace(columns=[*table.columns, Column("notes", left=True)], rows=rows)


def _network_of(runs: list[Run]) -> str:
    network = _network(runs[-1])
    return f", over an emulated network of {network}" if network != "-" else ""


def _network(run: Run) -> str:
    emulated = run["emulated"]
    return f"{1e3 * emulated[0]:g} ms, {emulated[1] / 1e6:g} Mbit/s" if emulated else "-"
