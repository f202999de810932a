"""Who is measured, by the names that results files, tables, pictures and the command line share."""

from mp2a.methods import METHODS

PIPELINE = "pipeline"
PIPELINE_BLOCKS = "pipeline, blocks"
GATHER_SCATTER = "gather-scatter"
GATHER_SCATTER_TREE = "gather-scatter, tree"
PINOCCHIO = "pinocchio"

BLOCKS = 16
"""Blocks that `PIPELINE_BLOCKS` cuts the samples of a call into."""

LABELS = {
    "kogge-stone": "kogge-stone (MP²A)",
    "compact": "compact",
    "sweep": "sweep",
    PIPELINE: "pipeline, hop by hop",
    PIPELINE_BLOCKS: f"pipeline, samples in {BLOCKS} blocks",
    GATHER_SCATTER: "gather-scatter, each robot directly",
    GATHER_SCATTER_TREE: "gather-scatter, along a tree",
    PINOCCHIO: "pinocchio, one process",
}
"""What each contender is, in a few words, in the order in which they are shown."""

BASELINES = tuple(name for name in LABELS if name not in METHODS)
"""Those that are no method of `mp2a.methods.METHODS`."""
