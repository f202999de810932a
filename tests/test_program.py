"""A recorded program computes what its method says, in memory that is used again only when nobody needs it any more."""

import numpy as np
import pytest
from helpers import ALL_JOINTS, random_load
from hypothesis import given
from hypothesis import strategies as st

from mp2a import Model
from mp2a.joint_kinematics import joint_torque
from mp2a.methods import METHODS
from mp2a.methods.block import Block, even_counts
from mp2a.methods.local import solve_locally
from mp2a.program.memory import Frame, lay_out
from mp2a.program.operations import NOTHING, Operation, add, compose, product, push
from mp2a.program.recorder import Communication, Computation, MethodRecorder, Output
from mp2a.program.replay import compute
from mp2a.schedule import Round, Schedule, Transfer, shifted
from mp2a.validation import check_state


def close(ours, theirs, whole):
    return np.abs(ours - theirs).max() <= 1e-12 * np.abs(whole).max()


def exchange_all(frames, k):
    """Do the k-th exchange of all ranks; each takes its messages out of the senders' memory."""
    sent = {}
    for rank, frame in enumerate(frames):
        exchange = [x for x in frame.layout.program.instructions if isinstance(x, Communication)][k]
        for message in exchange.sends:
            key = rank, message.partner, message.kind
            assert key not in sent
            sent[key] = frame.message(message).copy()
    for rank, frame in enumerate(frames):
        exchange = [x for x in frame.layout.program.instructions if isinstance(x, Communication)][k]
        for message in exchange.receives:
            frame.message(message)[:] = sent.pop((message.partner, rank, message.kind))
    assert not sent


def run_all(frames):
    """Go through the programs of all ranks together, from exchange to exchange."""
    places = [0] * len(frames)
    exchanges = sum(isinstance(x, Communication) for x in frames[0].layout.program.instructions)
    for k in range(exchanges + 1):
        for rank, frame in enumerate(frames):
            instructions = frame.layout.program.instructions
            while places[rank] < len(instructions) and isinstance(instructions[places[rank]], Computation):
                compute(frame, instructions[places[rank]])
                places[rank] += 1
            places[rank] += 1
        if k < exchanges:
            exchange_all(frames, k)


@pytest.mark.parametrize("name", METHODS)
@given(n=st.integers(1, 12), samples=st.integers(1, 3), branching=st.integers(1, 3), data=st.data())
def test_all_ranks_programs_together_are_the_method(name, n, samples, branching, data):
    """On chains, trees and blocks: what ranks work out alone, in their own memory, is what all do at once."""
    method = METHODS[name]
    model = Model.random(n, joints=ALL_JOINTS, branching=1 if name == "kogge-stone" else branching)
    ranks = data.draw(st.integers(1, n)) if model.is_serial else n
    forces, gravity = random_load(model, samples)
    q, v, a = model.random_state(samples)
    state = check_state(model, q, v, a, forces)
    scan, _ = solve_locally(method, model, state, gravity)
    torque = joint_torque(model, scan.force)
    counts = even_counts(n, ranks)
    starts = np.concatenate(([0], np.cumsum(counts)))
    nodes = model.parents if ranks == n else ranks
    schedule = method.schedule(nodes) if ranks == n else shifted(method.schedule(nodes))
    frames = []
    for rank in range(ranks):
        bodies = slice(starts[rank], starts[rank + 1])
        fields = {
            name: getattr(model, name)[bodies] for name in ("axes", "rotations", "translations", "masses", "coms")
        }
        parents = np.arange(counts[rank]) - 1
        part = Model(parents, model.joints[bodies], inertias=model.inertias[bodies], **fields)
        block = Block(part, rank, bool(model.parents[starts[rank]] < 0), gravity, axis=True)
        frame = Frame(lay_out(block.record(method, schedule, forces=True, bodies=True)), samples)
        qs, vs = (
            slice(columns[starts[rank]], columns[starts[rank + 1]]) for columns in (model.q_starts, model.v_starts)
        )
        frame.give([q[:, qs], v[:, vs], a[:, vs], forces[:, bodies]])
        frames.append(frame)
    run_all(frames)
    for rank, frame in enumerate(frames):
        found = frame.results(single=False)
        vs = slice(model.v_starts[starts[rank]], model.v_starts[starts[rank + 1]])
        assert close(found["torque"], torque[:, vs], torque)
        bodies = slice(starts[rank], starts[rank + 1])
        for result in ("velocity", "acceleration", "force"):
            whole = getattr(scan, result)
            assert close(found[result].swapaxes(0, 1), whole[bodies], whole)


def messages(names):
    return {"sum": {"x": np.zeros(6)}, "pair": {"c": np.eye(6).ravel(), "x": np.zeros(6)}} | names


def test_what_nobody_needs_is_not_worked_out():
    recorder = MethodRecorder(Schedule(1, ()), {}, 0)
    x, y = recorder.input("x", 6), recorder.input("y", 6)
    add(x, y)
    recorder.constant(np.zeros(6))
    program = recorder.program({"twice": Output(add(x, x), (6,)), "constant": Output(3, ())})
    assert len(program.instructions) == 1
    assert [argument.number is None for argument in program.arguments] == [False, True]
    assert not program.constants
    assert program.outputs["constant"].value == 3


def test_constants_are_never_overwritten():
    """Whatever is worked out, and how often: their memory is theirs."""
    recorder = MethodRecorder(Schedule(1, ()), {}, 0)
    x, one = recorder.input("x", 6), recorder.constant(np.ones(6))
    total = add(one, x)
    for _ in range(5):
        total = add(total, one)
    frame = Frame(lay_out(recorder.program({"total": Output(total, (6,))})), 3)
    for _ in range(2):
        frame.give([np.zeros((3, 6))])
        for instruction in frame.layout.program.instructions:
            compute(frame, instruction)
        assert (frame.results(single=False)["total"] == 6.0).all()


def test_where_nothing_comes_the_own_part_stays():
    assert add(NOTHING, 1) == add(1, NOTHING) == 1
    assert add(NOTHING, NOTHING) is NOTHING
    assert compose(NOTHING, "path") == "path"
    assert product("c", NOTHING) == "c"
    assert push("c", NOTHING, "b") == "b"


def test_messages_of_several_children_add_up():
    nodes = np.array([1, 2, 3]), np.array([0, 0, 0])
    round_ = Round("up", 1, (Transfer("sum", *nodes),))
    recorder = MethodRecorder(Schedule(4, (round_,)), messages({}), 0)
    x = recorder.input("x", 6)
    (came,) = recorder.exchange(round_, x=x)
    frame = Frame(lay_out(recorder.program({"x": Output(add(x, came), (6,))})), 2)
    frame.give([np.ones((2, 6))])
    for instruction in frame.layout.program.instructions:
        if isinstance(instruction, Communication):
            for message in instruction.receives:
                frame.message(message)[:] = 10.0**message.partner
        else:
            compute(frame, instruction)
    assert (frame.results(single=False)["x"] == 1111.0).all()


@given(samples=st.integers(1, 3))
def test_parts_of_a_message_lie_side_by_side(samples):
    """Also where a part is in two messages with different others, and so has to be copied."""
    one, two = np.array([0]), np.array([1])
    rounds = tuple(Round("out", k, (Transfer("pair", one, two),)) for k in (1, 2))
    recorder = MethodRecorder(Schedule(2, rounds), messages({}), 0)
    c, x, y = recorder.input("c", 36), recorder.input("x", 6), recorder.input("y", 6)
    recorder.exchange(rounds[0], c=c, x=x)
    recorder.exchange(rounds[1], c=c, x=y)
    frame = Frame(lay_out(recorder.program({})), samples)
    rng = np.random.default_rng(0)
    arrays = {name: rng.normal(size=(samples, width)) for name, width in (("c", 36), ("x", 6), ("y", 6))}
    frame.give(list(arrays.values()))
    sent = []
    for instruction in frame.layout.program.instructions:
        if isinstance(instruction, Communication):
            sent += [frame.message(message).copy() for message in instruction.sends]
        else:
            compute(frame, instruction)
    for flat, part in zip(sent, ("x", "y"), strict=True):
        assert flat.flags.c_contiguous
        assert np.array_equal(flat, np.concatenate((arrays["c"].ravel(), arrays[part].ravel()))[None])


def test_an_operation_of_several_results_is_recorded_as_well():
    halves = Operation(lambda x: (x[..., :3], x[..., 3:]), 3, 3)
    recorder = MethodRecorder(Schedule(1, ()), {}, 0)
    x = recorder.input("x", 6)
    one, two = halves(x)
    frame = Frame(lay_out(recorder.program({"one": Output(one, (3,)), "two": Output(two, (3, 1))})), 1)
    frame.give([np.arange(6.0)[None]])
    compute(frame, frame.layout.program.instructions[0])
    assert frame.results(single=True)["two"].tolist() == [[3.0], [4.0], [5.0]]
    assert [part.tolist() for part in halves(np.arange(6.0))] == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]


def test_all_that_is_counted_of_a_method_is_what_its_messages_hold():
    """The paper's sizes, and those of the derivation."""
    assert METHODS["kogge-stone"].doubles == {"matrix+vector": 42, "vector": 6}
    assert METHODS["compact"].doubles == {"motion": 24, "force": 6}
    assert METHODS["sweep"].doubles == {"motion": 24, "force": 28}


def test_memory_is_used_again():
    """As many numbers as the registers of a rank would have: none is kept for rounds that are over.

    Of its own a rank has the joint's three numbers, its inertia or what adds nothing, and in the end its motion, force
    and torque.
    """
    for name, numbers in (("sweep", 24 * 3 + 28 * 5 + 3 + 3 * 6), ("kogge-stone", 42 * 4 + 36 * 2 + 24 + 6 * 6 + 3)):
        for rank in (0, 255, 511):
            method = METHODS[name]
            body = Model.uniform(1)
            block = Block(body, rank, rank == 0, np.zeros(3), axis=False)
            layout = lay_out(block.record(method, method.schedule(512)))
            assert sum(layout.slots) <= numbers, (name, rank, layout.slots)
