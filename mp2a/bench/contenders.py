"""Who is measured, by the names that results files, tables, pictures and the command line share."""

MPI_SCAN = "MPI_Scan"
MPI_SCAN_DOUBLING = "MPI_Scan, doubling"
PIPELINE = "pipeline"
PIPELINE_BLOCKS = "pipeline, blocks"
GATHER_SCATTER = "gather-scatter"
GATHER_SCATTER_TREE = "gather-scatter, tree"
ONE_PROCESS = "mp2a.rnea"
PINOCCHIO = "pinocchio"

BLOCKS = 16
"""Blocks that `PIPELINE_BLOCKS` cuts the samples of a call into."""

_METHODS = {"kogge-stone": "kogge-stone (MP²A)", "compact": "compact", "sweep": "sweep"}

BASELINES = {
    MPI_SCAN: "MPI_Scan twice, as MPI chooses",
    MPI_SCAN_DOUBLING: "MPI_Scan twice, recursive doubling",
    PIPELINE: "pipeline, hop by hop",
    PIPELINE_BLOCKS: f"pipeline, samples in {BLOCKS} blocks",
    GATHER_SCATTER: "gather-scatter, each robot directly",
    GATHER_SCATTER_TREE: "gather-scatter, along a tree",
    ONE_PROCESS: "mp2a.rnea, one process",
    PINOCCHIO: "pinocchio, one process",
}
"""Those that are no method of `mp2a.methods.METHODS`, and what each is in a few words."""

LABELS = _METHODS | BASELINES
"""What every contender is, in the order in which they are shown."""

ALONE = (ONE_PROCESS, PINOCCHIO)
"""Those that run in one process, which knows everything."""


def family(baseline: str) -> str:
    """Return what a baseline and its variants are called together: what stands before the comma."""
    return baseline.partition(",")[0]


FAMILIES = tuple(dict.fromkeys(map(family, BASELINES)))
"""What baselines can be chosen by."""
