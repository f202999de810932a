"""A march with a robot a rank is the march of one process, for every shape and method."""

import numpy as np
from _formation import COMM, RANK, SIZE, Checks

import mp2a
from mp2a.formation import Discs, Formation, Limits, March, OneProcess, OverRanks, Sensed, Springs, pack, waypoints
from mp2a.methods import METHODS

check = Checks()
WORLD = Discs([[2.5, 0.1, 0.4], [4.5, 1.5, 0.3]])
PATH = waypoints([[0, 0], [8, 0], [10, 6]], radius=2.0, limits=Limits(speed=1.0))
TICKS = 55


def own(sensed):
    """What this rank's robot alone has sensed."""
    mine = sensed.robot == RANK
    return Sensed(sensed.points[mine], np.zeros(mine.sum(), dtype=int), sensed.heard[[RANK]])


CASES = [("line", method) for method in METHODS] + [("column", "kogge-stone"), ("triangle", "compact")]
for shape, method in CASES:
    formation = Formation.of(shape, SIZE, mass=50.0 + np.arange(SIZE))
    springs = Springs(turning_stiffness=400.0) if shape == "column" else Springs()
    whole = March(formation, PATH, OneProcess(formation.chain, method), springs=springs)
    with mp2a.DistributedChain(COMM, formation.chain, method) as ranks:
        mine = March(formation, PATH if RANK == 0 else None, OverRanks(ranks), springs=springs)
        check(np.allclose(mine.state.pose[0], whole.state.pose[RANK], atol=1e-12))
        messages = []
        worst = 0.0
        for tick in range(TICKS):
            before = dict(ranks.transport.messages)
            # Every robot goes by its own pose; robot 1's sensor is silent for a while, the last one's for good.
            sensed = WORLD.sense(whole.state.pose)
            sensed.heard[0] = not 20 < tick < 23
            sensed.heard[-1] = tick < 40
            theirs = whole.step(sensed)
            local = WORLD.sense(mine.state.pose)
            local.heard[0] = sensed.heard[RANK]
            ours = mine.step(local)
            for name in ("pose", "speed", "turn_rate", "acceleration"):
                worst = max(worst, np.abs(getattr(ours, name)[0] - getattr(theirs, name)[RANK]).max())
            worst = max(worst, np.abs(mine.report.scan.force[0] - whole.report.scan.force[RANK]).max() / 1e3)
            check(ours.failed[0] == theirs.failed[RANK])
            messages.append({k: v - before.get(k, 0) for k, v in ranks.transport.messages.items()})
        check(worst < 1e-9, shape, method, worst)
        check(bool(theirs.failed[-1]) and (SIZE == 1 or not theirs.failed[0]))
        swerved = np.abs(whole.state.displacement.value).max()
        check(swerved > 1e-3, shape, swerved)
        # The scan is all there is, but for a word to the one behind: as many messages as the schedule says.
        count = ranks.schedule.count(METHODS[method].doubles)
        check(COMM.allreduce(sum(messages[-1].values())) == count.total)

# A leader without a path stands, and so do all.
formation = Formation.of("line", SIZE)
with mp2a.DistributedChain(COMM, formation.chain) as ranks:
    march = March(formation, None, OverRanks(ranks))
    start = march.state.pose.copy()
    for _ in range(5):
        setpoints = march.step()
    check((setpoints.pose == start).all() and (setpoints.twist == 0).all())

    # What one robot has sensed is malformed: the same error on every rank, and the march goes on after it.
    wrong = Sensed(np.full((1, 2), np.nan), np.zeros(1, dtype=int), np.ones(1, dtype=bool))
    try:
        march.step(wrong if RANK == SIZE - 1 else None)
    except mp2a.InputError as error:
        text = str(error)
    else:
        text = ""
    check(len(set(COMM.allgather(text))) == 1 and f"rank {SIZE - 1}: points: got nan" in text, text)
    check((march.step(pack([[[1.0, 5.0]]])).pose == start).all())
check.done()
