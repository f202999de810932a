"""The relay, in one piece and in blocks, and the centre give what the serial recursion gives."""

from _formation import COMM, RANK, Checks, chain_of_all_joints, own_columns, relative_error

import mp2a
from mp2a.bench.opponents import Centre, Relay
from mp2a.reference import Reference

check = Checks()
for seed in range(3):
    chain = chain_of_all_joints(seed=seed)
    reference = Reference(chain) if RANK == 0 else None
    contenders = [Relay(COMM, chain), Relay(COMM, chain, blocks=4), Centre(COMM, chain, reference)]
    qs, vs = own_columns(chain)
    for samples in (1, 3, 50):
        q, v, a = chain.random_state(samples, seed)
        whole = mp2a.rnea(chain, q, v, a)
        for contender in contenders:
            torque = contender.rnea(q[:, qs], v[:, vs], a[:, vs])
            check(torque.shape == (samples, chain.body(RANK).nv))
            check(relative_error(torque, whole[:, vs], whole) < 1e-12, type(contender).__name__)
check.done()
