"""MPI's own scan: the same inverse dynamics by ``MPI_Scan`` with an operator in C, which this MPI's mpicc compiles.

The C file beside this one says how. It is compiled once for a processor and an MPI, into the folder in which the
kernels are kept too. Open MPI takes one rank after another by default; it has recursive doubling as well, which it
takes where two of its control variables say so when a communicator is made.
"""

import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np

from mp2a.exceptions import DependencyError, InputError
from mp2a.kernels import pointer
from mp2a.kernels.library import cache_folders, checksum, find, is_private, processor
from mp2a.model import Model
from mp2a.mpi import MPI
from mp2a.spatial import Array
from mp2a.transport.agreement import shared_errors

_SOURCE = Path(__file__).with_suffix(".c")
_FLAGS = ("-O3", "-march=native", "-shared", "-fPIC")
_LIMIT = 120.0
_DOUBLING = {b"coll_tuned_scan_algorithm": 2, b"coll_tuned_use_dynamic_rules": 1}
"""Control variables of Open MPI that have it scan by recursive doubling."""


class MPIScan:
    """Inverse dynamics of a chain of revolute joints, one rank a body, by two calls of ``MPI_Scan``.

    Parameters
    ----------
    comm
        Ranks in the order of the chain; making one is collective.
    model
        The whole chain.
    library
        What `obtain_library` returned.
    doubling
        Have Open MPI scan by recursive doubling.
    """

    def __init__(self, comm: MPI.Intracomm, model: Model, library: ctypes.CDLL, *, doubling: bool = False) -> None:
        if set(model.joints) != {"revolute"}:
            raise InputError(f"model: got joints {', '.join(sorted(set(model.joints)))}, expected revolute ones alone")
        self._library, self._rnea = library, library.mp2a_scan_rnea
        body = model.body(comm.Get_rank())
        gravity = body.gravity if comm.Get_rank() == 0 else np.zeros(3)
        mass, com = body.masses[0], body.coms[0]
        parts = (
            body.rotations[0],
            body.translations[0],
            body.axes[0],
            mass,
            mass * com,
            body.origin_inertias[0],
            gravity,
        )
        constants = np.concatenate([np.ravel(part) for part in parts])
        with scans_by_doubling(library) if doubling else nullcontext():
            self._formation = library.mp2a_scan_open(MPI._addressof(comm), constants.ctypes.data)

    def rnea(self, q: Array, v: Array, a: Array) -> Array:
        """Torque ``(T, 1)`` of this rank's joint from its own q, v and a, ``(T, 1)`` and contiguous; collective."""
        torque = np.empty_like(v)
        error = self._rnea(self._formation, len(q), pointer(q), pointer(v), pointer(a), pointer(torque))
        if error:
            raise MPI.Exception(error)
        return torque

    def close(self) -> None:
        """Free its communicators; collective."""
        self._library.mp2a_scan_close(self._formation)


def obtain_library(comm: MPI.Intracomm) -> ctypes.CDLL:
    """Build the library on rank 0, if that was not done yet, and load it on all ranks; collective.

    Raises
    ------
    DependencyError
        On every rank, if it cannot be built or cannot be loaded on one of them.
    """
    path: Path | None = None
    with shared_errors(comm):
        path = _build() if comm.Get_rank() == 0 else None
    path = comm.bcast(path)
    with shared_errors(comm):
        library = _load(path)
    return library


def can_double(library: ctypes.CDLL) -> bool:
    """Tell whether this MPI can be told to scan by recursive doubling."""
    with scans_by_doubling(library) as done:
        return done


def _load(path: Path) -> ctypes.CDLL:
    """Load the library, unless it is of another MPI than mpi4py's."""
    try:
        library = ctypes.CDLL(str(path))
    except OSError as error:
        raise DependencyError(f"{path} cannot be loaded ({error})") from error
    version, length = ctypes.create_string_buffer(MPI.MAX_LIBRARY_VERSION_STRING), ctypes.c_int()
    library.MPI_Get_library_version(version, ctypes.byref(length))
    theirs, ours = version.value.decode(), MPI.Get_library_version().rstrip("\0")
    if theirs != ours:
        raise DependencyError(f"mpicc is of {_short(theirs)}, mpi4py of {_short(ours)}")
    library.mp2a_scan_open.argtypes = [ctypes.c_void_p] * 2
    library.mp2a_scan_open.restype = ctypes.c_void_p
    library.mp2a_scan_rnea.argtypes = [ctypes.c_void_p, ctypes.c_int, *[ctypes.c_void_p] * 4]
    library.mp2a_scan_close.argtypes = [ctypes.c_void_p]
    return library


@contextmanager
def scans_by_doubling(library: ctypes.CDLL) -> Iterator[bool]:
    """Have Open MPI scan by recursive doubling on the communicators made in this block; yields whether it can."""
    values = {variable: ctypes.c_int(value) for variable, value in _DOUBLING.items()}
    done = [variable for variable, value in values.items() if library.mp2a_scan_swap(variable, ctypes.byref(value))]
    try:
        yield len(done) == len(values)
    finally:
        for variable in done:
            library.mp2a_scan_swap(variable, ctypes.byref(values[variable]))


def _build() -> Path:
    """Compile the C file where that was not done yet, in the first folder where that can be."""
    compiler = _find_compiler()
    made_for = processor(), MPI.Get_library_version(), compiler, *_FLAGS
    stem = f"mpi-scan-{checksum(_SOURCE.read_bytes(), *(word.encode() for word in made_for))}"
    for folder in cache_folders():
        if path := find(folder, stem):
            return path
    reason = "no directory to keep it in"
    for folder in cache_folders():
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            if is_private(folder):
                return _compile(compiler, folder, stem)
            reason = f"{folder} is not this user's own"
        except OSError as error:
            reason = str(error)
    raise DependencyError(f"its operator cannot be compiled ({reason})")


def _find_compiler() -> str:
    """Return the mpicc beside this Python, else the first on the path."""
    # The interpreter's link is not followed: it leads out of a virtual environment.
    for folder in (os.path.dirname(sys.executable), None):  # noqa: PTH120
        if path := shutil.which("mpicc", path=folder):
            return path
    raise DependencyError("there is no mpicc, which compiles its operator")


def _compile(compiler: str, folder: Path, stem: str) -> Path:
    """Compile elsewhere and rename, so that the file is whole or not there."""
    with tempfile.TemporaryDirectory(dir=folder) as elsewhere:
        made = Path(elsewhere) / "made.so"
        command = [compiler, *_FLAGS, "-o", str(made), str(_SOURCE), "-lm"]
        try:
            subprocess.run(
                command, check=True, timeout=_LIMIT, capture_output=True, text=True, stdin=subprocess.DEVNULL
            )
        except subprocess.CalledProcessError as error:
            lines = (error.stderr or error.stdout).strip().splitlines() or [f"exit status {error.returncode}"]
            raise DependencyError(f"{compiler} does not compile its operator ({lines[-1]})") from error
        except subprocess.TimeoutExpired as error:
            raise DependencyError(f"{compiler} did not end within {_LIMIT:g} s") from error
        return made.replace(folder / f"{stem}-{checksum(made.read_bytes())}.so")


def _short(version: str) -> str:
    return version.splitlines()[0].split(",")[0]
