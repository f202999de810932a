"""Programs of tests/under_mpi, each run by mpirun with 1, 2, 3, 5 and 8 ranks."""

import subprocess
import sys
from pathlib import Path

import pytest

from mp2a import launch

PROGRAMS = sorted(Path(__file__).with_name("under_mpi").glob("[a-z]*.py"))
RANKS = (1, 2, 3, 5, 8)


def run(ranks, *program):
    """Run a program on ranks; a rank that raises ends all (python -m mpi4py), a hang is a failure."""
    done = launch.run(
        ranks,
        [sys.executable, "-m", "mpi4py", *program],
        timeout=180,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_program(program, ranks):
    """Every program ends by rank 0 saying how many checks it made, so that one that checks nothing fails."""
    last = run(ranks, str(program)).splitlines()[-1]
    assert last.startswith("checks: ")
    assert int(last.removeprefix("checks: ")) > 0
