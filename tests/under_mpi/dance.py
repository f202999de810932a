"""A choreography with a robot a rank: rank 0 works the leaders out, the scan takes their motion to the others."""

import numpy as np
from _formation import COMM, RANK, SIZE, Checks

import mp2a
from mp2a.formation import MPIExchange
from mp2a.formation.choreography.leader_broadcast import planar_chain
from mp2a.formation.choreography.reading import parse
from mp2a.formation.choreography.runner import Choreography
from mp2a.formation.constants import TICK
from mp2a.formation.robot_models import HUSKY, Fleet
from mp2a.methods import METHODS
from mp2a.simulator.ideal import obey
from mp2a.simulator.scenario_run import run

check = Checks()


def line(shape, robots):
    """Some robots in a row or a column."""
    gap = 1.5 if len(robots) > 1 else 0
    return f"row {','.join(robots)} 0 {gap}" if shape == "row" else f"column {';'.join(robots)} {gap} 0"


robots = [f"R{i + 1}" for i in range(SIZE)]
front, back = robots[: (SIZE + 1) // 2], robots[(SIZE + 1) // 2 :]
groups = {name: members for name, members in (("front", front), ("back", back)) if members}
lines = [f"robots {' '.join(robots)}", "groups", *(" ".join((name, *members)) for name, members in groups.items())]
lines += ["start", line("row", robots), "move 2 30", line("column", robots), "circle 3 60 0.2", line("row", front)]
lines += [*([line("column", back)] if back else []), "newVL"]
lines += [text for text in ("move 1 -40 front", "move 2 20 back", "move 1 0 front") if text.split()[-1] in groups]
scenario = parse("\n".join(lines))

expected = COMM.bcast(run(Choreography(scenario, HUSKY)) if RANK == 0 else None)
check(expected.done)
check(not back or np.abs(np.diff(expected.leader_twists, axis=1)).max() > 0.1)  # two leaders

for method in METHODS:
    with mp2a.DistributedModel(COMM, planar_chain(SIZE), method) as ranks:
        show = Choreography(scenario, HUSKY, exchange=MPIExchange(ranks))
        check((show.state.course is None) == (RANK > 0))
        # What the others do is not known here: one's own pose goes in, one's own command comes out.
        one = Fleet.of([HUSKY])
        poses, twists = show.slot_poses()[[RANK]], np.zeros((1, 2))
        sent, worst = sum(ranks.transport.messages.values()), 0.0
        for tick in range(len(expected.time)):
            worst = max(worst, np.abs(poses[0] - expected.poses[tick, RANK]).max())
            commands = show.step(tick * TICK, poses, twists, None)
            worst = max(worst, np.abs(commands[0] - expected.commands[tick, RANK]).max())
            check((show.state.course is None) == (RANK > 0))
            poses, twists = obey(one, poses, twists, commands, TICK)
        check(worst < 1e-9, method, worst)
        check(bool((show.ended & show.settled)[RANK]))
        count = ranks.schedule.count(METHODS[method].doubles).total
        check(COMM.allreduce(sum(ranks.transport.messages.values()) - sent) == len(expected.time) * count)

        # What one robot gives is malformed: the same error on every rank, and it goes on after it.
        try:
            show.step(tick * TICK + TICK, poses[:, :2] if RANK == SIZE - 1 else poses, twists, None)
            text = ""
        except mp2a.InputError as error:
            text = str(error)
        check(len(set(COMM.allgather(text))) == 1 and f"rank {SIZE - 1}: poses: got shape" in text, text)
        check(np.isfinite(show.step(tick * TICK + TICK, poses, twists, None)).all())
check.done()
