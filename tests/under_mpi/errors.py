"""A wrong argument on one rank alone raises the same error on every rank, and the formation works on."""

import tempfile
from pathlib import Path

import numpy as np
from _formation import COMM, RANK, SIZE, Checks, chain_of_all_joints, own_columns, relative_error

import mp2a
from mp2a.methods import METHODS

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
    torque = formation.rnea(*model.random_state(body=RANK)).torque
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
    torque = formation.rnea(*state).torque
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

# No unit quaternion, and no unit cosine and sine, on the ranks that have some.
for rank, joint in enumerate(model.joints):
    if joint in ("spherical", "free", "planar", "continuous"):
        with make(COMM, model) as formation:
            q, v, a = model.random_state(None, body=RANK)
            same_error([f"rank {rank}", "length"], formation.rnea, on(rank, 2 * q, q), v, a)
check.done()
