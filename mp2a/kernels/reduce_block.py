"""What a block of consecutive bodies amounts to: the path across it, and its composite inertia about its start.

Only building the kernels imports this module; `mp2a.kernels.long` and `mp2a.kernels.batch` use the kernels.
"""

from collections.abc import Callable
from typing import Any

from mp2a.kernels import steps
from mp2a.kernels.columns import columns, prefetch_columns
from mp2a.kernels.forward_pass import forward_pass
from mp2a.kernels.lanes import Real, integers
from mp2a.kernels.tables import AT, BODY_CONSTANTS, FRAME_CONSTANTS
from mp2a.kernels.transposition import gather

_PATH, _COMPOSITE = 24, 28


def reduce_block(real: Real, *, per_lane: bool = False) -> Callable[..., None]:
    """Make the kernel, which is called as those of `mp2a.kernels.rnea` are, for a chain without branches.

    The paths go to the job's ``output``, ``(24, padded)``; the composite inertias to its ``root``, ``(28, padded)``, if
    it has one.
    With ``per_lane`` each lane has a block of its own, and paths end in the frames of the tables; else in the user's.
    """
    lanes = real.lanes
    there, ahead, aligned, where, staged = (
        real.there(),
        real.ahead(),
        real.aligned(),
        columns(real),
        prefetch_columns(real),
    )
    one, three, six, nine = (real.record(count, per_lane=per_lane) for count in (1, 3, 6, 9))
    zero, is_nan, put_apart, gather_six = real.zero(), real.is_nan(), real.put_apart(), gather(real, 6)
    start, nothing = real.lift(steps.no_path, _PATH), real.lift(steps.no_composite, _COMPOSITE)
    composite_of, total, with_external = (
        real.lift(steps.composite_of, _COMPOSITE),
        real.lift(steps.total, _COMPOSITE),
        real.lift(steps.with_external, _COMPOSITE),
    )
    path_to_table_frame, path_to_user_frame = (
        real.lift(steps.path_to_table_frame, _PATH),
        real.lift(steps.path_to_user_frame, _PATH),
    )
    step = forward_pass(real, _PATH, per_lane=per_lane)

    def run(job_at: Any, first: Any, last: Any, scratch_at: Any, verdict_at: Any) -> None:
        job = integers(job_at)
        tables = there(job[AT.body_constants]), there(job[AT.frame_constants]), integers(job[AT.topology])
        body_constants, frame_constants, topology = tables
        n, final, padded = job[AT.bodies], job[AT.samples] - 1, job[AT.padded]
        memory = aligned(there(scratch_at))
        invalid = zero()
        for chunk in range(first, last):
            views, begin = where(job, memory, chunk * lanes)
            path, composite, ready = start((zero(),)), nothing((zero(),)), (0, 0)
            for i in range(n):
                ready = staged(job, i, topology, views, begin, ready)
                path, invalid = step(i, path, invalid, tables, memory, views)
                if job[AT.root]:
                    own = composite_of(
                        (
                            path,
                            one(body_constants, i * BODY_CONSTANTS + 5)[0],
                            three(body_constants, i * BODY_CONSTANTS + 6),
                            six(body_constants, i * BODY_CONSTANTS + 9),
                        )
                    )
                    composite = total((composite, own))
                    if job[AT.external]:
                        begins = ahead(there(job[AT.external]), i * job[AT.external_body])
                        external = gather_six(begins, job[AT.external_sample], begin, final)
                        composite = with_external(
                            (composite, path, external, nine(frame_constants, i * FRAME_CONSTANTS))
                        )
            path = (
                path_to_table_frame((path,))
                if per_lane
                else path_to_user_frame((path, nine(frame_constants, (n - 1) * FRAME_CONSTANTS)))
            )
            put_apart(there(job[AT.output]), begin, padded, path)
            if job[AT.root]:
                put_apart(there(job[AT.root]), begin, padded, composite)
        if is_nan(invalid):
            integers(verdict_at)[0] = 1

    return run
