"""Inverse dynamics by MPI_Scan gives what the serial recursion gives, in the algorithm that was asked for."""

import numpy as np
from _formation import COMM, RANK, SIZE, Checks, own_columns, relative_error
from mpi4py import MPI

import mp2a
from mp2a.bench import mpi_scan
from mp2a.exceptions import DependencyError


def operations(comm):
    """How often ranks join two numbers in a scan, all together."""
    count = 0

    def add(a, b, _):
        nonlocal count
        count += 1
        np.frombuffer(b, dtype=float)[...] += np.frombuffer(a, dtype=float)

    adding = MPI.Op.Create(add, commute=False)
    total = np.empty(1)
    comm.Scan(np.ones(1), total, adding)
    adding.Free()
    check(total[0] == RANK + 1)
    return COMM.allreduce(count)


check = Checks()
try:
    library = mpi_scan.obtain_library(COMM)
except DependencyError as error:
    check("mpicc" in str(error), error)
    library = None
if library is not None:
    model = mp2a.Model.random(SIZE, 1)
    _, column = own_columns(model)
    ways = (False, True) if mpi_scan.can_double(library) else (False,)
    for doubling in ways:
        scan = mpi_scan.MPIScan(COMM, model, library, doubling=doubling)
        for samples in (1, 50, 3):
            q, v, a = model.random_state(samples, 2)
            whole = mp2a.rnea(model, q, v, a)
            torque = scan.rnea(*(np.ascontiguousarray(x[:, column]) for x in (q, v, a)))
            check(relative_error(torque, whole[:, column], whole) < 1e-12)
        scan.close()
    if len(ways) == 2:
        with mpi_scan.scans_by_doubling(library):
            doubled = COMM.Dup()
        plain = COMM.Dup()
        # One rank after another, each but the first joins once; doubling takes fewer rounds and joins more often.
        check(operations(plain) == SIZE - 1)
        check(operations(doubled) > SIZE - 1 or SIZE <= 2)
        for comm in (plain, doubled):
            comm.Free()
check.done()
