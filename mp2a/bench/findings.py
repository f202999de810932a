"""What a reader of the benchmark's tables should see in them, in sentences that are worked out from the runs."""

from collections.abc import Iterable, Mapping
from typing import Any

from mp2a.bench.contenders import ALONE, BASELINES, ONE_PROCESS, PINOCCHIO, PIPELINE, family
from mp2a.tables import show_ratio, show_seconds

Run = Mapping[str, Any]


def findings(runs: Iterable[Run]) -> list[str]:
    """Say who was fastest and by how much, and what the machine cannot show.

    Parameters
    ----------
    runs
        With the same settings, by rising n.

    Returns
    -------
    list of str
        Sentences.
    """
    held = list(runs)
    last = held[-1]
    out = [_contest(last)]
    out.append(_growth(held[0], last) if last["emulated"] and len(held) > 1 else _one_process(last))
    out.append(_machine(held))
    return [sentence for sentence in out if sentence]


def _contest(run: Run) -> str:
    """Compare our fastest method with the fastest of each family of others that have a rank a robot."""
    times = _times(run)
    best = _ours(run)
    rivals: dict[str, str] = {}
    for name in sorted(times, key=lambda name: times[name]):
        if name in BASELINES and name not in ALONE:
            rivals.setdefault(family(name), name)
    found = f"One sample at a time on {run['n']} ranks, {best}, our fastest method, takes {show_seconds(times[best])}"
    if not rivals:
        return f"{found}."
    ratios = [f"{show_ratio(times[best] / times[name])} that of {name}" for name in rivals.values()]
    return f"{found}, {_listed(ratios)}."


def _growth(first: Run, last: Run) -> str:
    """Compare how times grow with the number of robots."""
    best = _ours(last)
    before, after = _times(first), _times(last)
    if PIPELINE not in before or PIPELINE not in after or best not in before:
        return ""
    rounds = [run["methods"][best]["rounds"] for run in (first, last)]
    hops = [2 * (run["n"] - 1) for run in (first, last)]
    return (
        f"From n = {first['n']} to {last['n']} {best} goes from {rounds[0]} to {rounds[1]} rounds and takes "
        f"{show_ratio(after[best] / before[best])} as long, the pipeline from {hops[0]} to {hops[1]} hops and takes "
        f"{show_ratio(after[PIPELINE] / before[PIPELINE])} as long."
    )


def _one_process(run: Run) -> str:
    """Compare what one process takes that knows everything."""
    times = _times(run)
    if ONE_PROCESS not in times:
        return ""
    best = _ours(run)
    found = f"One process that knows everything takes {show_seconds(times[ONE_PROCESS])} by mp2a.rnea"
    if PINOCCHIO in times:
        together = _times(run, "batch")
        ratio = show_ratio(times[PINOCCHIO] / times[ONE_PROCESS])
        found += f", pinocchio {ratio} as long"
        if together:
            many = show_ratio(together[PINOCCHIO] / together[ONE_PROCESS])
            found += f" and with {run['samples']} samples together {many}"
    return f"{found}; {best} over ranks takes {show_ratio(times[best] / times[ONE_PROCESS])} as long as mp2a.rnea."


def _machine(runs: list[Run]) -> str:
    """Say what the wall times do not show."""
    last = runs[-1]
    if last["emulated"]:
        return (
            "The network is emulated: ranks, messages and arithmetic are real, their lateness is not, and messages do "
            "not slow each other down, which a robot that gets one from each of the others gains from."
        )
    crowded = [str(run["n"]) for run in runs if run["oversubscribed"]]
    if not crowded:
        return "Every rank had a core of its own, and the network is this machine's memory: no real one was measured."
    return (
        f"With n = {', '.join(crowded)} ranks take turns on {last['cores']} cores: wall time is then the work of all "
        "robots and cannot show what they gain by working at the same time; nor is there a real network, where rounds "
        "are what counts."
    )


def _times(run: Run, size: str = "single") -> dict[str, float]:
    """Return the medians of those who were measured."""
    return {name: sizes[size]["wall"] for name, sizes in run["measured"].items() if size in sizes}


def _ours(run: Run) -> str:
    times = _times(run)
    return min((name for name in times if name not in BASELINES), key=lambda name: times[name])


def _listed(words: list[str]) -> str:
    return f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else words[0]
