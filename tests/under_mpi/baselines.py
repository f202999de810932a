"""The pipeline, in one piece and in blocks, and gather and scatter give what the serial recursion gives."""

from _formation import COMM, RANK, Checks, chain_of_all_joints, own_columns, relative_error

import mp2a
from mp2a.bench.gather_scatter import GatherScatter
from mp2a.bench.pipeline import Pipeline
from mp2a.reference import Reference
from mp2a.transport.link import MPILink, make_link

check = Checks()
for seed in range(3):
    model = chain_of_all_joints(seed=seed)
    reference = Reference(model) if RANK == 0 else None
    contenders = []
    for link in (MPILink(COMM), make_link(COMM, mp2a.EmulatedNetwork(1e-3, 1e9))):
        contenders += [Pipeline(link, model), Pipeline(link, model, blocks=4)]
        contenders += [GatherScatter(link, model, reference), GatherScatter(link, model, reference, tree=True)]
    qs, vs = own_columns(model)
    for samples in (1, 3, 50):
        q, v, a = model.random_state(samples, seed)
        whole = mp2a.rnea(model, q, v, a)
        for contender in contenders:
            torque = contender.rnea(q[:, qs], v[:, vs], a[:, vs])
            check(torque.shape == (samples, model.body(RANK).nv))
            check(relative_error(torque, whole[:, vs], whole) < 1e-12, type(contender).__name__)
check.done()
