"""Three robots in a rigid triangle carry a box (paper, figure 13); each is loaded with a third of it."""

import numpy as np

from mp2a.formation import Formation, FormationController, Limits, spline
from mp2a.formation.shapes import centre

ROBOT, BOX = 50.0, 30.0
formation = Formation.of("box", 3, spacing=1.5, mass=ROBOT + BOX / 3)
path = spline([[0, 0], [4, 1], [8, -1], [12, 0]], Limits(speed=0.7, turn_rate=0.4))
march = FormationController(formation, path)
middle = complex(*centre(formation.layout))

print("  time   box at           sides of the triangle, m   speeds ahead, m/s    forces of the joints, N")
while march.time < path.duration + 1:
    setpoints = march.step()
    if march.state.ticks % 30 == 1:
        at = setpoints.pose[:, 0] + 1j * setpoints.pose[:, 1]
        box = at[0] + np.exp(1j * setpoints.pose[0, 2]) * middle
        sides = np.abs(at - np.roll(at, 1))
        forces = np.hypot(*march.report.scan.force[:, :2].T)
        print(
            f"{march.time:5.1f} s  {box.real:5.2f}, {box.imag:5.2f} m  {' '.join(f'{x:6.4f}' for x in sides)}       "
            f"{' '.join(f'{x:5.2f}' for x in setpoints.speed)}    {' '.join(f'{x:6.1f}' for x in forces)}"
        )
