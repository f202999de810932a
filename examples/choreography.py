"""Listing 6.3 of the thesis with four ideal TRADRs, who are told by the scan along the chain how their leaders move."""

from pathlib import Path

import numpy as np

from mp2a.formation import LocalExchange
from mp2a.formation.choreography.leader_broadcast import planar_chain
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.choreography.scenario import instruction_text
from mp2a.formation.robot_models import TRADR
from mp2a.simulator.scenario_run import run

scenario = parse((Path(__file__).parent / "scenarios" / "listing_6_3.txt").read_text())
# The first robot alone works the virtual leaders out; the scan along the chain of robots tells the others.
dance = Choreography(scenario, TRADR, exchange=LocalExchange(planar_chain(len(scenario.robots)), "kogge-stone"))
done = run(dance)
# What a rigid tie to the leader asks of a robot: the outer one in an arc has to be faster.
places = done.leader_twists[..., 0] - done.leader_twists[..., 1] * done.slots[..., 1]

print("ideal robots; mean forward speed in m/s during each instruction: of the robot's place / of the robot")
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
    print(f"{mine[0].time:6.1f} {mine[-1].time:6.1f}  {instruction_text(instruction):<30}{row}")
