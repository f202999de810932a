"""One run after another over numbers of ranks: start them, show how far they are, keep what they measured."""

import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mp2a import files, kernels, launch
from mp2a.bench import results
from mp2a.bench.machine import processor_name
from mp2a.bench.settings import ERROR, PROGRESS, STARTED, BenchSettings
from mp2a.cores import available_memory
from mp2a.exceptions import DependencyError

_PRELOAD = ("mp2a.cli", "mp2a.bench.rank", "mp2a.bench.timeline")
"""What ranks run, imported once for all of them where they share cores."""


def run_campaign(
    ranks: Sequence[int],
    settings: BenchSettings,
    path: Path,
    *,
    resume: bool,
    say: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Run the benchmark for each number of ranks and append each run to one results file as soon as it is over.

    Parameters
    ----------
    ranks
        Numbers of ranks, each of which mpirun is started for.
    settings
        Of every run.
    path
        The results file.
    resume
        Leave out a run that the file holds already with these settings on such a processor.
    say
        Called with what is being done.

    Returns
    -------
    list of dict
        The runs for these ranks. Those that were not made now have a key ``"kept"``.

    Raises
    ------
    DependencyError
        If there is no mpirun, or the ranks of a run failed; runs before it are kept.
    OutputError
        If the file cannot be written, before anything is measured if that can be known.
    """
    files.check_writable(path)
    processor = processor_name()
    runs = []
    for n in ranks:
        run = results.find_run(path, processor, n=n, **settings.identity()) if resume else None
        if run is None:
            run = _measure(n, settings, say)
            results.append(path, run)
        else:
            say(f"n = {n}: already in {path}")
            run["kept"] = str(path)
        runs.append(run)
    return runs


def run_ranks(arguments: Sequence[str], n: int, say: Callable[[str], None]) -> dict[str, Any]:
    """Run an ``mp2a`` command on n ranks, of which rank 0 writes JSON to the file that is put after ``--out``.

    Parameters
    ----------
    arguments
        The command and its options.
    n
        Number of ranks.
    say
        Called with what the ranks are doing.

    Returns
    -------
    dict
        What was written.

    Raises
    ------
    DependencyError
        If there is no mpirun, or the ranks failed.
    """
    kernels.build()  # hundreds of ranks load what one process has compiled
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.json"
        program = [sys.executable, "-m", "mp2a", *arguments, "--out", str(out), "--quiet"]
        environment = {STARTED: repr(time.time())}
        say("starting the ranks")
        pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        with launch.start(n, program, environment=environment, preload=_PRELOAD, **pipe) as process:
            last = _follow(process.stdout or (), say)
            code = process.wait()
        if code or not out.exists():
            errors = [line.removeprefix(ERROR) for line in last if line.startswith(ERROR)]
            raise DependencyError("\n".join(errors or [f"mpirun with {n} ranks ended with status {code}:", *last]))
        loaded: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
        return loaded


def _measure(n: int, settings: BenchSettings, say: Callable[[str], None]) -> dict[str, Any]:
    began = time.monotonic()
    with _lowest_free_memory() as free:
        done = run_ranks(["bench", *_arguments(settings)], n, lambda what: say(f"n = {n}: {what}"))
    run: dict[str, Any] = done["runs"][-1]
    run["took_s"] = time.monotonic() - began
    run["memory_taken"] = free()
    return run


def _arguments(settings: BenchSettings) -> list[str]:
    """Spell settings as options of ``mp2a bench``."""
    spelled = {name: value for name, value in settings._asdict().items() if value is not None}
    for name in ("methods", "baselines"):
        spelled[name] = ",".join(getattr(settings, name))
    if settings.network is not None:
        spelled["network"] = f"{settings.network.latency!r}s,{settings.network.bandwidth!r}bit"
    return [word for name, value in spelled.items() for word in (f"--{name.replace('_', '-')}", str(value))]


def _follow(lines: Any, say: Callable[[str], None]) -> list[str]:
    """Pass progress on and return the last other lines."""
    rest: list[str] = []
    for line in lines:
        if line.startswith(PROGRESS):
            say(line.removeprefix(PROGRESS).rstrip())
        else:
            rest = [*rest[-30:], line.rstrip()]
    return rest


@contextmanager
def _lowest_free_memory() -> Iterator[Callable[[], int | None]]:
    """Watch how far the machine's available memory falls, in bytes; None where the system does not say."""
    before = available_memory()
    lowest = before or 0
    over = threading.Event()

    def watch() -> None:
        nonlocal lowest
        while not over.wait(0.25):
            lowest = min(lowest, available_memory() or 0)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield lambda: before - lowest if before else None
    finally:
        over.set()
        watcher.join()
