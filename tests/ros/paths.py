"""How far robots are from the paths of their leaders."""

import numpy as np

from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.robot_models import HUSKY
from mp2a.se2 import compose
from mp2a.simulator.scenario_run import run as ideal_run

COLUMN = """robots R1 R2 R3 R4
column R1;R2;R3;R4 2 0
move 3 0
move 3 -60
move 3 60
"""


def path_error(track, leader):
    """Largest distance of a robot from its leader's path, begun where the robot stood, m."""
    line = np.concatenate((np.linspace(track[0], leader[0], 100), leader))
    return np.min(np.hypot(*(track[:, None] - line[None]).transpose(2, 0, 1)), axis=1).max()


def ideal(text):
    """Ideal robots' last places, m, and their path errors, m: what the choreography itself leaves."""
    run = ideal_run(Choreography(parse(text), HUSKY))
    lanes = run.leader_poses.copy()
    side = np.zeros_like(lanes)
    side[..., 1] = run.slots[..., 1]
    lanes = compose(lanes, side)
    errors = [path_error(run.poses[:, i, :2], lanes[:, i, :2]) for i in range(lanes.shape[1])]
    return run.poses[-1, :, :2], np.array(errors)
