"""Three robots drive one behind the other past two obstacles, in the 2-D simulator: python examples/simulate.py."""

from pathlib import Path

import numpy as np

from mp2a import plot
from mp2a.formation.robot_models import HUSKY
from mp2a.simulator import Observation, RunRecorder, Simulation, read_world, save_recording, simulate

WAYPOINTS = np.array([[4.5, 0.2], [6.5, 0.4], [8.0, -2.5]])
GAP = 1.6  # m between the middles of two robots

world = read_world(Path(__file__).parent / "worlds" / "two_obstacles.toml")
simulation = Simulation(world, HUSKY, [[1.9, 0, 0], [0.3, 0, 0], [-1.3, 0, 0]])
waypoints = list(WAYPOINTS)


def follow(sensed: Observation) -> np.ndarray | None:
    """Command robot 1 towards the waypoints and the others after the one before them; away from what they see."""
    places = sensed.poses[:, :2]
    while waypoints and np.linalg.norm(waypoints[0] - places[0]) < 0.5:
        waypoints.pop(0)
    if not waypoints:
        return None
    targets = np.concatenate((waypoints[:1], places[:-1]))
    offset = targets - places
    distance = np.linalg.norm(offset, axis=1)
    speed = np.clip(distance - np.array([0, GAP, GAP]), 0, 0.6)
    turn = np.angle(np.exp(1j * (np.arctan2(offset[:, 1], offset[:, 0]) - sensed.poses[:, 2])))
    for i, seen in enumerate(sensed.points):
        near = seen[(np.linalg.norm(seen, axis=1) < 1.3) & (seen[:, 0] > 0.2) & (np.abs(seen[:, 1]) > 0.3)]
        turn[i] -= 0.02 * np.sum(np.sign(near[:, 1]))
    return np.stack((speed, 1.5 * turn), axis=1)


recorder = RunRecorder(simulation)
simulate(simulation, follow, until=40, recorder=recorder)
recording = recorder.recording()

seen, met = len(recording.points), len(simulation.collisions)
print(f"{simulation.time:.1f} s simulated, {seen} points seen, {met} collisions")
print(save_recording(recording, "results/simulate.npz"))
print(plot.save_figure(plot.march_figure(recording), "results/simulate.png"))
