"""Robots hand numbers to those that hang on them, the first one tells all, and every robot learns where it is."""

import numpy as np
from _formation import COMM, RANK, Checks, chain_of_all_joints, own_columns

import mp2a
from mp2a.schedule import broadcast, parent_to_child

check = Checks()


def ancestors(parents, body):
    """A body, its parent, and so on to the base."""
    while body >= 0:
        yield body
        body = parents[body]


for branching in (1, 3):
    model = chain_of_all_joints(seed=3, branching=branching)
    with mp2a.DistributedModel(COMM, model, "compact") as formation:
        parent = model.parents[RANK]
        root = next(i for i in ancestors(model.parents, RANK) if model.parents[i] < 0)
        for count in (1, 9, 4):
            own = np.arange(count) + 100.0 * RANK
            came = formation.send_to_children(own)
            check(np.array_equal(came, np.arange(count) + 100.0 * parent if parent >= 0 else np.zeros(count)))
            check(np.array_equal(formation.broadcast(own), np.arange(count) + 100.0 * root))
        for schedule, name in ((parent_to_child, "send_to_children"), (broadcast, "broadcast")):
            transfers = [transfer for round_ in schedule(model.parents).rounds for transfer in round_.transfers]
            sent = formation._calls.program((name,)).transport.messages
            check(sum(sent.values()) == 3 * sum((source == RANK).sum() for _, source, _ in transfers))

        q, v, a = model.random_state(seed=3)
        qs, vs = own_columns(model)
        rotation, position = mp2a.placements(model, q)
        mine = formation.placement(q[qs])
        check(np.allclose(mine[0], rotation[RANK], atol=1e-12) and np.allclose(mine[1], position[RANK], atol=1e-12))
        many = np.stack([model.random_state(seed=k)[0] for k in range(3)])
        rotation_of, position_of = mp2a.placements(model, many)
        mine = formation.placement(many[:, qs])
        check(np.allclose(mine[0], rotation_of[:, RANK], atol=1e-12))
        check(np.allclose(mine[1], position_of[:, RANK], atol=1e-12))
        scan = formation.rnea(q[qs], v[vs], a[vs], bodies=True)
        check(np.allclose(scan.placement.rotation, rotation[RANK], atol=1e-12))
        check(np.allclose(scan.placement.translation, position[RANK], atol=1e-12))
check.done()
