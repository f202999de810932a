"""Where each robot of a formation stands, seen from its virtual leader (thesis, section 4.2 and chapter 6)."""

import itertools

from mp2a.formation.choreography.scenario import Shape
from mp2a.formation.constants import LEADER_LEAD


def slots(shape: Shape) -> dict[str, tuple[float, float]]:
    """Return the slots of a formation's robots in the frame of its virtual leader.

    The leader is `LEADER_LEAD` in front of the first row and in the middle across; every row is centred on it.

    Parameters
    ----------
    shape
        Of which robots, and how far apart.

    Returns
    -------
    dict
        x (negative: behind the leader) and y (to the left) by role, m.

    Examples
    --------
    >>> slots(Shape("row", (("R1", "R2"),), (), ((1.2,),)))
    {'R1': (-0.5, 0.6), 'R2': (-0.5, -0.6)}
    """
    out = {}
    back = itertools.accumulate((LEADER_LEAD, *shape.distances))
    for row, gaps, x in zip(shape.rows, shape.spacings, back, strict=True):
        left = sum(gaps) / 2
        for robot, across in zip(row, itertools.accumulate((0.0, *gaps)), strict=True):
            out[robot] = (-x, left - across)
    return out
