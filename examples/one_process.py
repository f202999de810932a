"""A chain of 512 robots in one process: the serial recursion and the paper's three scans give the same torques."""

import time

import mp2a
from mp2a.algebra.affine import DOUBLES
from mp2a.schedule import kogge_stone

N = 512
model = mp2a.Model.random(N, seed=0)
state = model.random_state(seed=0)

torque = {}
for method in ("serial", "kogge-stone"):
    began = time.perf_counter()
    torque[method] = mp2a.rnea(model, *state, method=method)
    print(f"{method:<12} {1e3 * (time.perf_counter() - began):6.1f} ms for {N} robots in this one process")

difference = abs(torque["serial"] - torque["kogge-stone"]).max() / abs(torque["serial"]).max()
count = kogge_stone(N).count(DOUBLES)
print(f"largest relative difference {difference:.1e}")
print(f"{count.rounds} rounds instead of {2 * (N - 1)} hops; {count.total} messages, {8 * count.doubles:,} bytes")
