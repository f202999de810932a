"""Algorithms in one process, one a file: the readable numpy form, and the call of its kernel where there is one."""

from mp2a.serial.aba import aba, aba_direct, aba_numpy
from mp2a.serial.placements import placements, placements_direct, placements_numpy
from mp2a.serial.reduce_block import reduce_block, reduce_block_numpy
from mp2a.serial.rnea import Recursion, rnea, rnea_direct, rnea_numpy

__all__ = [
    "Recursion", "aba", "aba_direct", "aba_numpy", "placements", "placements_direct", "placements_numpy",
    "reduce_block", "reduce_block_numpy", "rnea", "rnea_direct", "rnea_numpy",
]  # fmt: skip
