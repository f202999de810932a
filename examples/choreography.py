"""Listing 6.3 of the thesis with four ideal TRADRs: who drives how fast, worked out by the scan along the chain."""

from pathlib import Path

import numpy as np

import mp2a
from mp2a.formation.choreography.ideal import run
from mp2a.formation.choreography.motion import joint_state, place_motion, planar_chain
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.choreography.scenario import as_text
from mp2a.formation.robot_models import TRADR

scenario = parse((Path(__file__).parent / "scenarios" / "listing_6_3.txt").read_text())
dance = Choreography(scenario, TRADR)
done = run(dance)

# Every joint is a robot's place in the robot before; all samples of the run go through the chain together.
q, v, a = joint_state(place_motion(done.leader_poses, done.leader_twists, done.places))
motion = mp2a.rnea(planar_chain(len(dance.robots)), q, v, a, method="sweep", bodies=True)
places = motion.velocity[..., 3]

print("ideal robots; mean forward speed in m/s during each instruction: of the robot's place (scan) / of the robot")
print(f"{'began':>6} {'ended':>6}  {'instruction':<30}" + "".join(f"{robot:>14}" for robot in dance.robots))
for number, instruction in enumerate(scenario.instructions):
    mine = [event for event in dance.events if event.number == number]
    if not mine or mine[0].time == mine[-1].time:
        continue
    during = (done.time >= mine[0].time) & (done.time < mine[-1].time)
    speeds = [
        f"{places[during, i].mean():.2f} / {np.mean(done.twists[during, i, 0]):.2f}"
        if robot in {e.robot for e in mine}
        else ""
        for i, robot in enumerate(dance.robots)
    ]
    row = "".join(f"{speed:>14}" for speed in speeds)
    print(f"{mine[0].time:6.1f} {mine[-1].time:6.1f}  {as_text(instruction):<30}{row}")
