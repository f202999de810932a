"""A wrong argument on one rank alone raises the same error on every rank, and the formation works on."""

import numpy as np
from _formation import COMM, RANK, SIZE, Checks, chain_of_all_joints, own_columns, relative_error

import mp2a

check = Checks()


def same_error(call, *expected):
    """Every rank raises the same InputError, which says what is expected of it."""
    try:
        call()
        text = None
    except mp2a.InputError as error:
        text = str(error)
    texts = COMM.allgather(text)
    check(texts[0] is not None and len(set(texts)) == 1, texts)
    check(all(word in texts[0] for word in expected), texts[0])


chain = chain_of_all_joints()
wrong_ranks = sorted({0, SIZE // 2, SIZE - 1})


def on(rank, wrong, right):
    return wrong if rank == RANK else right


# Making a formation.
for bad in wrong_ranks:
    same_error(lambda: mp2a.DistributedChain(COMM, on(bad, None, chain)), f"rank {bad}", "chain", "NoneType")
    same_error(lambda: mp2a.DistributedChain(COMM, chain, on(bad, "magic", "kogge-stone")), f"rank {bad}", "magic")
    same_error(lambda: mp2a.DistributedChain(COMM, chain, gravity=on(bad, [1.0], [0, 0, -9.81])), "gravity", "[1.0]")
    larger = mp2a.Chain.random(SIZE + 1)
    same_error(lambda: mp2a.DistributedChain(COMM, on(bad, larger, chain)), f"{SIZE + 1} bodies", f"{SIZE} ranks")
    if SIZE > 1:
        other = chain_of_all_joints(seed=1)
        same_error(lambda: mp2a.DistributedChain(COMM, on(bad, other, chain)), "chain", "same on every rank")
        fields = {"gravity": on(bad, (0, 0, -1.0), (0, 0, -9.81))}
        same_error(lambda: mp2a.DistributedChain(COMM, chain, **fields), "gravity", "same on every rank")
same_error(lambda: mp2a.DistributedChain(COMM, mp2a.Chain.random(SIZE + 3)), f"{SIZE + 3} bodies")

# Calling it.
qs, vs = own_columns(chain)
with mp2a.DistributedChain(COMM, chain) as formation:
    for samples in (None, 3, 2500):
        state = [part[..., columns] for part, columns in zip(chain.random_state(samples), (qs, vs, vs), strict=True)]
        whole = mp2a.rnea(chain, *chain.random_state(samples))
        for bad in wrong_ranks:
            for place, name in enumerate("qva"):
                spoilt = [part.copy() for part in state]
                if bad == RANK:
                    spoilt[place][..., 0] = np.nan
                same_error(lambda spoilt=spoilt: formation.rnea(*spoilt), f"rank {bad}", f"{name}: got nan")
                cut = [part[..., :0] if bad == RANK and k == place else part for k, part in enumerate(state)]
                same_error(lambda cut=cut: formation.rnea(*cut), f"rank {bad}", f"{name}: got shape")
            force = on(bad, np.ones(5), np.ones(6))
            same_error(lambda force=force: formation.rnea(*state, force), f"rank {bad}", "external_force", "(5,)")
            if SIZE > 1:
                for others in (1, 2, 5000):
                    if others != (samples or 1):
                        odd = chain.random_state(others, body=RANK) if bad == RANK else state
                        same_error(lambda odd=odd: formation.rnea(*odd), "samples", str(others), f"rank {max(bad, 1)}")
        torque = formation.rnea(*state).torque
        check(relative_error(torque, whole[..., vs], whole) < 1e-12)

# No unit quaternion, and no unit cosine and sine, on the ranks that have some.
for rank, joint in enumerate(chain.joints):
    if joint in ("spherical", "free", "planar", "continuous"):
        with mp2a.DistributedChain(COMM, chain) as formation:
            q, v, a = chain.random_state(None, body=RANK)
            same_error(lambda q=q, v=v, a=a, r=rank: formation.rnea(on(r, 2 * q, q), v, a), f"rank {rank}", "length")
check.done()
