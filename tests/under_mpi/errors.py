"""A wrong argument on one rank alone raises the same error on every rank, and the formation works on."""

import tempfile
import threading
from pathlib import Path

import numpy as np
from _formation import COMM, RANK, SIZE, Checks, chain_of_all_joints, own_columns, relative_error

import mp2a
from mp2a.methods import METHODS
from mp2a.program import rank as rank_program
from mp2a.program.memory import Frame
from mp2a.program.recorder import Computation

RNEA = "rnea", False, False
check = Checks()


def same_error(words, call, *arguments, **named):
    """Every rank raises the same InputError, and it holds the words expected of it."""
    try:
        call(*arguments, **named)
        text = None
    except mp2a.InputError as error:
        text = str(error)
    texts = COMM.allgather(text)
    check(texts[0] is not None and len(set(texts)) == 1, texts)
    check(all(word in texts[0] for word in words), texts[0])


def on(rank, wrong, right):
    return wrong if rank == RANK else right


model = chain_of_all_joints()
longer, other = mp2a.Model.random(SIZE + 1), chain_of_all_joints(seed=1)
wrong_ranks = sorted({0, SIZE // 2, SIZE - 1})

# Making a formation.
make = mp2a.DistributedModel
for bad in wrong_ranks:
    same_error([f"rank {bad}", "model", "NoneType"], make, COMM, on(bad, None, model))
    same_error([f"rank {bad}", "method", "magic"], make, COMM, model, on(bad, "magic", "kogge-stone"))
    same_error([f"rank {bad}", "gravity: got shape (1,)"], make, COMM, model, gravity=on(bad, [1.0], [0, 0, -9.81]))
    same_error([f"rank {bad}", "counts", "sum"], make, COMM, model, counts=on(bad, [2] * SIZE, [1] * SIZE))
    if SIZE > 1:
        same_error(["model", "same on every rank"], make, COMM, on(bad, longer, model))
        few = on(bad, mp2a.Model.random(SIZE - 1), model)
        same_error([f"rank {bad}", f"{SIZE - 1} bodies", f"{SIZE} ranks"], make, COMM, few)
        same_error(["model", "same on every rank"], make, COMM, on(bad, other, model))
        same_error(["gravity", "same on every rank"], make, COMM, model, gravity=on(bad, (0, 0, -1.0), (0, 0, -2.0)))

# Blocks: counts that are no counts, do not fit, or differ between ranks; more ranks than robots; a tree.
ones = [1] * (SIZE - 1)
for counts in ([*ones, 1], [*ones, 3], [*ones, 0], [*ones, -1], [*ones, 2, 0], [*ones, 1.5], [], 2, ["a"]):
    same_error(["rank 0", "counts: got"], make, COMM, longer, counts=counts)
if SIZE > 1:
    same_error([f"{SIZE - 1} bodies", f"{SIZE} ranks"], make, COMM, mp2a.Model.random(SIZE - 1))
    same_error(["counts", "same on every rank"], make, COMM, longer, counts=on(SIZE - 1, [2, *ones], [*ones, 2]))
branched = mp2a.Model.random(SIZE + 3, branching=3)
same_error(["tree", f"{SIZE + 3} bodies"], make, COMM, branched, "sweep")


# Read from files, of which one rank cannot read its own.
folder = COMM.bcast(tempfile.mkdtemp() if RANK == 0 else None)
kept, missing, spoilt = (str(Path(folder) / name) for name in ("chain.npz", "missing.urdf", "spoilt.urdf"))
if RANK == 0:
    model.save(kept)
    Path(spoilt).write_text("<robot><link")
COMM.Barrier()
with make(COMM, kept, "sweep") as formation:
    torque = formation.rnea(*model.random_state(body=RANK))
    whole = mp2a.rnea(model, *model.random_state())
    check(relative_error(torque, whole[own_columns(model)[1]], whole) < 1e-12)
for bad in wrong_ranks:
    same_error([f"rank {bad}", "missing.urdf", "cannot be read"], make, COMM, on(bad, missing, kept))
    same_error([f"rank {bad}", "spoilt.urdf", "cannot be read"], make, COMM, on(bad, spoilt, kept))


# Calling it.
def calls(formation, model, samples, wrong=(SIZE // 2,), odd_numbers=(1, 3)):
    qs, vs = own_columns(model)
    state = [part[..., columns] for part, columns in zip(model.random_state(samples), (qs, vs, vs), strict=True)]
    whole = mp2a.rnea(model, *model.random_state(samples))
    for bad in wrong:
        for place, name in enumerate("qva"):
            spoilt = [part.copy() for part in state]
            if bad == RANK:
                spoilt[place][..., 0] = np.nan
            same_error([f"rank {bad}", f"{name}: got nan"], formation.rnea, *spoilt)
            cut = [part[..., :0] if bad == RANK and k == place else part for k, part in enumerate(state)]
            same_error([f"rank {bad}", f"{name}: got shape"], formation.rnea, *cut)
        force = on(bad, np.ones(5), np.ones(6))
        same_error([f"rank {bad}", "external_forces", "(5,)"], formation.rnea, *state, force)
        for others in odd_numbers:
            if SIZE > 1 and others != (samples or 1):
                odd = model.random_state(others, body=RANK) if bad == RANK else state
                same_error(["samples", str(others), f"rank {max(bad, 1)}"], formation.rnea, *odd)
    torque = formation.rnea(*state)
    check(relative_error(torque, whole[..., vs], whole) < 1e-12)


tree = chain_of_all_joints(branching=3)
for method in METHODS:
    for formed in (model, tree):
        if method != "kogge-stone" or formed.is_serial:
            with make(COMM, formed, method) as formation:
                calls(formation, formed, 2)
if not tree.is_serial:
    same_error(["tree", "kogge-stone"], make, COMM, tree, "kogge-stone")
with make(COMM, model, "sweep") as formation:
    for samples in (None, 2500):  # and messages that MPI sends in another way than small ones
        calls(formation, model, samples, wrong_ranks, odd_numbers=(2, 4000))
with make(COMM, model, "sweep", network=mp2a.EmulatedNetwork(1e-3, 1e9)) as formation:
    calls(formation, model, 3)

# Whatever goes wrong on one rank, in its arguments or before the call, is raised on all, and the next call works.


class Spoilt:
    """Not an array, and says so in a way of its own."""

    def __array__(self, *_, **__):
        raise LookupError("no numbers here")


def same(kind, words, call, *arguments, **named):
    """Every rank raises the same error of a type, and it holds the words expected of it."""
    try:
        call(*arguments, **named)
        report = None
    except (mp2a.InputError, mp2a.RankError) as error:
        report = type(error), str(error)
    reports = COMM.allgather(report)
    check(reports[0] is not None and len(set(reports)) == 1, reports)
    check(reports[0][0] is kind and all(word in reports[0][1] for word in words), reports[0])


qs, vs = own_columns(model)
q, v, a = model.random_state(body=RANK)
sensor = OSError("no sensor")
for bad in wrong_ranks:
    for given in ("5ms", (1e-3,), 5, {"latency": 1}):
        same(mp2a.InputError, [f"rank {bad}", "network: got"], make, COMM, model, network=on(bad, given, None))
    same(
        mp2a.InputError,
        [f"rank {bad}", "method: got"],
        make,
        COMM,
        model,
        on(bad, np.array(["sweep", "compact"]), "sweep"),
    )
    same(mp2a.InputError, [f"rank {bad}", "comm: got NoneType"], make, on(bad, None, COMM), model)
    same(mp2a.InputError, [f"rank {bad}", "samples"], mp2a.ProcessGrid, COMM, samples=on(bad, 10**30, 8))
    for method in METHODS:
        with make(COMM, model, method) as formation:
            ragged = on(bad, [[1, 2], [3]], q)
            for call in (formation.placement, lambda x: formation.rnea(x, v, a)):
                same(mp2a.InputError, [f"rank {bad}", "q: got"], call, ragged)
                same(mp2a.RankError, [f"rank {bad}", "LookupError", "no numbers here"], call, on(bad, Spoilt(), q))
            for call in (formation.send_to_children, formation.broadcast):
                same(mp2a.InputError, [f"rank {bad}", "values: got nan"], call, on(bad, [np.nan], [1.0]))
                same(mp2a.InputError, [f"rank {bad}", "values"], call, on(bad, [], [1.0]))
                if SIZE > 1:
                    same(mp2a.InputError, ["3"], call, on(bad, [1.0] * 3, [1.0, 2.0]))
            for call, arguments in (
                (formation.rnea, (q, v, a)),
                (formation.placement, (q,)),
                (formation.broadcast, ([1.0],)),
                (formation.send_to_children, ([1.0],)),
            ):

                def prepared(call=call, arguments=arguments, bad=bad, formation=formation, error=sensor):
                    with formation.together(call) as made:
                        if bad == RANK:
                            raise error
                        return made(*arguments)

                same(mp2a.RankError, [f"rank {bad}: OSError: no sensor"], prepared)
                own = mp2a.InputError("what I know")
                same(mp2a.InputError, [f"rank {bad}: what I know"], prepared, error=own)

                def forgotten(call=call, arguments=arguments, bad=bad, formation=formation):
                    with formation.together(call) as made:
                        return None if bad == RANK else made(*arguments)

                same(mp2a.InputError, [f"rank {bad}: together", call.__name__], forgotten)
            for flag in (True, False) if SIZE > 1 else ():
                words = ["bodies", f"rank {max(bad, 1)}"]
                same(mp2a.InputError, words, formation.rnea, q, v, a, bodies=on(bad, flag, not flag))
            whole = mp2a.rnea(model, *model.random_state())
            check(relative_error(formation.rnea(q, v, a), whole[vs], whole) < 1e-12)

# Memory that is not there, on one rank: at the beginning of a call of many samples, and in the middle of one of blocks.


def fails(*_, **__):
    raise MemoryError("none left")


def no_frame(layout, samples):
    return fails() if samples == 4000 else Frame(layout, samples)


blocks = mp2a.Model.random(3 * SIZE)
for method in METHODS:
    with make(COMM, model, method) as formation:
        many = model.random_state(4000, body=RANK)
        for bad in wrong_ranks:
            formation.rnea(q, v, a)
            rank_program.Frame = on(bad, no_frame, Frame)
            same(mp2a.RankError, [f"rank {bad}: MemoryError: none left"], formation.rnea, *many)
            rank_program.Frame = Frame
        check(relative_error(formation.rnea(*many), mp2a.rnea(model, *model.random_state(4000))[:, vs], many[1]) < 1e-9)
    with make(COMM, blocks, method) as formation:
        many = [x[:, 3 * RANK : 3 * RANK + 3] for x in blocks.random_state(4000)]
        program = formation._calls.program(RNEA)
        steps = [x.operation for x in program.layout.program.instructions if isinstance(x, Computation)]
        alone = [operation for operation in steps if operation.step is None]
        for bad in wrong_ranks:
            for operation in (alone[0], alone[-1]):
                function, operation.function = operation.function, on(bad, fails, operation.function)
                same(mp2a.RankError, [f"rank {bad}: MemoryError: none left"], formation.rnea, *many)
                operation.function = function
        torque = mp2a.rnea(blocks, *blocks.random_state(4000))
        check(relative_error(formation.rnea(*many), torque[:, 3 * RANK : 3 * RANK + 3], torque) < 1e-9)

# Numbers to hand on in the shape of one row or one number, after calls that had as many of them.
with make(COMM, model, "sweep") as formation:
    for call in (formation.broadcast, formation.send_to_children):
        call(np.ones(1))
        for bad in wrong_ranks:
            same_error([f"rank {bad}", "values", "shape ()"], call, on(bad, np.array(1.0), np.ones(1)))
with make(COMM, blocks, "sweep") as formation:
    formation.send_to_children(np.ones((3, 4)))
    for bad in wrong_ranks:
        same_error(
            [f"rank {bad}", "values", "shape (4,)"], formation.send_to_children, on(bad, np.ones(4), np.ones((3, 4)))
        )

# Another thread, a closed formation, a call that was broken off.
formation = make(COMM, model, "sweep")
reports = []


def call_it():
    try:
        formation.rnea(q, v, a)
    except mp2a.RankError as error:
        reports.append(str(error))


thread = threading.Thread(target=call_it)
thread.start()
thread.join()
check(len(reports) == 1 and "another thread" in reports[0], reports)
check(relative_error(formation.rnea(q, v, a), whole[vs], whole) < 1e-12)
formation.close()
try:
    formation.rnea(q, v, a)
    check(False)
except mp2a.RankError as error:
    check("closed" in str(error))
formation = make(COMM, model, "sweep")
formation.rnea(q, v, a)


def interrupted(*_):
    raise KeyboardInterrupt


formation._calls.program(RNEA).run = interrupted
try:
    formation.rnea(q, v, a)
    check(False)
except KeyboardInterrupt:
    check(formation._calls.program(RNEA).compiled is None)
try:
    formation.rnea(q, v, a)
    check(False)
except mp2a.RankError as error:
    check("broken off" in str(error))
formation.close()

# No unit quaternion, and no unit cosine and sine, on the ranks that have some.
for rank, joint in enumerate(model.joints):
    if joint in ("spherical", "free", "planar", "continuous"):
        with make(COMM, model) as formation:
            q, v, a = model.random_state(None, body=RANK)
            same_error([f"rank {rank}", "length"], formation.rnea, on(rank, 2 * q, q), v, a)
check.done()
