"""Where the kernels find the columns of q, v and a: in the user's arrays, or in rings that squares of these go to.

Where the columns of a sample lie together in memory, squares of the input are transposed in registers just before they
are needed. Only building the kernels imports this module.
"""

from typing import Any

from mp2a.kernels.lanes import Real
from mp2a.kernels.primitives import compiled, prefetch
from mp2a.kernels.tables import AT, Q_COLUMN, TOPOLOGY, V_COLUMN
from mp2a.kernels.transposition import transpose_in

_AHEAD = 6
"""Bodies. By then what lies in another page is there, also where the processor has to look up the page first: with many
samples each column is in a page of its own, and there are more of these than it knows by heart."""

_MOST_Q, _MOST_V = 7, 6
"""Columns of a body."""


def columns(real: Real) -> Any:
    """Make ``f(job, memory, begin)``: views of q, v, a and the torque, and the sample a chunk really begins with.

    A view is (pointer, mask, step): a column is at ``(column & mask) * step``.
    """
    lanes, ring = real.lanes, 2 * real.lanes
    there, ahead = real.there(), real.ahead()

    @compiled
    def views(job: Any, memory: Any, begin: Any) -> Any:
        places = (
            (memory, ring - 1, lanes),
            (ahead(memory, ring * lanes), ring - 1, lanes),
            (ahead(memory, 2 * ring * lanes), ring - 1, lanes),
            (memory, ring - 1, lanes),
        )
        if job[AT.columnwise]:
            # The last chunk may begin a little earlier and do some samples again.
            begin = min(begin, job[AT.samples] - lanes)
            places = (
                (ahead(there(job[AT.q]), begin), -1, job[AT.q_stride]),
                (ahead(there(job[AT.v]), begin), -1, job[AT.v_stride]),
                (ahead(there(job[AT.a]), begin), -1, job[AT.a_stride]),
                (ahead(there(job[AT.torque]), begin), -1, job[AT.torque_stride]),
            )
        return places, begin

    return views


def prefetch_columns(real: Real, *, rates: bool = True, accelerated: bool = True) -> Any:
    """Make ``f(job, i, topology, views, begin, ready)``: have the columns of body i in the rings.

    Where kernels take columns as they lie, those of a body that comes soon are fetched ahead of time. ``ready`` is how
    many columns of q, and of v and a, are in the rings; returned as it is after. Without ``rates`` only those of q are
    wanted, without ``accelerated`` not those of a.
    """
    lanes, ring = real.lanes, 2 * real.lanes
    there, fill, bring = real.there(), transpose_in(real), prefetch(writing=False)

    @compiled
    def staged(job: Any, i: Any, topology: Any, views: Any, begin: Any, ready: Any) -> Any:
        final, nq, nv = job[AT.samples] - 1, job[AT.nq], job[AT.nv]
        row = i * TOPOLOGY
        q, v = ready
        if not job[AT.columnwise]:
            if q < nq and q < topology[row + Q_COLUMN] + _MOST_Q:
                fill(there(job[AT.q]), job[AT.q_stride], begin, final, q, nq, views[0][0], (q & (ring - 1)) * lanes)
                q += lanes
            if rates and v < nv and v < topology[row + V_COLUMN] + _MOST_V:
                place = (v & (ring - 1)) * lanes
                fill(there(job[AT.v]), job[AT.v_stride], begin, final, v, nv, views[1][0], place)
                if accelerated:
                    fill(there(job[AT.a]), job[AT.a_stride], begin, final, v, nv, views[2][0], place)
                v += lanes
        else:
            later = i + _AHEAD
            if later < job[AT.bodies]:
                column = topology[later * TOPOLOGY + Q_COLUMN]
                bring(views[0][0], column * views[0][2] + lanes - 1)
                if rates:
                    column = topology[later * TOPOLOGY + V_COLUMN]
                    bring(views[1][0], column * views[1][2] + lanes - 1)
                    bring(views[2][0], column * views[2][2] + lanes - 1)
        return q, v

    return staged


def prefetch_columns_back(real: Real) -> Any:
    """Make ``f(job, i, topology, view, begin, ready)``: have the third columns of body i in their ring, going back.

    ``ready`` is the first column that is there; returned as it is after.
    """
    lanes, ring = real.lanes, 2 * real.lanes
    there, fill = real.there(), transpose_in(real)

    @compiled
    def staged(job: Any, i: Any, topology: Any, view: Any, begin: Any, ready: Any) -> Any:
        while not job[AT.columnwise] and topology[i * TOPOLOGY + V_COLUMN] < ready:
            first = (ready - 1) // lanes * lanes
            place = (first & (ring - 1)) * lanes
            fill(there(job[AT.a]), job[AT.a_stride], begin, job[AT.samples] - 1, first, job[AT.nv], view[0], place)
            ready = first
        return ready

    return staged


def prefetch_results(real: Real) -> Any:
    """Make ``f(job, i, topology, view)``: fetch the torque's column of a body that comes soon, to be written."""
    lanes, bring = real.lanes, prefetch(writing=True)

    @compiled
    def staged(job: Any, i: Any, topology: Any, view: Any) -> Any:
        later = i - _AHEAD
        if job[AT.columnwise] and later >= 0:
            bring(view[0], topology[later * TOPOLOGY + V_COLUMN] * view[2] + lanes - 1)

    return staged
