"""One rank, one robot: mp2a run -n 8 examples/formation.py."""

from mpi4py import MPI

import mp2a

comm = MPI.COMM_WORLD
model = mp2a.Model.uniform(comm.size, axis=(0, 1, 0))  # a row of rods, each hinged to the one before
with mp2a.DistributedModel(comm, model) as formation:
    mine = formation.rnea(q=[0.1], v=[0.2], a=[0.0], bodies=True)

lines = comm.gather(
    f"robot {comm.rank + 1}: torque {mine.torque[0]:9.3f} N m, speed of its origin {abs(mine.velocity[5]):.3f} m/s"
)
if lines is not None:
    print("\n".join(lines))
