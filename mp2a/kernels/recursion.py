"""Inverse dynamics of many samples: each lane of a vector is a sample, and eight go through the chain and back at once.

What eight samples leave between the way out and the way back fits the cache. Only building the kernels imports this
module; `mp2a.kernels.plan` says what the kernel works on.
"""

from collections.abc import Callable
from typing import Any

from mp2a.kernels import steps
from mp2a.kernels.lanes import Real, integers

# Names of `plan` that compiled functions use have to be plain global numbers.
from mp2a.kernels.plan import (
    FORCE,
    FORK,
    FRAME,
    FREE,
    FROM,
    HOT,
    KEEP,
    KIND,
    PLANAR,
    PRISMATIC,
    Q_COLUMN,
    RETURN,
    REVOLUTE,
    SLOT,
    TOPOLOGY,
    V_COLUMN,
)

_MOST_Q, _MOST_V = 7, 6


def recursion(real: Real, *, bodies: bool) -> Callable[..., None]:
    """Make the kernel of a number format.

    Parameters
    ----------
    real
        The format.
    bodies
        Whether velocity, acceleration and force of every body are asked for as well.

    Returns
    -------
    Callable
        ``f(job, first, last, scratch, verdict)``, for numba: chunks ``first … last - 1`` of the job of `plan.Job`, the
        addresses of scratch memory and of an integer that becomes 1 if a sample needs to be looked at.
    """
    lanes, size = real.lanes, real.kind.bitwidth // 8
    ring = 2 * lanes
    motion = 12 if bodies else 9
    at, load, store, zero, is_nan = real.at(), real.load(), real.store(), real.zero(), real.is_nan()
    put, put_apart, take_two = real.put(), real.put_apart(), real.take_columns(2)
    take_three, take_four, take_six = real.take_columns(3), real.take_columns(4), real.take_columns(6)
    take_seven, put_columns = real.take_columns(7), real.put_columns()
    turn_in, turn_out, gather_six, gather_motion = real.turn_in(), real.turn_out(), real.gather(6), real.gather(motion)
    two, three, six, nine = real.record(2), real.record(3), real.record(6), real.record(9)
    three_vectors, six_vectors, nine_vectors = real.vectors(3), real.vectors(6), real.vectors(9)
    motion_vectors = real.vectors(motion)
    angle, added_angle = real.lift(steps.angle, 2), real.lift(steps.added_angle, 2)
    slide, fork, join = real.lift(steps.slide, 3), real.lift(steps.fork, motion), real.lift(steps.join, 6)
    revolute, prismatic = real.lift(steps.revolute, motion), real.lift(steps.prismatic, motion)
    general, wrench_of = real.lift(steps.general, motion), real.lift(steps.wrench, 6)
    wrench_inwards, general_inwards = real.lift(steps.wrench_inwards, 6), real.lift(steps.general_inwards, 6)
    turned_motion, turned_wrench = real.lift(steps.turned, motion), real.lift(steps.turned, 6)
    without, total = real.lift(steps.without, 6), real.lift(steps.total, 6)
    planar, spherical, free = (real.lift(f, 12) for f in (steps.planar, steps.spherical, steps.free))
    doubt_angle, doubt_length = real.lift(steps.doubt_angle), real.lift(steps.doubt_length)
    constant_turn = real.lift(lambda offset: (offset[1], offset[0]), 2)
    doubt_results = real.lift(steps.doubt_results)
    planar_rates = real.lift(steps.planar_rates, 6)
    spherical_rates, free_rates = real.lift(steps.spherical_rates, 6), real.lift(steps.free_rates, 6)

    def run(job: Any, first: Any, last: Any, scratch: Any, verdict: Any) -> None:
        n, samples, nq, nv, columnwise = job[0], job[1], job[2], job[3], job[4]
        hot, frames, topology = at(job[5]), at(job[6]), integers(job[7])
        base, base_stride, tip, tip_stride = at(job[8]), job[9], at(job[10]), job[11]
        outside, outside_body, outside_sample = at(job[12]), job[13], job[14]
        q, q_stride, v, v_stride, a, a_stride = at(job[15]), job[16], at(job[17]), job[18], at(job[19]), job[20]
        torque, torque_stride, output, padded, root = at(job[21]), job[22], at(job[23]), job[24], at(job[25])
        memory = at(scratch)
        final = samples - 1
        q_at, v_at, a_at, torque_at = (
            memory,
            at(scratch + ring * lanes * size),
            at(scratch + 2 * ring * lanes * size),
            memory,
        )
        mask, q_step, v_step, a_step, torque_step = ring - 1, lanes, lanes, lanes, lanes
        ground = 3 * ring * lanes
        null = zero()
        nothing = (null, null, null, null, null, null)
        doubt = null
        for chunk in range(first, last):
            begin = chunk * lanes
            if columnwise:
                begin = min(begin, samples - lanes)
                q_at, v_at, a_at = at(job[15] + begin * size), at(job[17] + begin * size), at(job[19] + begin * size)
                torque_at = at(job[21] + begin * size)
                mask, q_step, v_step, a_step, torque_step = -1, q_stride, v_stride, a_stride, torque_stride

            state = gather_motion(base, base_stride, begin, final)
            put(memory, ground, state)
            put(memory, ground + motion * lanes, nothing)
            q_there, v_there = 0, 0
            for i in range(n):
                row, record, frame = i * TOPOLOGY, i * HOT, i * FRAME
                kind, slot = topology[row + KIND], topology[row + SLOT]
                q_column, v_column = topology[row + Q_COLUMN], topology[row + V_COLUMN]
                if not columnwise:
                    if q_there < nq and q_there < q_column + _MOST_Q:
                        turn_in(q, q_stride, begin, final, q_there, nq, memory, (q_there & mask) * lanes)
                        q_there += lanes
                    if v_there < nv and v_there < v_column + _MOST_V:
                        turn_in(v, v_stride, begin, final, v_there, nv, v_at, (v_there & mask) * lanes)
                        turn_in(a, a_stride, begin, final, v_there, nv, a_at, (v_there & mask) * lanes)
                        v_there += lanes
                if topology[row + FROM] >= 0:
                    state = motion_vectors(memory, topology[row + FROM])
                place = three(hot, record + 2)
                if kind <= PRISMATIC:
                    if topology[row + FORK]:
                        state = fork((state, two(frames, frame + 18)))
                    tilt = two(hot, record)
                    rate = load(v_at, (v_column & mask) * v_step)
                    growth = load(a_at, (v_column & mask) * a_step)
                    if kind == PRISMATIC:
                        x = load(q_at, (q_column & mask) * q_step)
                        offset = two(frames, frame + 20)
                        turn = constant_turn((offset,))
                        state = prismatic((state, turn + tilt, slide((x, place, tilt)), rate, growth))
                        store(memory, slot + 8 * lanes, x)
                    else:
                        if kind == REVOLUTE:
                            x = load(q_at, (q_column & mask) * q_step)
                            doubt = doubt_angle((doubt, x, hot[record + 15]))
                            turn = angle((x, hot[record + 15]))
                        else:
                            pair = take_two(q_at, mask, q_step, q_column)
                            doubt = doubt_length((doubt, pair))
                            turn = added_angle((pair[0], pair[1], two(frames, frame + 20)))
                        state = revolute((state, turn + tilt, place, rate, growth))
                    put(memory, slot, turn)
                else:
                    local = nine(frames, frame + 9)
                    if kind == PLANAR:
                        x = take_four(q_at, mask, q_step, q_column)
                        doubt = doubt_length((doubt, (x[2], x[3])))
                        pose = planar((x, local, place))
                        rates = planar_rates((take_three(v_at, mask, v_step, v_column),))
                        growths = planar_rates((take_three(a_at, mask, a_step, v_column),))
                    elif kind == FREE:
                        y = take_seven(q_at, mask, q_step, q_column)
                        doubt = doubt_length((doubt, (y[3], y[4], y[5], y[6])))
                        pose = free((y, local, place))
                        rates = free_rates((take_six(v_at, mask, v_step, v_column),))
                        growths = free_rates((take_six(a_at, mask, a_step, v_column),))
                    else:
                        x = take_four(q_at, mask, q_step, q_column)
                        doubt = doubt_length((doubt, x))
                        pose = spherical((x, local, place))
                        rates = spherical_rates((take_three(v_at, mask, v_step, v_column),))
                        growths = spherical_rates((take_three(a_at, mask, a_step, v_column),))
                    put(memory, slot, pose)
                    state = general((state, pose[0:9], pose[9:12], rates, growths))
                force = wrench_of((state, hot[record + 5], three(hot, record + 6), six(hot, record + 9)))
                if job[12]:
                    external = gather_six(at(job[12] + i * outside_body * size), outside_sample, begin, final)
                    force = without((force, external, nine(frames, frame)))
                put(memory, topology[row + FORCE], force)
                if topology[row + KEEP] >= 0:
                    put(memory, topology[row + KEEP], state)
                if bodies:
                    put_apart(output, i * 18 * padded + begin, padded, turned_motion((state, nine(frames, frame))))

            carried = without((nothing, gather_six(tip, tip_stride, begin, final), nine(frames, (n - 1) * FRAME)))
            pending = (nv - 1) // lanes * lanes
            for i in range(n - 1, -1, -1):
                row, record, frame = i * TOPOLOGY, i * HOT, i * FRAME
                kind, slot, column = topology[row + KIND], topology[row + SLOT], topology[row + V_COLUMN]
                force = total((carried, six_vectors(memory, topology[row + FORCE])))
                if bodies:
                    put_apart(
                        output, (i * 18 + 12) * padded + begin, padded, turned_wrench((force, nine(frames, frame)))
                    )
                place = three(hot, record + 2)
                if kind <= PRISMATIC:
                    tilt = two(hot, record)
                    turn = load(memory, slot), load(memory, slot + lanes)
                    if kind == PRISMATIC:
                        result = (force[5],)
                        x = load(memory, slot + 8 * lanes)
                        carried = wrench_inwards((force, turn + tilt, slide((x, place, tilt))))
                    else:
                        result = (force[2],)
                        carried = wrench_inwards((force, turn + tilt, place))
                    if topology[row + FORK]:
                        carried = join((carried, two(frames, frame + 18)))
                    doubt = doubt_results((doubt, result))
                    put_columns(torque_at, mask, torque_step, column, result)
                else:
                    if kind == PLANAR:
                        doubt = doubt_results((doubt, (force[3], force[4], force[2])))
                        put_columns(torque_at, mask, torque_step, column, (force[3], force[4], force[2]))
                    elif kind == FREE:
                        doubt = doubt_results((doubt, force))
                        put_columns(torque_at, mask, torque_step, column, force[3:6])
                        put_columns(torque_at, mask, torque_step, column + 3, force[0:3])
                    else:
                        doubt = doubt_results((doubt, force[0:3]))
                        put_columns(torque_at, mask, torque_step, column, force[0:3])
                    carried = general_inwards(
                        (force, nine_vectors(memory, slot), three_vectors(memory, slot + 9 * lanes))
                    )
                if topology[row + FROM] >= 0:
                    to = topology[row + RETURN]
                    put(memory, to, total((carried, six_vectors(memory, to))))
                    carried = nothing
                if not columnwise and column <= pending:
                    turn_out(torque, torque_stride, begin, final, pending, nv, memory, (pending & mask) * lanes)
                    pending -= lanes
            put_apart(root, begin, padded, total((carried, six_vectors(memory, ground + motion * lanes))))
        if is_nan(doubt):
            verdict[0] = 1

    return run
