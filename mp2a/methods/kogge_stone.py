"""The paper's method: three Kogge-Stone scans of affine maps over 6×6 operators (eq. 4-10, figures 4-6)."""

from typing import Any

from mp2a.algebra import affine
from mp2a.algebra.affine import MATRIX_AND_VECTOR, VECTOR
from mp2a.methods.node import Own, Rounds, ScanResult
from mp2a.program.operations import (
    acceleration_across,
    add,
    apply_matrix,
    force_from_parent,
    operator_across,
    product,
    push,
    transpose_matrix,
    velocity_across,
)

MESSAGES = {
    MATRIX_AND_VECTOR: {"matrix": affine.IDENTITY, "vector": affine.NO_VECTOR},
    VECTOR: {"vector": affine.NO_VECTOR},
}


def kogge_stone(own: Own, rounds: Rounds) -> ScanResult:
    r"""Scan velocity, acceleration and force.

    Each robot forms its own :math:`C_i, b_i` (eq. 7, 9, 10) and knows its own joint only. The paper's backward
    operator :math:`R_{i+1,i} P_{i,i+1}` holds the joint of the *next* robot, so the recurrence runs over the force
    that robot i passes inwards, :math:`G_i = C_i^T F_i` with :math:`C_i = P^T R^T`:

    .. math:: G_i = C_i^T G_{i+1} + C_i^T (M \dot V + [\dot M - \dot S M] V - F_{ext}), \quad F_i = C_i^{-T} G_i.

    The messages are as many and as large as the paper's.
    """
    c = operator_across(own.path)

    # Eq. 4: V_i = Pᵀ Rᵀ V_{i-1} + H q̇
    velocity, _ = scan("velocity", c, velocity_across(own.path), own, rounds)

    # Eq. 5: V̇_i = Pᵀ Rᵀ V̇_{i-1} + H q̈ + (Ṗᵀ Rᵀ V_{i-1} + Ḣ q̇); the base falls with -g
    rate = add(acceleration_across(own.path, velocity), apply_matrix(c, own.base))
    acceleration, _ = scan("acceleration", c, rate, own, rounds)

    # Eq. 6, as the force passed inwards
    inwards = transpose_matrix(c)
    passed = apply_matrix(inwards, own.force(velocity, acceleration))
    passed, distal = scan("force", inwards, passed, own, rounds)
    force, behind = force_from_parent(own.path, passed), force_from_parent(own.path, distal)
    return ScanResult(velocity, acceleration, force, behind)


def scan(recurrence: str, c: Any, b: Any, own: Own, rounds: Rounds) -> tuple[Any, Any]:
    r"""Solve :math:`x_i = C_i x_{i-1} + b_i` for all robots by recursive doubling (eq. 8-10).

    In round e the window of 2^(e-1) robots that ends at robot i, :math:`x \mapsto C x + b`, is put behind the one that
    ends where it begins. After a vector alone the window reaches the end of the chain, and its matrix means nothing any
    more.

    Returns
    -------
    tuple
        x, and the part of it that came from other robots.
    """
    others = own.no_force()
    for round_ in rounds.recurrence(recurrence):
        c_before, b_before = rounds.exchange(round_, matrix=c, vector=b)
        b, others = push(c, b_before, b), push(c, b_before, others)
        c = product(c, c_before)
    return b, others
