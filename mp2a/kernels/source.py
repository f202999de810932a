"""The kernels by name: formulas, and functions for numba to compile. Only building imports this module."""

from mp2a.kernels import formulas, joint_formulas
from mp2a.kernels.aba import aba
from mp2a.kernels.direct_call import direct_call
from mp2a.kernels.lanes import DOUBLE, SCALAR, SINGLE
from mp2a.kernels.placements import placements
from mp2a.kernels.reduce_block import reduce_block
from mp2a.kernels.replay import replay
from mp2a.kernels.replay_call import replay_call
from mp2a.kernels.rnea import rnea
from mp2a.kernels.symbols import Formula
from mp2a.kernels.worker import run, worker


def formula(name: str) -> Formula:
    """Return the formula of one of `mp2a.kernels.library.ELEMENTWISE`, which has its name."""
    found: Formula = getattr(formulas, name, None) or getattr(joint_formulas, name)
    return found


KERNELS = {
    "rnea_double": rnea(DOUBLE, bodies=False),
    "rnea_double_bodies": rnea(DOUBLE, bodies=True),
    "rnea_lanes": rnea(DOUBLE, bodies=False, per_lane=True),
    "rnea_lanes_bodies": rnea(DOUBLE, bodies=True, per_lane=True),
    "reduce_block": reduce_block(DOUBLE),
    "reduce_block_lanes": reduce_block(DOUBLE, per_lane=True),
    "rnea_single": rnea(SINGLE, bodies=False),
    "rnea_single_bodies": rnea(SINGLE, bodies=True),
    "rnea_scalar": rnea(SCALAR, bodies=False),
    "rnea_scalar_bodies": rnea(SCALAR, bodies=True),
    "placements_double": placements(DOUBLE),
    "placements_scalar": placements(SCALAR),
    "aba_double": aba(DOUBLE),
    "aba_single": aba(SINGLE),
    "aba_scalar": aba(SCALAR),
    "direct_call": direct_call,
    "replay": replay,
    "replay_call": replay_call,
    "pool_worker": worker,
    "pool_run": run,
}
"""What numba compiles."""
