"""The whole inverse dynamics in one set of rounds, on a chain or a tree (theory, section 4)."""

from mp2a.algebra import inertia, motion
from mp2a.methods.node import Own, Rounds, ScanResult
from mp2a.program.operations import (
    NOTHING,
    acceleration_from_base,
    add,
    compose,
    force_of,
    to_classical,
    transform,
    velocity_across,
)
from mp2a.schedule import FORCE, MOTION

MESSAGES = {MOTION: {"path": motion.IDENTITY}, FORCE: {"load": inertia.IDENTITY}}


def sweep(own: Own, rounds: Rounds) -> ScanResult:
    """Scan motion and composite inertias at once.

    A node keeps two segments: its path from its 2^e-th ancestor, and the composite inertia of all nodes fewer than 2^e
    below it. In a round it hands the first to those whose 2^e-th ancestor it is and the second, transformed across the
    first, to its own; neither waits for the other.
    """
    path, below, distal = own.path, own.inertia(), NOTHING
    for round_ in rounds.recurrence("sweep"):
        above, load = rounds.exchange(round_, path=path, load=transform(below, path))
        path = compose(above, path)
        below, distal = add(below, load), add(distal, load)
    velocity, acceleration = velocity_across(path), acceleration_from_base(path, own.gravity)
    force, behind = force_of(below, velocity, acceleration), force_of(distal, velocity, acceleration)
    return ScanResult(velocity, to_classical(acceleration, velocity), force, behind, path)
