"""The fewest bytes: one scan of motion outwards, then one of forces inwards, on a chain or a tree."""

from typing import Any

from mp2a.algebra import motion
from mp2a.algebra.affine import NO_VECTOR
from mp2a.methods.node import Own, Rounds, ScanResult
from mp2a.program.operations import (
    NOTHING,
    acceleration_from_base,
    add,
    compose,
    to_classical,
    transform_force,
    velocity_across,
)
from mp2a.schedule import FORCE, MOTION

MESSAGES = {MOTION: {"path": motion.IDENTITY}, FORCE: {"force": NO_VECTOR}}


def compact(own: Own, rounds: Rounds) -> ScanResult:
    """Scan motion, then force.

    A node remembers its path from the 2^e-th ancestor of every round. With it, it transforms its force itself to where
    it sends it, so that a force is 6 numbers on the wire.
    """
    paths = scan_motion(own.path, rounds)
    velocity, spatial = velocity_across(paths[-1]), acceleration_from_base(paths[-1], own.gravity)
    acceleration = to_classical(spatial, velocity)
    force, distal = own.force(velocity, acceleration), NOTHING
    for round_, path in zip(rounds.recurrence("force"), paths, strict=False):
        (below,) = rounds.exchange(round_, force=transform_force(path, force))
        force, distal = add(force, below), add(distal, below)
    return ScanResult(velocity, acceleration, force, distal, paths[-1])


def scan_motion(path: Any, rounds: Rounds) -> list[Any]:
    """Scan motion outwards alone: the paths before each round, and at last those from the base."""
    paths = [path]
    for round_ in rounds.recurrence("motion"):
        (above,) = rounds.exchange(round_, path=paths[-1])
        paths.append(compose(above, paths[-1]))
    return paths
