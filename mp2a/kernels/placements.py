"""Where the bodies are, for many samples: each lane of a vector is a sample, as in `mp2a.kernels.rnea`.

Only building the kernels imports this module; `mp2a.kernels.tables` says what the kernel works on.
"""

from collections.abc import Callable
from typing import Any

from mp2a.kernels import steps
from mp2a.kernels.columns import columns, prefetch_columns
from mp2a.kernels.joint_pose import joint_pose, joint_turn
from mp2a.kernels.lanes import Real, integers
from mp2a.kernels.primitives import compiled
from mp2a.kernels.tables import AT, FORK, FRAME_CONSTANTS, FROM, KEEP, KIND, SCREW, TOPOLOGY
from mp2a.kernels.transposition import scatter

_POSE = 12


def placements(real: Real) -> Callable[..., None]:
    """Make the kernel, which is called as those of `mp2a.kernels.rnea` are.

    Rotations go to the job's ``output``, ``(T, n, 9)``, and positions to its ``root``, ``(T, n, 3)``.
    """
    lanes, ring = real.lanes, 2 * real.lanes
    there, ahead, aligned, put, report = real.there(), real.ahead(), real.aligned(), real.put(), scatter(real)
    where, staged, step = columns(real), prefetch_columns(real, rates=False), _step(real)
    zero, is_nan, nine, poses = real.zero(), real.is_nan(), real.record(9), real.vectors(_POSE)
    base_pose, user_rotation = real.lift(steps.base_pose, _POSE), real.lift(steps.turned, 9)
    invalid_results = real.lift(steps.invalid_results)

    def run(job_at: Any, first: Any, last: Any, scratch_at: Any, verdict_at: Any) -> None:
        job = integers(job_at)
        tables = there(job[AT.body_constants]), there(job[AT.frame_constants]), integers(job[AT.topology])
        frame_constants, topology = tables[1], tables[2]
        n, final, memory = job[AT.bodies], job[AT.samples] - 1, aligned(there(scratch_at))
        rotations, positions = there(job[AT.output]), there(job[AT.root])
        invalid = zero()
        for chunk in range(first, last):
            views, begin = where(job, memory, chunk * lanes)
            pose, ready = base_pose((zero(),)), (0, 0)
            put(memory, 3 * ring * lanes, pose)
            for i in range(n):
                row = i * TOPOLOGY
                ready = staged(job, i, topology, views, begin, ready)
                if topology[row + FROM] >= 0:
                    pose = poses(memory, topology[row + FROM])
                pose, invalid = step(i, pose, invalid, tables, views[0])
                if topology[row + KEEP] >= 0:
                    put(memory, topology[row + KEEP], pose)
                rotation = user_rotation((pose[0:9], nine(frame_constants, i * FRAME_CONSTANTS)))
                report(ahead(rotations, i * 9), n * 9, begin, final, rotation)
                report(ahead(positions, i * 3), n * 3, begin, final, pose[9:12])
                invalid = invalid_results((invalid, pose[9:12]))
        if is_nan(invalid):
            integers(verdict_at)[0] = 1

    return run


def _step(real: Real) -> Any:
    """Make the step from the pose of a body's parent to its own."""
    two = real.record(2)
    joint_turn_of, joint_pose_of = joint_turn(real), joint_pose(real)
    fork, single = real.lift(steps.fork_pose, _POSE), real.lift(steps.turned_pose, _POSE)
    general = real.lift(steps.general_pose, _POSE)

    @compiled
    def step(i: Any, pose: Any, invalid: Any, tables: Any, q: Any) -> Any:
        topology = tables[2]
        if topology[i * TOPOLOGY + KIND] <= SCREW:
            if topology[i * TOPOLOGY + FORK]:
                pose = fork((pose, two(tables[1], i * FRAME_CONSTANTS + 18)))
            turn, place, _, invalid = joint_turn_of(i, invalid, tables, q)
            pose = single((pose, turn, place))
        else:
            own, invalid = joint_pose_of(i, invalid, tables, q)
            pose = general((pose, own[0:9], own[9:12]))
        return pose, invalid

    return step
