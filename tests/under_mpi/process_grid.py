"""Ranks in two directions get what one process gets; wrong arguments are refused on every rank alike."""

import numpy as np
from _formation import COMM, RANK, SIZE, Checks, chain_of_all_joints, relative_error

import mp2a
from mp2a.process_grid import ranks_per_chain

check = Checks()
SAMPLES = 2 * SIZE + 1

for along in (None, *(k for k in range(1, SIZE + 1) if SIZE % k == 0)):
    model = chain_of_all_joints(SIZE + 3)
    q, v, a = model.random_state(SAMPLES, 1)
    whole = mp2a.rnea(model, q, v, a)
    with mp2a.ProcessGrid(COMM, along, samples=SAMPLES) as table:
        check(table.rows * table.chain_comm.Get_size() == SIZE)
        check(along is None or table.chain_comm.Get_size() == along)
        with mp2a.DistributedModel(table.chain_comm, model) as part:
            qs, vs, mine = part.q_columns, part.v_columns, table.local_slice
            torque = part.rnea(q[mine, qs], v[mine, vs], a[mine, vs])
            check(relative_error(torque, whole[mine, vs], whole) < 1e-12, along)
            done = np.zeros_like(whole)
            done[mine, vs] = 1.0
            check((COMM.allreduce(done) == 1.0).all(), along)  # nothing is left out and nothing done twice
    table.close()

check(ranks_per_chain(SIZE, 8 * SIZE) == 1)
check(ranks_per_chain(SIZE, 1) == SIZE)

for arguments, text in (
    ((SIZE + 1, SAMPLES), f"chain_ranks: got {SIZE + 1} for {SIZE} ranks"),
    ((0, SAMPLES), "chain_ranks: got 0"),
    ((1, 0), "samples: got 0"),
    *([((1, SIZE - 1), f"samples: got {SIZE - 1} for {SIZE} rows")] if SIZE > 1 else []),
    *([((1, SAMPLES + RANK), "differ between ranks")] if SIZE > 1 else []),
    *([((1 if RANK else SIZE + 1, SAMPLES), "rank 0: chain_ranks")] if SIZE > 1 else []),
):
    try:
        mp2a.ProcessGrid(COMM, arguments[0], samples=arguments[1])
    except mp2a.InputError as error:
        check(text in str(error), error)
    else:
        check(False, "no error", text)

check.done()
