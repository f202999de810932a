"""Forward kinematics of positions: where the bodies are, by pointer jumping along their ancestors."""

import numpy as np

from mp2a.joint_kinematics import joint_transforms
from mp2a.model import Model
from mp2a.results import Placement
from mp2a.spatial import Array, apply


def placements(model: Model, q: Array) -> Placement:
    """Place the bodies of a chain or tree in its base frame.

    A body knows its placement in its parent. In a round each takes over its ancestor's placement, and that one's
    ancestor: after the k-th it is placed in its 2^k-th ancestor, or in the base. All bodies do a round together, which
    numpy likes better than one body after the other.

    Parameters
    ----------
    model
        n bodies.
    q
        Coordinates that were checked, ``(T, nq)``, rad and m.

    Returns
    -------
    Placement
        ``(T, n, 3, 3)`` and ``(T, n, 3)`` m.
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
