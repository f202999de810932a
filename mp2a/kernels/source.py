"""All kernels by name, as functions for numba to compile. Only building imports this module."""

from collections.abc import Callable, Sequence
from typing import Any

from mp2a.kernels import formulas
from mp2a.kernels.elementwise import elementwise
from mp2a.kernels.lanes import DOUBLE, SINGLE
from mp2a.kernels.primitives import compiled
from mp2a.kernels.reduce_block import reduce_block
from mp2a.kernels.replay import replay
from mp2a.kernels.rnea import rnea
from mp2a.kernels.symbols import LANES, Formula
from mp2a.kernels.worker import run, worker


def _kernel(formula: Formula, columns: Sequence[int]) -> Callable[..., None]:
    """Loop over samples, eight at once while there are so many.

    Returns
    -------
    Callable
        ``f(count, out, *inputs)`` for numba, with the number of samples and, for each array of ``(count, columns)``
        doubles, the address of a pointer to it.
    """
    block, single = elementwise(formula, columns, block=True), elementwise(formula, columns, block=False)

    @compiled
    def loop(count: Any, out: Any, inputs: Any) -> None:
        full = count - count % LANES
        for row in range(0, full, LANES):
            block(out, inputs, row)
        for row in range(full, count):
            single(out, inputs, row)

    def two(count: Any, out: Any, a: Any, b: Any) -> None:
        loop(count, out[0], (a[0], b[0]))

    def three(count: Any, out: Any, a: Any, b: Any, c: Any) -> None:
        loop(count, out[0], (a[0], b[0], c[0]))

    entries: dict[int, Callable[..., None]] = {2: two, 3: three}
    return entries[len(columns)]


KERNELS = {
    "compose": _kernel(formulas.compose, (24, 24)),
    "transform": _kernel(formulas.transform, (28, 24)),
    "force": _kernel(formulas.force, (28, 6, 6)),
    "transform_force": _kernel(formulas.transform_force, (24, 6)),
    "product": _kernel(formulas.matrix_product, (36, 36)),
    "push": _kernel(formulas.push, (36, 6, 6)),
    "rnea_double": rnea(DOUBLE, bodies=False),
    "rnea_double_bodies": rnea(DOUBLE, bodies=True),
    "rnea_lanes": rnea(DOUBLE, bodies=False, per_lane=True),
    "rnea_lanes_bodies": rnea(DOUBLE, bodies=True, per_lane=True),
    "reduce_block": reduce_block(DOUBLE),
    "reduce_block_lanes": reduce_block(DOUBLE, per_lane=True),
    "rnea_single": rnea(SINGLE, bodies=False),
    "rnea_single_bodies": rnea(SINGLE, bodies=True),
    "replay": replay,
    "pool_worker": worker,
    "pool_run": run,
}
"""What is compiled, by name."""
