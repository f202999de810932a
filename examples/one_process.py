"""A chain of 64 robots in one process: what its inverse dynamics takes by pinocchio, by mp2a, and by messages.

Each is called once before the clock runs, for a first call loads or builds what the later ones use; then they take
turns, so that whatever else the machine does falls on all alike, and the median is shown. pinocchio has its best form:
a compiled loop over the samples of a call, in one thread as all here.
"""

import statistics
import time

import numpy as np
import pinocchio

import mp2a
from mp2a.algebra.affine import DOUBLES
from mp2a.schedule import kogge_stone

N, SAMPLES, TURNS = 64, 256, 15
model = mp2a.Model.random(N, seed=0)
q, v, a = model.random_state(SAMPLES, seed=0)
columns = [np.asfortranarray(x.T) for x in (q, v, a)]
pin_model = model.to_pinocchio()
data, pool = pin_model.createData(), pinocchio.ModelPool(pin_model, 1)
torque = np.empty((N, SAMPLES), order="F")


def by_pinocchio():
    """Torques of all samples, ``(T, N)``."""
    pinocchio.rneaInParallel(1, pool, *columns, torque)
    return torque.T


batch = {
    "pinocchio": by_pinocchio,
    "mp2a, serial": lambda: mp2a.rnea(model, q, v, a, threads=1),
    **{f"mp2a, {name}": lambda name=name: mp2a.rnea(model, q, v, a, method=name) for name in ("sweep", "kogge-stone")},
}
single = {
    "pinocchio": lambda: pinocchio.rnea(pin_model, data, q[0], v[0], a[0]),
    "mp2a, serial": lambda: mp2a.rnea(model, q[0], v[0], a[0]),
    **{
        f"mp2a, {name}": lambda name=name: mp2a.rnea(model, q[0], v[0], a[0], method=name)
        for name in ("sweep", "kogge-stone")
    },
}


def medians(contenders):
    """Microseconds of a call of each, after one that does not count."""
    took = {name: [] for name in contenders}
    for turn in range(1 + TURNS):
        for name, call in contenders.items():
            began = time.perf_counter()
            call()
            if turn:
                took[name].append(1e6 * (time.perf_counter() - began))
    return {name: statistics.median(times) for name, times in took.items()}


alone, together = medians(single), medians(batch)
print(f"{N} robots, one process, one thread    one sample    {SAMPLES} samples in a call")
for name in batch:
    print(f"{name:<36} {alone[name]:8.0f} µs    {together[name]:8.0f} µs, {together[name] / SAMPLES:6.1f} µs a sample")

expected = by_pinocchio().copy()
worst = max(abs(call() - expected).max() for call in batch.values()) / abs(expected).max()
count = kogge_stone(N).count(DOUBLES)
print(f"largest relative difference from pinocchio {worst:.1e}")
print(
    f"kogge-stone, if each robot were a rank: {count.rounds} rounds instead of {2 * (N - 1)} hops; "
    f"{count.total} messages, {8 * count.doubles:,} bytes a sample"
)
