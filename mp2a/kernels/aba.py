"""Forward dynamics of many samples by the articulated-body algorithm, in the way of `mp2a.kernels.rnea`.

The wrenches of inverse dynamics without any joint acceleration are loads that the joint forces have to bear; what is
left of these accelerates joints and bodies in addition to what velocities and the base do already. So each body is
visited three times: outwards by `forward_sweep`, back for what it costs to accelerate a body with all that hangs on it,
outwards again for the accelerations. Of the job, joint forces are where accelerations were, and accelerations go where
torques did.

Only building the kernels imports this module; `mp2a.kernels.tables` says what the kernel works on.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from mp2a.kernels import articulated, steps
from mp2a.kernels.articulated import ROWS
from mp2a.kernels.columns import columns, prefetch_columns_back
from mp2a.kernels.lanes import Real, integers
from mp2a.kernels.primitives import compiled
from mp2a.kernels.rnea import forward_sweep
from mp2a.kernels.tables import (
    ARMATURE,
    AT,
    BODY_CONSTANTS,
    FORCE,
    FORK,
    FRAME_CONSTANTS,
    FREE,
    FROM,
    GAIN,
    GAINS,
    INERTIA,
    KEEP,
    KIND,
    PLANAR,
    PRISMATIC,
    RETURN,
    SLOT,
    TOPOLOGY,
    V_COLUMN,
)
from mp2a.kernels.transposition import transpose_out

_STATE = 9
"""Numbers of a state, behind which a body that others hang on keeps their inertia."""

_LOAD_AT, _GAINS_AT = 1 + INERTIA, 1 + INERTIA + 6
"""Where in the results of `mp2a.kernels.articulated.eliminate` load and gains begin."""


def aba(real: Real) -> Callable[..., None]:
    """Make the kernel of a number format.

    Returns
    -------
    Callable
        ``f(job, first, last, scratch, verdict)``, as `mp2a.kernels.rnea.rnea`.
    """
    lanes, there, zero, is_nan, aligned = real.lanes, real.there(), real.zero(), real.is_nan(), real.aligned()
    where, loads = columns(real), forward_sweep(real, _STATE, bodies=False, per_lane=False, accelerated=False)
    inertias, accelerations = _inertias(real), _accelerations(real)

    def run(job_at: Any, first: Any, last: Any, scratch_at: Any, verdict_at: Any) -> None:
        job = integers(job_at)
        tables = there(job[AT.body_constants]), there(job[AT.frame_constants]), integers(job[AT.topology])
        memory = aligned(there(scratch_at))
        invalid = zero()
        for chunk in range(first, last):
            views, begin = where(job, memory, chunk * lanes)
            invalid = loads(job, begin, invalid, tables, memory, views)
            invalid = inertias(job, begin, invalid, tables, memory, views[2])
            invalid = accelerations(job, begin, invalid, tables, memory, views[3])
        if is_nan(invalid):
            integers(verdict_at)[0] = 1

    return run


def _inertias(real: Real) -> Any:
    """Inertia and load of each body with all that hangs on it, and what its joint leaves of them to its parent."""
    lanes, ring = real.lanes, 2 * real.lanes
    root, put, zero, staged = 3 * ring * lanes, real.put(), real.zero(), prefetch_columns_back(real)
    two, load_at, inertia_at = real.record(2), real.vectors(6), real.vectors(INERTIA)
    total, add, own = real.lift(steps.total, 6), real.lift(steps.total, INERTIA), _own_inertia(real)
    join_inertia, join = real.lift(articulated.join_inertia, INERTIA), real.lift(steps.join, 6)
    single, several, check = _single_gives_way(real), _several_give_way(real), real.lift(steps.invalid_results)

    @compiled
    def back(job: Any, begin: Any, invalid: Any, tables: Any, memory: Any, tau: Any) -> Any:
        body_constants, frame_constants, topology = tables
        n = job[AT.bodies]
        null = zero()
        no_load = null, null, null, null, null, null
        no_inertia = no_load + no_load + no_load + (null, null, null)
        for i in range(n):
            if topology[i * TOPOLOGY + KEEP] >= 0:
                put(memory, topology[i * TOPOLOGY + KEEP] + _STATE * lanes, own(i, no_inertia, body_constants))
        inertia, load = no_inertia, no_load
        ready = job[AT.nv]
        for i in range(n - 1, -1, -1):
            row = i * TOPOLOGY
            ready = staged(job, i, topology, tau, begin, ready)
            if topology[row + KEEP] >= 0:
                inertia = add((inertia, inertia_at(memory, topology[row + KEEP] + _STATE * lanes)))
            else:
                inertia = own(i, inertia, body_constants)
            load = total((load, load_at(memory, topology[row + FORCE])))
            if topology[row + KIND] <= PRISMATIC:
                inertia, load, invalid = single(i, invalid, inertia, load, tables, memory, tau)
                if topology[row + FORK]:
                    turn = two(frame_constants, i * FRAME_CONSTANTS + 18)
                    inertia, load = join_inertia((inertia, turn)), join((load, turn))
            else:
                inertia, load, invalid = several(i, invalid, inertia, load, tables, memory, tau)
            if topology[row + FROM] >= 0:
                if topology[row + FROM] == root:
                    invalid = check((invalid, load))
                else:
                    to = topology[row + FROM] + _STATE * lanes
                    put(memory, to, add((inertia, inertia_at(memory, to))))
                    to = topology[row + RETURN]
                    put(memory, to, total((load, load_at(memory, to))))
                inertia, load = no_inertia, no_load
        # A number of a joint that nothing else depends on still shows in what the base bears.
        return check((invalid, load))

    return back


def _own_inertia(real: Real) -> Any:
    """Inertia of what hangs on a body, and of the body itself."""
    one, three, six = (real.record(count) for count in (1, 3, 6))
    total = real.lift(articulated.body_inertia, INERTIA)

    @compiled
    def own(i: Any, inertia: Any, body_constants: Any) -> Any:
        mass, moment, rotational = i * BODY_CONSTANTS + 5, i * BODY_CONSTANTS + 6, i * BODY_CONSTANTS + 9
        return total(
            (inertia, one(body_constants, mass)[0], three(body_constants, moment), six(body_constants, rotational))
        )

    return own


def _gives_way(real: Real, kind: str) -> Any:
    return real.lift(partial(articulated.eliminate, ROWS[kind]), _GAINS_AT + GAIN * len(ROWS[kind]))


def _single_gives_way(real: Real) -> Any:
    """Joints with one degree of freedom."""
    lanes = real.lanes
    put, number, turn_at, take = real.put(), real.load(), real.vectors(2), real.take_columns(1)
    one, two, three = real.record(1), real.record(2), real.record(3)
    revolute, prismatic, slide = _gives_way(real, "revolute"), _gives_way(real, "prismatic"), real.lift(steps.slide, 3)
    inertia_to_parent = real.lift(articulated.inertia_to_parent, INERTIA)
    load_to_parent = real.lift(steps.wrench_to_parent, 6)

    @compiled
    def single(i: Any, invalid: Any, inertia: Any, load: Any, tables: Any, memory: Any, tau: Any) -> Any:
        body_constants, _, topology = tables
        row, record = i * TOPOLOGY, i * BODY_CONSTANTS
        slot = topology[row + SLOT]
        tilt, place = two(body_constants, record), three(body_constants, record + 2)
        turn = turn_at(memory, slot) + tilt
        forces, armature = take(tau, topology[row + V_COLUMN]), one(body_constants, record + ARMATURE)
        if topology[row + KIND] == PRISMATIC:
            left = prismatic((invalid, inertia, load, forces, armature))
            above = slide((number(memory, slot + 8 * lanes), place, tilt))
            inertia = inertia_to_parent((left[1:_LOAD_AT], turn, above))
            load = load_to_parent((left[_LOAD_AT:_GAINS_AT], turn, above))
        else:
            left = revolute((invalid, inertia, load, forces, armature))
            inertia = inertia_to_parent((left[1:_LOAD_AT], turn, place))
            load = load_to_parent((left[_LOAD_AT:_GAINS_AT], turn, place))
        put(memory, topology[row + GAINS], left[_GAINS_AT:])
        return inertia, load, left[0]

    return single


def _several_give_way(real: Real) -> Any:
    """Joints with several degrees of freedom."""
    put, pose_at, take_three, take_six = real.put(), real.vectors(12), real.take_columns(3), real.take_columns(6)
    three, six = real.record(3), real.record(6)
    planar, spherical, free = (_gives_way(real, kind) for kind in ("planar", "spherical", "free"))
    inertia_to_parent = real.lift(articulated.general_inertia_to_parent, INERTIA)
    load_to_parent = real.lift(steps.general_wrench_to_parent, 6)

    @compiled
    def several(i: Any, invalid: Any, inertia: Any, load: Any, tables: Any, memory: Any, tau: Any) -> Any:
        body_constants, _, topology = tables
        row, record = i * TOPOLOGY, i * BODY_CONSTANTS + ARMATURE
        column, gains = topology[row + V_COLUMN], topology[row + GAINS]
        if topology[row + KIND] == FREE:
            of_six = free((invalid, inertia, load, take_six(tau, column), six(body_constants, record)))
            put(memory, gains, of_six[_GAINS_AT:])
            invalid, inertia, load = of_six[0], of_six[1:_LOAD_AT], of_six[_LOAD_AT:_GAINS_AT]
        else:
            forces, armature = take_three(tau, column), three(body_constants, record)
            if topology[row + KIND] == PLANAR:
                of_three = planar((invalid, inertia, load, forces, armature))
            else:
                of_three = spherical((invalid, inertia, load, forces, armature))
            put(memory, gains, of_three[_GAINS_AT:])
            invalid, inertia, load = of_three[0], of_three[1:_LOAD_AT], of_three[_LOAD_AT:_GAINS_AT]
        pose = pose_at(memory, topology[row + SLOT])
        inertia = inertia_to_parent((inertia, pose[0:9], pose[9:12]))
        return inertia, load_to_parent((load, pose[0:9], pose[9:12])), invalid

    return several


def _accelerations(real: Real) -> Any:
    """Accelerations of joints, and of bodies beyond those that there are without, from the base outwards."""
    lanes, ring = real.lanes, 2 * real.lanes
    there, put, zero, empty = real.there(), real.put(), real.zero(), transpose_out(real)
    root, two, motion_at = 3 * ring * lanes, real.record(2), real.vectors(6)
    fork, step = real.lift(steps.fork, 6), _accelerate(real)

    @compiled
    def out(job: Any, begin: Any, invalid: Any, tables: Any, memory: Any, joints: Any) -> Any:
        n, final, nv = job[AT.bodies], job[AT.samples] - 1, job[AT.nv]
        frame_constants, topology = tables[1], tables[2]
        null = zero()
        still = null, null, null, null, null, null
        motion = still
        written = 0
        for i in range(n):
            row = i * TOPOLOGY
            if topology[row + FROM] == root:
                motion = still
            elif topology[row + FROM] >= 0:
                motion = motion_at(memory, topology[row + FROM])
            if topology[row + FORK]:
                motion = fork((motion, two(frame_constants, i * FRAME_CONSTANTS + 18)))
            motion, invalid = step(i, motion, invalid, tables, memory, joints)
            if topology[row + KEEP] >= 0:
                put(memory, topology[row + KEEP], motion)
            is_last = i == n - 1
            known = nv if is_last else topology[row + TOPOLOGY + V_COLUMN]
            while not job[AT.columnwise] and (known - written >= lanes or (is_last and written < nv)):
                at = (written & (ring - 1)) * lanes
                empty(there(job[AT.torque]), job[AT.torque_stride], begin, final, written, nv, memory, at)
                written += lanes
        return invalid

    return out


def _accelerate(real: Real) -> Any:
    """One body."""
    lanes = real.lanes
    number, put, pose_at, turn_at = real.load(), real.put_columns(), real.vectors(12), real.vectors(2)
    two, three, slide = real.record(2), real.record(3), real.lift(steps.slide, 3)
    single, general = real.lift(articulated.motion_to_body, 6), real.lift(articulated.general_motion_to_body, 6)
    gains_of_one, gains_of_three, gains_of_six = (real.vectors(GAIN * count) for count in (1, 3, 6))
    revolute, prismatic, planar, spherical, free = (
        real.lift(partial(articulated.accelerate, rows), 6 + len(rows)) for rows in ROWS.values()
    )
    check = real.lift(steps.invalid_results)

    @compiled
    def step(i: Any, motion: Any, invalid: Any, tables: Any, memory: Any, joints: Any) -> Any:
        body_constants, _, topology = tables
        row, record = i * TOPOLOGY, i * BODY_CONSTANTS
        kind, slot, gains = topology[row + KIND], topology[row + SLOT], topology[row + GAINS]
        column = topology[row + V_COLUMN]
        if kind <= PRISMATIC:
            tilt, place = two(body_constants, record), three(body_constants, record + 2)
            turn = turn_at(memory, slot) + tilt
            if kind == PRISMATIC:
                above = slide((number(memory, slot + 8 * lanes), place, tilt))
                of_one = prismatic((single((motion, turn, above)), gains_of_one(memory, gains)))
            else:
                of_one = revolute((single((motion, turn, place)), gains_of_one(memory, gains)))
            put(joints, column, of_one[6:7])
            return of_one[0:6], check((invalid, of_one[6:7]))
        pose = pose_at(memory, slot)
        motion = general((motion, pose[0:9], pose[9:12]))
        if kind == FREE:
            of_six = free((motion, gains_of_six(memory, gains)))
            put(joints, column, of_six[6:12])
            return of_six[0:6], check((invalid, of_six[6:12]))
        kept = gains_of_three(memory, gains)
        of_three = planar((motion, kept)) if kind == PLANAR else spherical((motion, kept))
        put(joints, column, of_three[6:9])
        return of_three[0:6], check((invalid, of_three[6:9]))

    return step
