"""An ideal robot that time takes along, for tests of what drives it."""

import numpy as np

from mp2a.robots.simulated import SimulatedRobot, SimulationClock
from mp2a.simulator.ideal import IdealSimulation


class IdealRobot(SimulatedRobot):
    """One ideal robot, for a `VirtualClock`, that remembers what it was told; tests make its sensors fail."""

    over = False

    def __init__(self, model, pose):
        self.simulated = SimulationClock(IdealSimulation([model], [pose]), 0.05, [])
        self.command, self.ticks, self.sent, self.warnings = np.zeros(2), 0, [], []
        super().__init__(self.simulated, 0)

    def sense(self):
        self.ticks += 1
        return super().sense()

    def send(self, command):
        self.command = np.array(command, dtype=float)
        self.sent.append(tuple(command))

    def warn(self, text):
        self.warnings.append((self.ticks, text))

    def advance(self, t):
        self.simulated.step(self.command[None], t - self.simulated.now())

    def close(self):
        self.command = np.zeros(2)
