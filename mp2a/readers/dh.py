"""Models from Denavit-Hartenberg tables."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mp2a.checks import array
from mp2a.exceptions import InputError
from mp2a.spatial import Array

CONVENTIONS = ("standard", "modified")


def read_dh(
    rows: ArrayLike,
    joints: Sequence[str] | None,
    convention: str,
    masses: ArrayLike | None,
    coms: ArrayLike | None,
    inertias: ArrayLike | None,
) -> dict[str, Any]:
    r"""Return the fields for `Model.from_dh`.

    A row moves by :math:`T_z(d) R_z(\theta)` about the joint and :math:`T_x(a) R_x(\alpha)` along the link: the
    standard convention in this order, the modified one in the other. Our body frame is the joint's, so a standard
    row's link motion belongs to the placement of the next joint, and its link frame lies that far from the body's.
    """
    table = array("rows", rows, (None, 4))  # a, alpha, d, theta
    n = len(table)
    if n == 0:
        raise InputError("rows: got none, expected at least one: a, alpha, d, theta")
    if convention not in CONVENTIONS:
        raise InputError(f"convention: got {convention!r}, expected one of {', '.join(CONVENTIONS)}")
    kinds = tuple(joints) if joints is not None else ("revolute",) * n
    if len(kinds) != n or set(kinds) - {"revolute", "prismatic"}:
        raise InputError(f"joints: got {list(kinds)}, expected {n} of 'revolute' or 'prismatic'")
    link_r, link_p = _screw(0, table[:, 1], table[:, 0])
    joint_r, joint_p = _screw(2, table[:, 3], table[:, 2])
    link_coms = np.zeros((n, 3)) if coms is None else array("coms", coms, (n, 3))
    unit = np.tile(0.01 * np.eye(3), (n, 1, 1))
    link_inertias = unit if inertias is None else array("inertias", inertias, (n, 3, 3))
    if convention == "standard":
        before_r = np.concatenate((np.eye(3)[None], link_r[:-1]))
        before_p = np.concatenate((np.zeros((1, 3)), link_p[:-1]))
        link_coms = link_p + np.einsum("nij,nj->ni", link_r, link_coms)
        link_inertias = link_r @ link_inertias @ link_r.swapaxes(1, 2)
    else:
        before_r, before_p = link_r, link_p
    return {
        "parents": np.arange(n) - 1,
        "joints": kinds,
        "axes": np.tile([0.0, 0.0, 1.0], (n, 1)),
        "rotations": before_r @ joint_r,
        "translations": before_p + np.einsum("nij,nj->ni", before_r, joint_p),
        "masses": np.ones(n) if masses is None else array("masses", masses, (n,)),
        "coms": link_coms,
        "inertias": link_inertias,
    }


def _screw(axis: int, angles: Array, lengths: Array) -> tuple[Array, Array]:
    """Rotation by angles about, and translation by lengths along, coordinate axis 0 or 2."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    r = np.zeros((len(angles), 3, 3))
    r[:, axis, axis] = 1.0
    r[:, j, j] = r[:, k, k] = np.cos(angles)
    r[:, k, j] = np.sin(angles)
    r[:, j, k] = -np.sin(angles)
    p = np.zeros((len(angles), 3))
    p[:, axis] = lengths
    return r, p
