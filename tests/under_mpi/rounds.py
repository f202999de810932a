"""Recorded rounds do what interpreted ones do, with the same messages, and go on after what does not fit."""

import ctypes
import pickle

import numpy as np
from _formation import COMM, RANK, SIZE, Checks, chain_of_all_joints, own_columns, relative_error
from mpi4py import MPI

import mp2a
from mp2a import kernels
from mp2a.kernels import replay_plan
from mp2a.methods import METHODS
from mp2a.methods.block import Block
from mp2a.program import rank as rank_program
from mp2a.program.rank import Given, RankProgram
from mp2a.transport.link import MPILink
from mp2a.transport.mpi import MPITransport

check = Checks()
compiled = kernels.status().compiled
FORMATIONS = [(m, b) for m in METHODS for b in (1, 3) if m != "kogge-stone" or b == 1]


RNEA = "rnea", False, False


def torques(formation, state):
    return [formation.rnea(*(part[t] for part in state)) for t in range(len(state[0]))]


def is_compiled(formation):
    """Whether the last call was one of compiled code, which is kept for the next one."""
    program = formation._calls.program(RNEA).compiled
    return program is not None and len(program._pieces) == 1


def times_compiled(formation):
    """How often calls with as many samples as the last one went by compiled code, as nothing else tells."""
    program = formation._calls.program(RNEA).compiled
    return 0 if program is None else program._tally.times


for method, branching in FORMATIONS:
    model = chain_of_all_joints(seed=branching, branching=branching)
    if method == "kogge-stone" and not model.is_serial:
        continue
    state = model.random_state(4, body=RANK)
    named = {"gravity": (1.0, 2.0, 3.0)}
    with mp2a.DistributedModel(COMM, model, method, **named) as recorded:
        with mp2a.DistributedModel(COMM, model, method, **named, trace=True) as traced:
            whole = mp2a.rnea(model, *model.random_state(4), gravity=(1.0, 2.0, 3.0))
            pairs = list(zip(torques(recorded, state), torques(traced, state), strict=True))
            check(times_compiled(recorded) == len(pairs) * compiled)
            for ours, theirs in pairs:
                check(np.abs(ours - theirs).max() <= 1e-13 * np.abs(whole).max(), method)
            one, other = recorded.transport, traced.transport
            check((one.messages, one.doubles) == (other.messages, other.doubles))
            check(not is_compiled(traced) or SIZE == 1)
            check(is_compiled(recorded) == compiled)
        # What a call returns stays as it is when the next one runs.
        first = recorded.rnea(*(part[0] for part in state), bodies=True)
        parts = (first.velocity, first.acceleration, first.force, first.torque, *first.placement)
        kept = [x.copy() for x in parts]
        # Arrays of any make: lists, views, whole numbers, and what came by pickle, whose dtype is another object.
        for make in (np.ndarray.tolist, lambda x: np.repeat(x, 2)[::2], lambda x: pickle.loads(pickle.dumps(x))):
            again = recorded.rnea(*(make(part[0]) for part in state))
            check(np.array_equal(again, first.torque), make)
        recorded.rnea(*(part[1] for part in state), bodies=True)
        check(all(np.array_equal(a, b) for a, b in zip(parts, kept, strict=True)))

# Many samples: compiled as well, and not kept where that would take too much of the machine's memory.
model = chain_of_all_joints()
with mp2a.DistributedModel(COMM, model, "sweep") as formation:
    for samples, kept in ((1, compiled), (5000, compiled), (1, compiled)):
        torque = formation.rnea(*model.random_state(samples, body=RANK))
        check(is_compiled(formation) == kept, samples)
    limit, rank_program._KEPT = rank_program._KEPT, 1 << 20
    again = formation.rnea(*model.random_state(samples, body=RANK))
    check(np.array_equal(torque, again) and is_compiled(formation) == compiled)
    formation.rnea(*model.random_state(5000, body=RANK))
    check(not is_compiled(formation))
    rank_program._KEPT = limit

# An angle beyond what compiled sines are for, on one rank.
turning = mp2a.Model.uniform(SIZE)
q, v, a = turning.random_state()
q[-1] = 3e7
with mp2a.DistributedModel(COMM, turning, "sweep") as formation:
    for _ in range(2):
        own = [np.ascontiguousarray(x[RANK : RANK + 1]) for x in (q, v, a)]
        check(relative_error(formation.rnea(*own), mp2a.rnea(turning, q, v, a)[RANK], v) < 1e-12)
        check(
            relative_error(formation.rnea(own[0] % 1.0, own[1], own[2]), mp2a.rnea(turning, q % 1.0, v, a)[RANK], v)
            < 1e-12
        )

# Ranks that run compiled rounds and ranks that cannot understand each other.
real = kernels.rounds
if RANK % 2:
    kernels.rounds = lambda: None
qs, vs = own_columns(model)
whole = mp2a.rnea(model, *model.random_state())
for method in METHODS:
    with mp2a.DistributedModel(COMM, model, method) as formation:
        for _ in range(3):
            check(relative_error(formation.rnea(*model.random_state(body=RANK)), whole[vs], whole) < 1e-12)
        check(is_compiled(formation) == (compiled and not RANK % 2))
kernels.rounds = real

# An interpreter whose objects have another form has the same program called by ctypes.
usual = replay_plan.is_usual
replay_plan.is_usual = lambda: False
with mp2a.DistributedModel(COMM, model, "sweep") as formation:
    for samples in (None, 5):
        whole = mp2a.rnea(model, *model.random_state(samples))
        for _ in range(2):
            torque = formation.rnea(*model.random_state(samples, body=RANK))
            check(torque.shape == whole[..., vs].shape and relative_error(torque, whole[..., vs], whole) < 1e-12)
        check(times_compiled(formation) == 2 * compiled)
replay_plan.is_usual = usual

# An input that is wrong on one rank, at first and later; the others record or have recorded.
for method in METHODS:
    for bad in sorted({0, SIZE - 1}):
        with mp2a.DistributedModel(COMM, model, method) as formation:
            for samples in (None, 2):
                state, whole = model.random_state(samples, body=RANK), mp2a.rnea(model, *model.random_state(samples))
                wrong = [part + (np.nan if bad == RANK else 0.0) for part in state]
                for _ in range(2):
                    try:
                        formation.rnea(*wrong)
                        check(False)
                    except mp2a.InputError as error:
                        check(f"rank {bad}" in str(error))
                torque = formation.rnea(*state)
                check(relative_error(torque, whole[..., vs], whole) < 1e-12, method, bad, samples)

# An error of MPI in the middle of recorded rounds is raised; it does not crash and is not lost.
if compiled and SIZE > 1:
    comm = COMM.Dup()
    method = METHODS["sweep"]
    block = Block(model.body(RANK), RANK, RANK == 0, np.zeros(3), axis=False)
    program = RankProgram("rnea", block.record(method, method.schedule(SIZE)), MPITransport(MPILink(comm)))
    state = model.random_state(body=RANK)
    given = Given([x[None] for x in state], 1, True, lambda: None)
    program.run(state, lambda *_: given)
    steps = program.compiled.steps[program.compiled.steps[:, 0] == kernels.STEPS.index("start")]
    null = ctypes.string_at(MPI._addressof(MPI.REQUEST_NULL), MPI._sizeof(MPI.Request))
    ctypes.memmove(int(steps[0, 2]), null, len(null))
    try:
        program.run(state, lambda *_: given)
        check(False)
    except MPI.Exception as error:
        check(error.Get_error_class() == MPI.ERR_REQUEST)
check.done()
