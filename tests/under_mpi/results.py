"""Every rank gets its body's part of the serial recursion; messages are as many as the schedule says."""

import dataclasses

import numpy as np
from _formation import COMM, RANK, SIZE, Checks, chain_of_all_joints, own_columns, relative_error
from mpi4py import MPI

import mp2a
from mp2a.methods import METHODS

check = Checks()
GRAVITY = (1.0, -2.0, -9.0)

for seed in range(4):
    model = chain_of_all_joints(seed=seed, branching=1 + 2 * (seed % 2))
    for method in METHODS:
        if method == "kogge-stone" and not model.is_serial:
            continue
        with mp2a.DistributedModel(COMM, model, method, gravity=GRAVITY) as formation:
            check(len(formation.part) == 1 and formation.bodies == range(RANK, RANK + 1))
            for samples in (None, 1, 7, 300):
                q, v, a = model.random_state(samples, seed)
                forces = np.random.default_rng(seed).normal(size=(*(() if samples is None else (samples,)), SIZE, 6))
                whole = mp2a.rnea(model, q, v, a, forces, GRAVITY, bodies=True)
                qs, vs = own_columns(model)
                mine = formation.rnea(q[..., qs], v[..., vs], a[..., vs], forces[..., RANK, :], bodies=True)
                for name in ("velocity", "acceleration", "force"):
                    ours, theirs = getattr(mine, name), getattr(whole, name)
                    check(ours.shape == theirs[..., RANK, :].shape, name, ours.shape)
                    check(relative_error(ours, theirs[..., RANK, :], theirs) < 1e-12, name)
                check(
                    np.array_equal(
                        formation.rnea(q[..., qs], v[..., vs], a[..., vs], forces[..., RANK, :]), mine.torque
                    )
                )
                for ours, theirs in zip(mine.placement, mp2a.placements(model, q), strict=True):
                    check(np.allclose(ours, theirs[RANK] if samples is None else theirs[:, RANK], atol=1e-10))
                check(mine.torque.shape == whole.torque[..., vs].shape)
                check(relative_error(mine.torque, whole.torque[..., vs], whole.torque) < 1e-12)
                doubles = METHODS[method].doubles
                count = formation.schedule.count(doubles)
                before = dict(formation.transport.messages), formation.transport.doubles
                formation.rnea(q[..., qs], v[..., vs], a[..., vs])
                for kind in doubles:
                    sent = formation.transport.messages.get(kind, 0) - before[0].get(kind, 0)
                    check(COMM.allreduce(sent) == count.messages.get(kind, 0), kind)
                sent = COMM.allreduce(formation.transport.doubles - before[1])
                check(sent == count.doubles * (samples or 1))

# A model's own gravity, and a model of pinocchio's.
moon = dataclasses.replace(chain_of_all_joints(), gravity=(0.5, 0.0, -1.62))
q, v, a = moon.random_state(2)
qs, vs = own_columns(moon)
for form in (moon, moon.to_pinocchio()):
    with mp2a.DistributedModel(COMM, form, "sweep") as formation:
        whole = mp2a.rnea(form, q, v, a)
        check(relative_error(formation.rnea(q[:, qs], v[:, vs], a[:, vs]), whole[:, vs], whole) < 1e-12)
        check(relative_error(whole, mp2a.rnea(moon, q, v, a, gravity=(0.5, 0.0, -1.62)), whole) < 1e-12)

# "auto" says the same everywhere, and gives the same.
model = chain_of_all_joints()
q, v, a = model.random_state(4)
qs, vs = own_columns(model)
for network in (None, mp2a.EmulatedNetwork(0.02, 54e6), mp2a.EmulatedNetwork(1e-6, 1e12)):
    with mp2a.DistributedModel(COMM, model, samples=4, network=network) as formation:
        check(len(set(COMM.allgather(str(formation.choice)))) == 1)
        check(formation.method == formation.choice.method)
        check(network is None or SIZE == 1 or network.latency < 1e-3 or formation.method == "sweep", formation.choice)
        whole = mp2a.rnea(model, q, v, a)
        check(relative_error(formation.rnea(q[:, qs], v[:, vs], a[:, vs]), whole[:, vs], whole) < 1e-12)

# Without an external force, and one force for all samples.
model = chain_of_all_joints()
q, v, a = model.random_state(4)
qs, vs = own_columns(model)
with mp2a.DistributedModel(COMM, model) as formation:
    whole = mp2a.rnea(model, q, v, a)
    mine = formation.rnea(q[:, qs], v[:, vs], a[:, vs])
    check(relative_error(mine, whole[:, vs], whole) < 1e-12)
    force = np.arange(6.0)
    whole = mp2a.rnea(model, q, v, a, np.tile(force, (SIZE, 1)))
    mine = formation.rnea(q[:, qs], v[:, vs], a[:, vs], force)
    check(relative_error(mine, whole[:, vs], whole) < 1e-12)

# Halves of the ranks, each a formation of its own, and one of all in reverse order, at the same time.
halves = COMM.Split(RANK % 2, RANK)
reverse = COMM.Split(0, -RANK)
# A user who is waiting for anything at all on the same communicator gets nothing of ours.
mail = np.zeros(1)
waiting = COMM.Irecv(mail, MPI.ANY_SOURCE, MPI.ANY_TAG)
formations = [(comm, chain_of_all_joints(comm.size, 5)) for comm in (halves, reverse, COMM)]
made = [mp2a.DistributedModel(comm, model) for comm, model in formations]
for (comm, model), formation in zip(formations, made, strict=True):
    q, v, a = model.random_state(2)
    qs, vs = own_columns(model, comm.rank)
    whole = mp2a.rnea(model, q, v, a)
    mine = formation.rnea(q[:, qs], v[:, vs], a[:, vs])
    check(relative_error(mine, whole[:, vs], whole) < 1e-12)
check(not waiting.Test())
COMM.Barrier()  # nobody sends before everybody has looked
COMM.Send(np.array([float(RANK)]), (RANK + 1) % SIZE, 3)
waiting.Wait()
check(mail[0] == (RANK - 1) % SIZE)
for formation in made:
    formation.close()
    formation.close()
# What joints resist with, and the armatures of their motors, on single bodies, in a tree and in blocks.
for bodies, branching in ((SIZE, 1), (SIZE, 3), (3 * SIZE + 1, 1)):
    model = mp2a.Model.random(bodies, seed=5, joints=chain_of_all_joints().joints, branching=branching)
    numbers = np.random.default_rng(0).random((4, model.nv))
    resisting = dict(zip(("armature", "damping", "friction", "stiffness"), numbers, strict=True))
    model = dataclasses.replace(model, **resisting, rest=model.random_state(seed=8)[0])
    for method in METHODS if model.is_serial else ("compact", "sweep"):
        with mp2a.DistributedModel(COMM, model, method) as formation:
            for samples in (None, 3):
                q, v, a = model.random_state(samples, 5)
                whole = mp2a.rnea(model, q, v, a)
                columns = formation.v_columns
                mine = formation.rnea(q[..., formation.q_columns], v[..., columns], a[..., columns])
                check(relative_error(mine, whole[..., columns], whole) < 1e-12, method, bodies)
check.done()
