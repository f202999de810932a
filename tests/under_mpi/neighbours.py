"""A robot hands numbers to those that hang on it and gets its parent's; every robot is told where it is."""

import numpy as np
from _formation import COMM, RANK, SIZE, Checks, chain_of_all_joints, own_columns

import mp2a
from mp2a.schedule import neighbours

check = Checks()

for branching in (1, 3):
    model = chain_of_all_joints(seed=3, branching=branching)
    with mp2a.DistributedModel(COMM, model, "compact") as formation:
        parent = model.parents[RANK]
        for count in (1, 9, 4):
            told = formation.send_to_children(np.arange(count) + 100.0 * RANK)
            check((told is None) == (parent < 0))
            check(told is None or (told == np.arange(count) + 100.0 * parent).all())
        sends = sum((source == RANK).sum() for _, source, _ in neighbours(model.parents).rounds[0].transfers)
        check(sends == (model.parents == RANK).sum())

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
        scan = formation.rnea(q[qs], v[vs], a[vs])
        check(np.allclose(scan.placement.rotation, rotation[RANK], atol=1e-12))
        check(np.allclose(scan.placement.translation, position[RANK], atol=1e-12))

        last = RANK == SIZE - 1
        errors = []
        for call in (
            lambda: formation.placement(np.full(len(q[qs]), np.nan) if last else q[qs]),  # noqa: B023
            lambda: formation.rnea(q[qs], v[vs], a[vs], wrong=mp2a.InputError("what I know") if last else None),  # noqa: B023
            lambda: formation.placement(many[: 2 if last and SIZE > 1 else 3, qs]),  # noqa: B023
        ):
            try:
                call()
            except mp2a.InputError as error:
                errors.append(str(error))
        check(len(errors) == (3 if SIZE > 1 else 2))
        check(SIZE == 1 or f"3 samples on rank 0 and 2 on rank {SIZE - 1}" in errors[2], errors)
        check(len(set(COMM.allgather(tuple(errors)))) == 1, errors)
        check(errors[1] == f"rank {SIZE - 1}: what I know", errors)
        check(formation.send_to_children(np.ones(1)) is None or parent >= 0)
        try:  # another length on rank 0 is noticed by those that hang on it
            formation.send_to_children(np.ones(3 if RANK == 0 else 2))
            check(parent != 0)
        except mp2a.InputError as error:
            check(parent == 0 and "expected as many" in str(error))
        check(formation.send_to_children([2.0]) is None or parent >= 0)
check.done()
