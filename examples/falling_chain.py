"""A chain of 1000 links hangs from one end of a level line and falls: python examples/falling_chain.py [links].

Each link hangs on a joint with a little damping. Steps are semi-implicit: velocities first, then coordinates with the
new ones, which gains some per cent of energy where the tip whips round. The picture goes to results/falling_chain.png.
"""

import dataclasses
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mp2a

n = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
length, seconds, step = 10.0, 1.5, 1e-3
chain = mp2a.Model.uniform(n, axis=(0, 1, 0), offset=(length / n, 0, 0), mass=10.0 / n)
# Fast turns of single links, which a step of 1 ms could not follow, die out; the chain as a whole hardly notices.
chain = dataclasses.replace(chain, damping=np.full(n, 0.1), armature=np.full(n, 2e-3))
q, v, none = mp2a.neutral(chain), np.zeros(n), np.zeros(n)
shots, energies = [], []
for k in range(round(seconds / step) + 1):
    if k % round(0.25 / step) == 0:
        places = mp2a.placements(chain, q)
        shots.append((k * step, places.translation.copy()))
        motion = mp2a.aba(chain, q, v, none, bodies=True)
        heights = places.translation[:, 2] + (places.rotation @ chain.coms[0])[:, 2]
        velocity = motion.velocity[:, 3:] + np.cross(motion.velocity[:, :3], chain.coms)
        kinetic = 0.5 * chain.masses @ np.sum(velocity**2, axis=1)
        energies.append((kinetic, 9.81 * chain.masses @ heights))
    v += step * mp2a.aba(chain, q, v, none)
    q = mp2a.integrate(chain, q, step * v)

print("time, s   lowest link, m   kinetic energy, J   potential energy, J")
for (time, points), (kinetic, potential) in zip(shots, energies, strict=True):
    print(f"{time:7.2f} {points[:, 2].min():16.2f} {kinetic:19.1f} {potential:21.1f}")

figure = Figure(figsize=(6, 6), layout="constrained")
axes = figure.subplots()
for k, (time, points) in enumerate(shots):
    axes.plot(points[:, 0], points[:, 2], color=(0.1, 0.3, 0.7, 0.25 + 0.75 * k / len(shots)), label=f"{time:.2f} s")
axes.set(xlabel="x, m", ylabel="z, m", title=f"a chain of {n} links, let go level", aspect="equal")
axes.legend(title="time")
Path("results").mkdir(exist_ok=True)
figure.savefig("results/falling_chain.png", dpi=150)
