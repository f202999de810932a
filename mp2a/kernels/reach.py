"""What the blocks of a long chain amount to: the path across each, a block a lane.

Only building the kernels imports this module; `mp2a.kernels.long` uses the kernel.
"""

from collections.abc import Callable
from typing import Any

from mp2a.kernels import steps
from mp2a.kernels.lanes import Real, integers
from mp2a.kernels.plan import AT, FRAME, HOT
from mp2a.kernels.squares import turn_in

PATH = 24
"""Numbers of a path: angular velocity and acceleration, acceleration and velocity of its end against its start, its
rotation row by row, and its end's place."""


def reach(real: Real) -> Callable[..., None]:
    """Make the kernel, which is called as those of `mp2a.kernels.recursion` are, with one chunk.

    The paths go to the job's ``output``, ``(24, lanes)``.
    """
    lanes = real.lanes
    there, aligned, take, put = real.there(), real.aligned(), real.take_columns(1), real.put()
    one, two, three = (real.record(count, lanewise=True) for count in (1, 2, 3))
    fill, start = turn_in(real), real.lift(steps.no_path, PATH)
    fork, angle, slide = real.lift(steps.fork, 9), real.lift(steps.angle, 2), real.lift(steps.slide, 3)
    longer, share, zero = real.lift(steps.reach, PATH), real.lift(steps.share), real.zero()

    def run(job_at: Any, first: Any, last: Any, scratch_at: Any, verdict_at: Any) -> None:
        job = integers(job_at)
        n, final = job[AT.bodies], job[AT.samples] - 1
        hot, frames, memory = there(job[AT.hot]), there(job[AT.frames]), aligned(there(scratch_at))
        q, v, a = there(job[AT.q]), there(job[AT.v]), there(job[AT.a])
        columns, square = (memory, -1, lanes), lanes * lanes
        path = start((zero(),))
        path = path[0:12] + fork((path[12:21], two(frames, 18))) + path[21:24]
        for i in range(n):
            k = i & (lanes - 1)
            if k == 0:
                fill(q, job[AT.q_stride], 0, final, i, n, memory, 0)
                fill(v, job[AT.v_stride], 0, final, i, n, memory, square)
                fill(a, job[AT.a_stride], 0, final, i, n, memory, 2 * square)
            tilt, shares = two(hot, i * HOT), two(frames, i * FRAME + 22)
            x, rate, growth = take(columns, k)[0], take(columns, lanes + k)[0], take(columns, 2 * lanes + k)[0]
            turn = angle((share((x, shares[0])), one(hot, i * HOT + 15)[0]))
            place = slide((share((x, shares[1])), three(hot, i * HOT + 2), tilt))
            path = longer((path, turn + tilt, place, rate, growth, shares))
        put(there(job[AT.output]), 0, path)

    return run
