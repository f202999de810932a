"""What the launcher of MPI told this process through its environment, without loading an MPI library.

Open MPI's mpirun sets ``OMPI_COMM_WORLD_…``; MPICH's and its relatives' (Hydra) set ``PMI_…`` and ``MPI_LOCAL…``;
SLURM's srun sets ``PMI_…`` or ``PMIX_…`` by its plugin, and the numbers that these lack in ``SLURM_…``. The last are
there in a batch script too, which is no rank, so they alone make none.
"""

import os
import re
from typing import NamedTuple

RANK_VARIABLES = ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK")
"""The rank, by launcher; who has one of these is a rank."""


class RankInfo(NamedTuple):
    """The place of this process among the ranks that a launcher started."""

    rank: int
    """The rank in ``MPI.COMM_WORLD``."""
    size: int | None
    """How many ranks there are; None where the launcher does not say."""
    local_size: int
    """How many of them run on this machine; 1 where the launcher does not say."""


def rank_info() -> RankInfo | None:
    """Return the place of this process among the ranks; None where no launcher of MPI started it."""
    rank = _number(*RANK_VARIABLES)
    if rank is None:
        return None
    size = _number("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS")
    local_size = _number("OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS") or _slurm_local_size()
    return RankInfo(rank, size, local_size or 1)


def under_mpi() -> bool:
    """Tell whether this process is one of the ranks that a launcher of MPI started."""
    return rank_info() is not None


def _number(*names: str) -> int | None:
    """Return the first of these variables that is a whole number."""
    return next((int(text) for name in names if (text := os.environ.get(name, "")).isdecimal()), None)


def _slurm_local_size() -> int | None:
    """Return how many ranks SLURM's step has on this node, from a list by node such as ``64(x7),32``."""
    node = _number("SLURM_NODEID")
    for ranks, nodes in re.findall(r"(\d+)(?:\(x(\d+)\))?", os.environ.get("SLURM_STEP_TASKS_PER_NODE", "")):
        if node is None or node < int(nodes or 1):
            return int(ranks)
        node -= int(nodes or 1)
    return None
