"""MPI's own scan is compiled once, or the reason is told. Its torques: tests/under_mpi/mpi_scan.py."""

import os
import shutil
import subprocess
import sys

import pytest

OBTAIN = """
import shutil, sys
if sys.argv[1:]:
    shutil.which = lambda name, path=None: sys.argv[1] or None
from mp2a.bench.mpi_scan import obtain_library
from mp2a.exceptions import DependencyError
from mp2a.mpi import MPI
try:
    print(obtain_library(MPI.COMM_SELF)._name)
except DependencyError as error:
    print("missing:", error)
"""

OTHER_MPI = """
#include <string.h>
int MPI_Get_library_version(char *text, int *length) { *length = 11; strcpy(text, "Other MPI 1"); return 0; }
"""


@pytest.fixture
def obtain(tmp_path):
    """Obtain the library in a process of its own, with a cache of its own, by an mpicc if one is given."""

    def run(*mpicc):
        command = [sys.executable, "-c", OBTAIN, *map(str, mpicc)]
        environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=True)
        return done.stdout.strip()

    return run


def script(path, text):
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


def test_it_is_compiled_once(obtain, tmp_path):
    first = obtain()
    if first.startswith("missing:"):
        pytest.skip(first)
    [made] = (tmp_path / "cache" / "mp2a").iterdir()
    assert str(made) == first
    before = made.stat().st_mtime_ns
    assert obtain() == first
    assert made.stat().st_mtime_ns == before


def test_without_a_compiler_the_reason_is_told(obtain, tmp_path):
    assert "rank 0: there is no mpicc" in obtain("")
    broken = script(tmp_path / "mpicc", "echo 'cc: not found' >&2; exit 1")
    assert f"rank 0: {broken} does not compile its operator (cc: not found)" in obtain(broken)


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_compiler_of_another_mpi_is_told(obtain, tmp_path):
    (tmp_path / "other.c").write_text(OTHER_MPI)
    other = script(tmp_path / "mpicc", f'while [ "$1" != -o ]; do shift; done; cc -shared -o "$2" {tmp_path}/other.c')
    assert "mpicc is of Other MPI 1, mpi4py of" in obtain(other)
