"""Ranks that hold several bodies get what the serial recursion gives for them; messages are those of the schedule."""

import numpy as np
from _formation import COMM, RANK, SIZE, Checks, chain_of_all_joints, relative_error

import mp2a
from mp2a.methods import METHODS, block
from mp2a.schedule import SHIFT, TAIL

check = Checks()
GRAVITY = (1.0, -2.0, -9.0)


def columns(model, bodies):
    """Columns of q and of v that belong to consecutive bodies."""
    return (slice(starts[bodies.start], starts[bodies.stop]) for starts in (model.q_starts, model.v_starts))


def agrees(formation, model, samples, seed, *, loaded=True):
    """Every number of every body, and every message."""
    q, v, a = model.random_state(samples, seed)
    lead = () if samples is None else (samples,)
    forces = np.random.default_rng(seed).normal(size=(*lead, len(model), 6)) if loaded else None
    whole = mp2a.rnea(model, q, v, a, forces, GRAVITY, bodies=True)
    bodies = formation.bodies
    own = slice(bodies.start, bodies.stop)
    qs, vs = columns(model, bodies)
    before = dict(formation.transport.messages), formation.transport.doubles
    external = forces[..., own, :] if loaded else None
    mine = formation.rnea(q[..., qs], v[..., vs], a[..., vs], external, bodies=True)
    for name in ("velocity", "acceleration", "force"):
        ours, theirs = getattr(mine, name), getattr(whole, name)
        check(ours.shape == (*lead, len(bodies), 6), name, ours.shape)
        check(relative_error(ours, theirs[..., own, :], theirs) < 1e-12, name, formation.method)
    check(mine.torque.shape == whole.torque[..., vs].shape)
    check(relative_error(mine.torque, whole.torque[..., vs], whole.torque) < 1e-12, formation.method)
    place = mp2a.placements(model, q)
    for ours, theirs in zip(mine.placement, place, strict=True):
        part = np.moveaxis(np.moveaxis(theirs, len(lead), 0)[own], 0, len(lead))
        check(ours.shape == part.shape and np.allclose(ours, part, atol=1e-10), formation.method)
    doubles = METHODS[formation.method].doubles | block.DOUBLES
    count = formation.schedule.count(doubles)
    for kind in doubles:
        sent = formation.transport.messages.get(kind, 0) - before[0].get(kind, 0)
        check(COMM.allreduce(sent) == count.messages.get(kind, 0), kind)
    check(COMM.allreduce(formation.transport.doubles - before[1]) == count.doubles * (samples or 1))


rng = np.random.default_rng(7)
for seed in range(3):
    counts = rng.integers(1, 6, SIZE)
    counts[rng.integers(SIZE)] = 1
    counts[rng.integers(SIZE)] += 1
    model = chain_of_all_joints(int(counts.sum()), seed)
    for method in METHODS:
        named = {"counts": counts.tolist(), "gravity": GRAVITY, "trace": seed == 2}
        with mp2a.DistributedModel(COMM, model, method, **named) as formation:
            check(COMM.allgather(len(formation.bodies)) == counts.tolist())
            check([i for part in COMM.allgather(formation.bodies) for i in part] == list(range(len(model))))
            check(formation.part.joints == tuple(model.joints[i] for i in formation.bodies))
            for samples in (None, 1, 5):
                agrees(formation, model, samples, seed, loaded=samples != 1)
            check((formation.transport.messages.get(TAIL, 0) > 0) == (RANK < SIZE - 1))

# Large batches, an emulated network, and even blocks by default.
model = chain_of_all_joints(3 * SIZE + SIZE // 2, 11)
for method in METHODS:
    with mp2a.DistributedModel(COMM, model, method, GRAVITY) as formation:
        sizes = COMM.allgather(len(formation.bodies))
        check(max(sizes) - min(sizes) <= 1 and sum(sizes) == len(model) and sizes == sorted(sizes, reverse=True))
        agrees(formation, model, 900, 3)  # as many as are not recorded
with mp2a.DistributedModel(COMM, model, gravity=GRAVITY, network=mp2a.EmulatedNetwork(1e-3, 1e9)) as formation:
    agrees(formation, model, 2, 4)

# What is behind a block is known to its own digits, however much the block itself presses on its head.
model = chain_of_all_joints(3 * SIZE, 2)
fields = {name: getattr(model, name) for name in model.__dataclass_fields__}
model = mp2a.Model(
    **fields | {"masses": np.where(np.arange(3 * SIZE) == 0, 1e9, 1e-3), "inertias": 1e-3 * model.inertias}
)
whole = mp2a.rnea(model, *model.random_state(), bodies=True)
for method in METHODS:
    with mp2a.DistributedModel(COMM, model, method) as formation:
        qs, vs = columns(model, formation.bodies)
        q, v, a = model.random_state()
        force = formation.rnea(q[qs], v[vs], a[vs], bodies=True).force
        light = slice(1 if RANK == 0 else 0, None)
        theirs = whole.force[formation.bodies.start : formation.bodies.stop]
        check(relative_error(force[light], theirs[light], theirs[light]) < 1e-11, method)

# One body each, said or not, is the case without blocks: the same schedule, the same messages.
model = chain_of_all_joints()
for counts in (None, [1] * SIZE, np.ones(SIZE)):
    with mp2a.DistributedModel(COMM, model, "sweep", counts=counts) as formation:
        check(not formation.schedule.recurrence(SHIFT))
        check(str(formation.schedule) == str(METHODS["sweep"].schedule(SIZE)))
        check(formation.rnea(*model.random_state(body=RANK), bodies=True).velocity.shape == (6,))
        check(TAIL not in formation.transport.messages)

# A wrong input of one rank, in a chain of blocks.
model = chain_of_all_joints(2 * SIZE + 1, 5)
for method in METHODS:
    with mp2a.DistributedModel(COMM, model, method, GRAVITY) as formation:
        qs, vs = columns(model, formation.bodies)
        for bad in {SIZE // 2}:
            q, v, a = model.random_state(2)
            state = [q[:, qs], v[:, vs], a[:, vs]]
            wrong_force = np.zeros((len(formation.bodies) + (bad == RANK), 6))
            spoilt = [part + np.nan if bad == RANK else part for part in state]
            odd = [part[:1] if bad == RANK else part for part in state]
            cases = [(spoilt, None, f"rank {bad}"), (state, wrong_force, "external_forces")]
            for arguments, force, word in cases + [(odd, None, "samples")] * (SIZE > 1):
                try:
                    formation.rnea(*arguments, force)
                    texts = [None]
                except mp2a.InputError as error:
                    texts = COMM.allgather(str(error))
                check(len(set(texts)) == 1 and texts[0] is not None and word in texts[0], texts)
            agrees(formation, model, 2, 6)

# Where the bodies are, and what they hand on, from block to block.
for seed in range(2):
    counts = rng.integers(1, 5, SIZE)
    counts[-1] += counts.sum() == SIZE
    model = chain_of_all_joints(int(counts.sum()), seed)
    with mp2a.DistributedModel(COMM, model, counts=counts.tolist()) as formation:
        qs, _ = columns(model, formation.bodies)
        own = slice(formation.bodies.start, formation.bodies.stop)
        for samples in (None, 3):
            q, _, _ = model.random_state(samples, seed)
            for mine, whole in zip(formation.placement(q[..., qs]), mp2a.placements(model, q), strict=True):
                theirs = whole[own] if samples is None else whole[:, own]
                check(mine.shape == theirs.shape and np.allclose(mine, theirs, atol=1e-10))
        numbers = np.arange(5.0) + 10.0 * np.arange(len(model))[:, None]
        came = formation.send_to_children(numbers[own])
        check(np.array_equal(came, np.concatenate((np.zeros((1, 5)), numbers))[own]))
        check(np.array_equal(formation.broadcast([3.0, RANK]), [3.0, 0.0]))
check.done()
