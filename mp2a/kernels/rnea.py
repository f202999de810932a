"""Inverse dynamics of many samples: each lane of a vector is a sample, and eight go through the chain and back at once.

What eight samples leave between the way out and the way back fits the cache. Where the columns of a sample lie together
in memory, squares of input and torque are transposed in registers (`mp2a.kernels.columns`).

Only building the kernels imports this module; `mp2a.kernels.tables` says what the kernel works on.
"""

from collections.abc import Callable
from typing import Any

from mp2a.kernels import steps
from mp2a.kernels.backward_pass import backward_pass
from mp2a.kernels.columns import columns, prefetch_columns, prefetch_results
from mp2a.kernels.forward_pass import forward_pass
from mp2a.kernels.lanes import Real, integers
from mp2a.kernels.primitives import compiled
from mp2a.kernels.tables import AT, BODY_CONSTANTS, FORCE, FRAME_CONSTANTS, FROM, KEEP, RETURN, TOPOLOGY, V_COLUMN
from mp2a.kernels.transposition import gather, scatter, transpose_out


def rnea(real: Real, *, bodies: bool, per_lane: bool = False) -> Callable[..., None]:
    """Make the kernel of a number format.

    Parameters
    ----------
    real
        The format.
    bodies
        Whether velocity, acceleration and force of every body are asked for as well.
    per_lane
        Whether each lane has bodies of its own, as `mp2a.kernels.long` has them, instead of samples of the same.

    Returns
    -------
    Callable
        ``f(job, first, last, scratch, verdict)``, for numba: chunks ``first … last - 1`` of a
        `mp2a.kernels.tables.KernelJob`; the addresses of pointers to the job, to scratch memory and to an integer that
        becomes 1 if a sample is invalid.
    """
    lanes, ring = real.lanes, 2 * real.lanes
    motion = 12 if bodies else 9
    there, zero, is_nan, put_apart, where = real.there(), real.zero(), real.is_nan(), real.put_apart(), columns(real)
    gather_six, nine, aligned = gather(real, 6), real.record(9, per_lane=per_lane), real.aligned()
    total, without = real.lift(steps.total, 6), real.lift(steps.without, 6)
    out = forward_sweep(real, motion, bodies=bodies, per_lane=per_lane)
    back = _back(real, bodies=bodies, per_lane=per_lane)
    put, six_vectors, invalid_results = real.put(), real.vectors(6), real.lift(steps.invalid_results)

    def run(job_at: Any, first: Any, last: Any, scratch_at: Any, verdict_at: Any) -> None:
        job = integers(job_at)
        tables = there(job[AT.body_constants]), there(job[AT.frame_constants]), integers(job[AT.topology])
        memory = aligned(there(scratch_at))
        final = job[AT.samples] - 1
        root = 3 * ring * lanes + motion * lanes
        null = zero()
        nothing = (null, null, null, null, null, null)
        invalid = null
        for chunk in range(first, last):
            views, begin = where(job, memory, chunk * lanes)
            put(memory, root, nothing)
            if not job[AT.backward_only]:
                invalid = out(job, begin, invalid, tables, memory, views)
            carried = gather_six(there(job[AT.tip]), job[AT.tip_stride], begin, final)
            if not per_lane:
                carried = without((nothing, carried, nine(tables[1], (job[AT.bodies] - 1) * FRAME_CONSTANTS)))
            carried = back(job, begin, carried, tables, memory, views[3])
            carried = total((carried, six_vectors(memory, root)))
            # What is not finite anywhere ends up here.
            invalid = invalid_results((invalid, carried))
            put_apart(there(job[AT.root]), begin, job[AT.padded], carried)
        if is_nan(invalid):
            integers(verdict_at)[0] = 1

    return run


def forward_sweep(real: Real, motion: int, *, bodies: bool, per_lane: bool, accelerated: bool = True) -> Any:
    """Motion of all bodies, and the wrenches that it takes; without ``accelerated`` the joints' accelerations are 0."""
    lanes, ring = real.lanes, 2 * real.lanes
    there, ahead, put, report = real.there(), real.ahead(), real.put(), scatter(real)
    staged = prefetch_columns(real, accelerated=accelerated)
    gather_motion, gather_six, motion_vectors = gather(real, motion), gather(real, 6), real.vectors(motion)
    one, three, six, nine = (real.record(count, per_lane=per_lane) for count in (1, 3, 6, 9))
    step = forward_pass(real, motion, per_lane=per_lane, accelerated=accelerated)
    wrench_of, without = real.lift(steps.wrench, 6), real.lift(steps.without, 6)
    reported = real.lift(steps.reported, 12)

    @compiled
    def out(job: Any, begin: Any, invalid: Any, tables: Any, memory: Any, views: Any) -> Any:
        n, final = job[AT.bodies], job[AT.samples] - 1
        body_constants, frame_constants, topology = tables
        state = gather_motion(there(job[AT.base]), job[AT.base_stride], begin, final)
        put(memory, 3 * ring * lanes, state)
        ready = (0, 0)
        for i in range(n):
            row = i * TOPOLOGY
            ready = staged(job, i, topology, views, begin, ready)
            if topology[row + FROM] >= 0:
                state = motion_vectors(memory, topology[row + FROM])
            state, invalid = step(i, state, invalid, tables, memory, views)
            force = wrench_of(
                (
                    state,
                    one(body_constants, i * BODY_CONSTANTS + 5)[0],
                    three(body_constants, i * BODY_CONSTANTS + 6),
                    six(body_constants, i * BODY_CONSTANTS + 9),
                )
            )
            if job[AT.external]:
                begins = ahead(there(job[AT.external]), i * job[AT.external_body])
                external = gather_six(begins, job[AT.external_sample], begin, final)
                force = without((force, external, nine(frame_constants, i * FRAME_CONSTANTS)))
            put(memory, topology[row + FORCE], force)
            if topology[row + KEEP] >= 0:
                put(memory, topology[row + KEEP], state)
            if bodies:
                moving = reported((state, nine(frame_constants, i * FRAME_CONSTANTS)))
                report(ahead(there(job[AT.output]), i * 18), n * 18, begin, final, moving)
        return invalid

    return out


def _back(real: Real, *, bodies: bool, per_lane: bool) -> Any:
    """Wrenches summed up towards the base, and the torques."""
    lanes, ring = real.lanes, 2 * real.lanes
    zero, put, report, empty, there = real.zero(), real.put(), scatter(real), transpose_out(real), real.there()
    ahead, staged = real.ahead(), prefetch_results(real)
    six_vectors, nine = real.vectors(6), real.record(9, per_lane=per_lane)
    step = backward_pass(real, per_lane=per_lane)
    total, turned = real.lift(steps.total, 6), real.lift(steps.turned, 6)

    @compiled
    def back(job: Any, begin: Any, carried: Any, tables: Any, memory: Any, torque: Any) -> Any:
        n, final, nv = job[AT.bodies], job[AT.samples] - 1, job[AT.nv]
        frame_constants, topology = tables[1], tables[2]
        null = zero()
        pending = (nv - 1) // lanes * lanes
        for i in range(n - 1, -1, -1):
            row = i * TOPOLOGY
            staged(job, i, topology, torque)
            force = total((carried, six_vectors(memory, topology[row + FORCE])))
            if bodies:
                pressing = turned((force, nine(frame_constants, i * FRAME_CONSTANTS)))
                report(ahead(there(job[AT.output]), i * 18 + 12), n * 18, begin, final, pressing)
            carried = step(i, force, tables, memory, torque)
            if topology[row + FROM] >= 0:
                to = topology[row + RETURN]
                put(memory, to, total((carried, six_vectors(memory, to))))
                carried = (null, null, null, null, null, null)
            if not job[AT.columnwise] and topology[row + V_COLUMN] <= pending:
                at = (pending & (ring - 1)) * lanes
                empty(there(job[AT.torque]), job[AT.torque_stride], begin, final, pending, nv, memory, at)
                pending -= lanes
        return carried

    return back
