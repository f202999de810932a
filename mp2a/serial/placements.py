"""Forward kinematics of positions: where the bodies are, body after body along the chain.

A compiled kernel does it where there is one, and `placements_numpy` where there is none or where it finds a number that
is not as it should be.
"""

import numpy as np
from numpy.typing import ArrayLike

from mp2a.joint_kinematics import joint_transforms
from mp2a.kernels import batch, direct
from mp2a.model import Model
from mp2a.results import Placement
from mp2a.spatial import Array, apply
from mp2a.validation import check_coordinates


def placements(model: Model, q: Array, *, threads: int | None = None, out: Placement | None = None) -> Placement:
    """Place the bodies of a chain or tree in its base frame.

    Parameters
    ----------
    model
        n bodies.
    q
        Coordinates of which the shape was checked, ``(T, nq)``, rad and m.
    threads
        How many share the samples; None: as many as this process has cores for itself and the work is worth.
    out
        Where to put them, arrays of doubles that are contiguous and do not overlap ``q``.

    Returns
    -------
    Placement
        ``(T, n, 3, 3)`` and ``(T, n, 3)`` m.

    Raises
    ------
    InputError
        If a coordinate is not finite, or a quaternion, or cosine and sine, are not of length 1.
    """
    n, samples = len(model), len(q)
    if out is None:
        out = Placement(np.empty((samples, n, 3, 3)), np.empty((samples, n, 3)))
    if not batch.placements(model, q, out, threads):
        check_coordinates(model, q)
        for target, values in zip(out, placements_numpy(model, q), strict=True):
            target[...] = values
    return out


def placements_direct(model: Model, q: ArrayLike, out: Placement | None = None) -> Placement | None:
    """Place the bodies for one sample given as a contiguous array of doubles; None if it is not."""
    run = direct.PLACEMENTS.get(model)
    if run is None:
        return None
    if out is None:
        n = len(model)
        out = Placement(np.empty((n, 3, 3)), np.empty((n, 3)))
    elif type(out) is not Placement:
        return None
    return out if run(*out, q) else None


def placements_numpy(model: Model, q: Array) -> Placement:
    """Do what `placements` does, for numbers that were checked: by pointer jumping along the bodies' ancestors.

    A body knows its placement in its parent. In a round each takes over its ancestor's placement, and that one's
    ancestor: after the k-th it is placed in its 2^k-th ancestor, or in the base. All bodies do a round together, which
    numpy likes better than one body after the other.
    """
    rotation, translation = joint_transforms(model, q)
    ancestor = model.parents.copy()
    while (below := np.flatnonzero(ancestor >= 0)).size:
        above = ancestor[below]
        outer = rotation[above]
        translation[below] = translation[above] + apply(outer, translation[below])
        rotation[below] = outer @ rotation[below]
        ancestor[below] = ancestor[above]
    return Placement(rotation.swapaxes(0, 1), translation.swapaxes(0, 1))
