"""A march with a robot a rank is the march of one process, for every shape and method."""

import numpy as np
from _formation import COMM, RANK, SIZE, Checks

import mp2a
from mp2a.formation import (
    Discs,
    Formation,
    FormationController,
    Limits,
    LocalExchange,
    MPIExchange,
    SensedPoints,
    Springs,
    pack,
    waypoints,
)
from mp2a.methods import METHODS

check = Checks()
WORLD = Discs([[2.5, 0.1, 0.4], [4.5, 1.5, 0.3]])
PATH = waypoints([[0, 0], [8, 0], [10, 6]], radius=2.0, limits=Limits(speed=1.0))
TICKS = 45


def silence(tick, sensed, robots):
    """Robot 1's sensor is silent for a while, the last one's from then on."""
    heard = np.ones(SIZE, dtype=bool)
    heard[0], heard[-1] = not 20 < tick < 23, tick < 35
    return sensed._replace(heard=heard[robots])


def expected(formation, method, springs):
    """The march of one process: setpoints and forces of all ticks, and how far the joints yielded in the end."""
    march = FormationController(formation, PATH, LocalExchange(formation.model, method), springs=springs)
    rows, yielded = [], 0.0
    for tick in range(TICKS):
        setpoints = march.step(silence(tick, WORLD.sense(march.state.pose), slice(None)))
        rows.append((setpoints, march.report.scan.force))
        yielded = max(yielded, np.abs(march.state.displacement.value).max())
    return rows, yielded


CASES = [("line", method) for method in METHODS] + [("column", "kogge-stone"), ("triangle", "compact")]
for shape, method in CASES:
    formation = Formation.of(shape, SIZE, mass=50.0 + np.arange(SIZE))
    springs = Springs(turning_stiffness=400.0) if shape == "column" else Springs()
    whole, yielded = COMM.bcast(expected(formation, method, springs) if RANK == 0 else None)
    check(yielded > 0.1, shape, yielded)
    with mp2a.DistributedModel(COMM, formation.model, method) as ranks:
        march = FormationController(formation, PATH if RANK == 0 else None, MPIExchange(ranks), springs=springs)
        # The scan is all there is, but for a word to the one behind: as many messages as the schedule says.
        count = ranks.schedule.count(METHODS[method].doubles).total
        sent = sum(ranks.transport.messages.values())
        worst = 0.0
        for tick, (theirs, force) in enumerate(whole):
            ours = march.step(silence(tick, WORLD.sense(march.state.pose), [RANK]))
            for name in ("pose", "speed", "turn_rate", "acceleration"):
                worst = max(worst, np.abs(getattr(ours, name)[0] - getattr(theirs, name)[RANK]).max())
            worst = max(worst, np.abs(march.report.scan.force[0] - force[RANK]).max() / 1e3)
            check(ours.failed[0] == theirs.failed[RANK])
        check(worst < 1e-9, shape, method, worst)
        check(bool(theirs.failed[-1]) and (SIZE == 1 or not theirs.failed[0]))
        check(COMM.allreduce(sum(ranks.transport.messages.values()) - sent) == TICKS * count)

# A leader without a path stands, and so do all.
formation = Formation.of("line", SIZE)
with mp2a.DistributedModel(COMM, formation.model) as ranks:
    march = FormationController(formation, None, MPIExchange(ranks))
    start = march.state.pose.copy()
    for _ in range(5):
        setpoints = march.step()
    check((setpoints.pose == start).all() and (setpoints.twist == 0).all())

    # What one robot has sensed is malformed: the same error on every rank, and the march goes on after it.
    wrong = SensedPoints(np.full((1, 2), np.nan), np.zeros(1, dtype=int), np.ones(1, dtype=bool))
    try:
        march.step(wrong if RANK == SIZE - 1 else None)
    except mp2a.InputError as error:
        text = str(error)
    else:
        text = ""
    check(len(set(COMM.allgather(text))) == 1 and f"rank {SIZE - 1}: points: got nan" in text, text)
    check((march.step(pack([[[1.0, 5.0]]])).pose == start).all())
check.done()
