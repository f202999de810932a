"""Inverse dynamics of many samples: each lane of a vector is a sample, and eight go through the chain and back at once.

What eight samples leave between the way out and the way back fits the cache. Where the columns of a sample lie together
in memory, squares of the input are transposed in registers into a ring of columns just before they are needed, and
those of the torque likewise behind.

Only building the kernels imports this module; `mp2a.kernels.plan` says what the kernel works on.
"""

from collections.abc import Callable
from typing import Any

import numba

from mp2a.kernels import steps
from mp2a.kernels.inwards import inwards
from mp2a.kernels.lanes import Real, integers
from mp2a.kernels.outwards import outwards
from mp2a.kernels.plan import AT, FORCE, FRAME, FROM, HOT, KEEP, Q_COLUMN, RETURN, TOPOLOGY, V_COLUMN
from mp2a.kernels.squares import gather, turn_in, turn_out

_MOST_Q, _MOST_V = 7, 6
"""Columns of a body."""


def recursion(real: Real, *, bodies: bool, lanewise: bool = False) -> Callable[..., None]:
    """Make the kernel of a number format.

    Parameters
    ----------
    real
        The format.
    bodies
        Whether velocity, acceleration and force of every body are asked for as well.
    lanewise
        Whether each lane has bodies of its own, as `mp2a.kernels.long` has them, instead of samples of the same.

    Returns
    -------
    Callable
        ``f(job, first, last, scratch, verdict)``, for numba: chunks ``first … last - 1`` of a `mp2a.kernels.plan.Job`;
        the addresses of pointers to the job, to scratch memory and to an integer that becomes 1 if a sample is
        doubtful.
    """
    lanes, ring = real.lanes, 2 * real.lanes
    motion = 12 if bodies else 9
    there, ahead, zero, is_nan, put_apart = real.there(), real.ahead(), real.zero(), real.is_nan(), real.put_apart()
    gather_six, nine, aligned = gather(real, 6), real.record(9, lanewise=lanewise), real.aligned()
    total, without = real.lift(steps.total, 6), real.lift(steps.without, 6)
    out = _out(real, motion, bodies=bodies, lanewise=lanewise)
    back = _back(real, bodies=bodies, lanewise=lanewise)
    put, six_vectors, doubt_results = real.put(), real.vectors(6), real.lift(steps.doubt_results)

    def run(job_at: Any, first: Any, last: Any, scratch_at: Any, verdict_at: Any) -> None:
        job = integers(job_at)
        n, samples, columnwise = job[AT.bodies], job[AT.samples], job[AT.columnwise]
        tables = there(job[AT.hot]), there(job[AT.frames]), integers(job[AT.topology])
        tip, tip_stride, output, padded = there(job[AT.tip]), job[AT.tip_stride], there(job[AT.output]), job[AT.padded]
        q, v, a = (
            (there(job[AT.q]), job[AT.q_stride]),
            (there(job[AT.v]), job[AT.v_stride]),
            (there(job[AT.a]), job[AT.a_stride]),
        )
        torque = there(job[AT.torque]), job[AT.torque_stride]
        memory = aligned(there(scratch_at))
        final = samples - 1
        root = 3 * ring * lanes + motion * lanes
        null = zero()
        nothing = (null, null, null, null, null, null)
        doubt = null
        for chunk in range(first, last):
            begin = chunk * lanes
            # Where a column is: at (column & mask) * step.
            views = (
                (memory, ring - 1, lanes),
                (ahead(memory, ring * lanes), ring - 1, lanes),
                (ahead(memory, 2 * ring * lanes), ring - 1, lanes),
            )
            target = views[0]
            if columnwise:
                # The last chunk may begin a little earlier and do some samples again.
                begin = min(begin, samples - lanes)
                views = (
                    (ahead(q[0], begin), -1, q[1]),
                    (ahead(v[0], begin), -1, v[1]),
                    (ahead(a[0], begin), -1, a[1]),
                )
                target = (ahead(torque[0], begin), -1, torque[1])
            put(memory, root, nothing)
            if not job[AT.again]:
                doubt = out(job, begin, doubt, tables, memory, views, (q, v, a), output, padded)
            carried = gather_six(tip, tip_stride, begin, final)
            if not lanewise:
                carried = without((nothing, carried, nine(tables[1], (n - 1) * FRAME)))
            carried = back(job, begin, carried, tables, memory, target, torque, output, padded)
            carried = total((carried, six_vectors(memory, root)))
            # What is not finite anywhere ends up here.
            doubt = doubt_results((doubt, carried))
            put_apart(there(job[AT.root]), begin, padded, carried)
        if is_nan(doubt):
            integers(verdict_at)[0] = 1

    return run


def _out(real: Real, motion: int, *, bodies: bool, lanewise: bool) -> Any:
    """Motion of all bodies, and the wrenches that it takes."""
    lanes, ring = real.lanes, 2 * real.lanes
    there, ahead, put, put_apart, fill = real.there(), real.ahead(), real.put(), real.put_apart(), turn_in(real)
    gather_motion, gather_six, motion_vectors = gather(real, motion), gather(real, 6), real.vectors(motion)
    one, three, six, nine = (real.record(count, lanewise=lanewise) for count in (1, 3, 6, 9))
    step = outwards(real, motion, lanewise=lanewise)
    wrench_of, without = real.lift(steps.wrench, 6), real.lift(steps.without, 6)
    reported = real.lift(steps.reported, 12)

    @numba.njit(forceinline=True)
    def out(
        job: Any, begin: Any, doubt: Any, tables: Any, memory: Any, views: Any, inputs: Any, output: Any, padded: Any
    ) -> Any:
        n, final, nq, nv, columnwise = job[AT.bodies], job[AT.samples] - 1, job[AT.nq], job[AT.nv], job[AT.columnwise]
        hot, frames, topology = tables
        q, v, a = inputs
        state = gather_motion(there(job[AT.base]), job[AT.base_stride], begin, final)
        put(memory, 3 * ring * lanes, state)
        q_there, v_there = 0, 0
        for i in range(n):
            row = i * TOPOLOGY
            if not columnwise:
                if q_there < nq and q_there < topology[row + Q_COLUMN] + _MOST_Q:
                    fill(q[0], q[1], begin, final, q_there, nq, views[0][0], (q_there & (ring - 1)) * lanes)
                    q_there += lanes
                if v_there < nv and v_there < topology[row + V_COLUMN] + _MOST_V:
                    fill(v[0], v[1], begin, final, v_there, nv, views[1][0], (v_there & (ring - 1)) * lanes)
                    fill(a[0], a[1], begin, final, v_there, nv, views[2][0], (v_there & (ring - 1)) * lanes)
                    v_there += lanes
            if topology[row + FROM] >= 0:
                state = motion_vectors(memory, topology[row + FROM])
            state, doubt = step(i, state, doubt, tables, memory, views)
            force = wrench_of((state, one(hot, i * HOT + 5)[0], three(hot, i * HOT + 6), six(hot, i * HOT + 9)))
            if job[AT.external]:
                begins = ahead(there(job[AT.external]), i * job[AT.external_body])
                external = gather_six(begins, job[AT.external_sample], begin, final)
                force = without((force, external, nine(frames, i * FRAME)))
            put(memory, topology[row + FORCE], force)
            if topology[row + KEEP] >= 0:
                put(memory, topology[row + KEEP], state)
            if bodies:
                put_apart(output, i * 18 * padded + begin, padded, reported((state, nine(frames, i * FRAME))))
        return doubt

    return out


def _back(real: Real, *, bodies: bool, lanewise: bool) -> Any:
    """Wrenches summed up towards the base, and the torques."""
    lanes, ring = real.lanes, 2 * real.lanes
    zero, put, put_apart, empty = real.zero(), real.put(), real.put_apart(), turn_out(real)
    six_vectors, nine = real.vectors(6), real.record(9, lanewise=lanewise)
    step = inwards(real, lanewise=lanewise)
    total, turned = real.lift(steps.total, 6), real.lift(steps.turned, 6)

    @numba.njit(forceinline=True)
    def back(
        job: Any, begin: Any, carried: Any, tables: Any, memory: Any, target: Any, torque: Any, output: Any,
        padded: Any,
    ) -> Any:  # fmt: skip
        n, final, nv, columnwise = job[AT.bodies], job[AT.samples] - 1, job[AT.nv], job[AT.columnwise]
        frames, topology = tables[1], tables[2]
        null = zero()
        pending = (nv - 1) // lanes * lanes
        for i in range(n - 1, -1, -1):
            row = i * TOPOLOGY
            force = total((carried, six_vectors(memory, topology[row + FORCE])))
            if bodies:
                place = (i * 18 + 12) * padded + begin
                put_apart(output, place, padded, turned((force, nine(frames, i * FRAME))))
            carried = step(i, force, tables, memory, target)
            if topology[row + FROM] >= 0:
                to = topology[row + RETURN]
                put(memory, to, total((carried, six_vectors(memory, to))))
                carried = (null, null, null, null, null, null)
            if not columnwise and topology[row + V_COLUMN] <= pending:
                at = (pending & (ring - 1)) * lanes
                empty(torque[0], torque[1], begin, final, pending, nv, memory, at)
                pending -= lanes
        return carried

    return back
