"""An ideal robot that time takes along, for tests of what drives it."""

import numpy as np

from mp2a.robots.simulated import SimulatedRobot, SimulationClock
from mp2a.simulator.ideal import IdealSimulation


class IdealRobot(SimulatedRobot):
    """One ideal robot, for a `VirtualClock`; tests make its sensors fail."""

    over = False

    def __init__(self, model, pose):
        self.simulated = SimulationClock(IdealSimulation([model], [pose]), 0.05, [])
        self.command = np.zeros(2)
        super().__init__(self.simulated, 0)

    def send(self, command):
        self.command = np.array(command, dtype=float)

    def advance(self, t):
        self.simulated.step(self.command[None], t - self.simulated.now())

    def close(self):
        self.command = np.zeros(2)
