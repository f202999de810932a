"""Programs of tests/under_mpi, run by mpirun with 1, 2, 3, 5 and 8 ranks, or up to 3 where ranks spin.

One program alone: ``mpirun -n 3 python -m mpi4py tests/under_mpi/rounds.py``.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from mp2a import launch
from mp2a.launch.command import find_mpirun, open_mpi_version

FOLDER = Path(__file__).with_name("under_mpi")
PROGRAMS = sorted(path.stem for path in FOLDER.glob("[a-z]*.py"))
# MPICH's ranks spin while they wait: with more of them than cores a message takes as long as a time slice.
RANKS = (1, 2, 3, 5, 8) if open_mpi_version(find_mpirun()) else (1, 2, 3)
FIRST = "simulated"  # it looks at what its ranks have loaded, so nothing may run before it


@pytest.mark.parametrize("ranks", RANKS)
def test_programs(ranks):
    """A rank that raises ends all. Every program says how many checks it made, so that one that makes none fails."""
    programs = sorted(PROGRAMS, key=lambda program: program != FIRST)
    done = launch.run(
        ranks,
        [sys.executable, "-m", "mpi4py", str(FOLDER / "_run.py"), *(str(FOLDER / f"{name}.py") for name in programs)],
        timeout=300,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout
    checks = dict(re.findall(r"^(\w+): checks: (\d+)$", done.stdout, flags=re.MULTILINE))
    assert sorted(checks) == PROGRAMS, done.stdout
    assert all(int(count) > 0 for count in checks.values()), done.stdout
