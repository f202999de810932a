"""Eight robots follow their leader past obstacles that it did not know of (paper, figure 11)."""

import numpy as np

from mp2a.formation import Discs, Formation, FormationController, waypoints

path = waypoints([[0, 0], [20, 0], [20, 15]], radius=3.0)
world = Discs([[10.0, 0.0, 0.5], [20.3, 8.0, 0.4]])
march = FormationController(Formation.of("line", 8), path)

print("  time   leader at       joints yield, m" + 36 * " " + "largest push, N")
clearance = np.full(8, np.inf)
while march.time < path.duration + 10:
    setpoints = march.step(world.sense(march.state.pose))
    clearance = np.minimum(clearance, world.clearance(setpoints.pose))
    if march.state.ticks % 50 == 1:
        x, y, _ = setpoints.pose[0]
        yielded = np.hypot(*march.state.displacement.value[:, :2].T)
        push = np.hypot(*march.report.push.T).max()
        print(f"{march.time:5.1f} s  {x:5.1f}, {y:5.1f} m  {' '.join(f'{d:5.2f}' for d in yielded)}  {push:6.0f}")
print("nearest to an obstacle, m      " + " ".join(f"{d:5.2f}" for d in clearance))
