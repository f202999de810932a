"""Shared by the programs of this folder."""

import numpy as np
from mpi4py import MPI

import mp2a
from mp2a.joints import JOINTS

COMM = MPI.COMM_WORLD
RANK, SIZE = COMM.rank, COMM.size


class Checks:
    """Counts checks and says at the end how many there were."""

    count = 0

    def __call__(self, passed, *about):
        self.count += 1
        assert passed, about

    def done(self):
        counts = COMM.allgather(self.count)
        if RANK == 0:
            print(f"checks: {min(counts)}", flush=True)


def chain_of_all_joints(n=SIZE, seed=0, branching=1):
    """Joint types in turn, so that eight ranks see every one of them."""
    kinds = list(JOINTS)
    mixed = mp2a.Model.random(n, seed, branching=branching)
    fields = {name: getattr(mixed, name) for name in mixed.__dataclass_fields__}
    return mp2a.Model(**fields | {"joints": tuple(kinds[(i + seed) % len(kinds)] for i in range(n))})


def own_columns(model, rank=RANK):
    q = slice(model.q_starts[rank], model.q_starts[rank + 1])
    v = slice(model.v_starts[rank], model.v_starts[rank + 1])
    return q, v


def relative_error(ours, theirs, whole):
    return np.abs(ours - theirs).max() / np.abs(whole).max()
