"""A line of 64 robots in the 2-D simulator, each a LIDAR, past a pillar: python examples/line.py [robots]."""

import sys

import numpy as np

from mp2a.formation import Formation, FormationController, waypoints
from mp2a.formation.robot_models import HUSKY
from mp2a.simulator import FormationSimulationDriver, RunRecorder, Simulation, World, disc, simulate

n = int(sys.argv[1]) if len(sys.argv) > 1 else 64
path = waypoints([[0, 0], [12, 0], [20, 8]], radius=4.0)
formation = Formation.of("line", n)
march = FormationController(formation, path)
world = World([], [disc((7, 0.2), 0.4)], "a pillar")
simulation = Simulation(world, HUSKY, formation.layout.poses(np.zeros(3)))
robots, recorder = FormationSimulationDriver(march, HUSKY), RunRecorder(simulation, points=False)
simulate(simulation, robots.step, until=path.duration + 0.1 * n + 3, recorder=recorder)
recording = recorder.recording(robots.leaders, robots.events)

spacing = np.hypot(*np.moveaxis(np.diff(recording.poses[..., :2], axis=1), -1, 0))
print(f"{n} robots, {simulation.time:.1f} s simulated, {len(simulation.collisions)} collisions")
print("robot   farthest off its setpoint, m   distance to the robot before, m")
for i in sorted({0, 1, n // 4, n // 2, n - 1} & set(range(n))):
    apart = "" if i == 0 else f"{spacing[:, i - 1].min():.2f} to {spacing[:, i - 1].max():.2f}"
    print(f"{i + 1:5}   {recording.gaps[:-1, i].max():28.3f}   {apart:>31}")
