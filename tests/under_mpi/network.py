"""No message over an emulated network comes early, whatever its size, and what comes is what was sent."""

import time

import numpy as np
from _formation import COMM, RANK, SIZE, Checks

import mp2a
from mp2a.cores import USUAL_SLACK, set_timer_slack
from mp2a.transport.link import make_link, measure_latency
from mp2a.transport.wait import wait, wait_unless

check = Checks()
for network in (mp2a.EmulatedNetwork(5e-3, 1e8), mp2a.EmulatedNetwork(0.0, 1e7), mp2a.EmulatedNetwork(1e-3, 1e12)):
    link = make_link(COMM, network)
    for doubles in (1, 42, 10_000):
        times = measure_latency(link, doubles, 5)
        check((len(times) == 5) == (RANK == 0 and SIZE > 1))
        check(all(seconds >= network.seconds(doubles) for seconds in times), doubles, times)
        COMM.Barrier()

# All to all at once: messages do not slow each other down, and none is mixed up.
link = make_link(COMM, mp2a.EmulatedNetwork(2e-3, 1e9))
others = [rank for rank in range(SIZE) if rank != RANK]
boxes = {rank: np.empty(100) for rank in others}
coming = [link.receive(boxes[rank], rank, 7) for rank in others]
began = time.monotonic()
COMM.Barrier()
sent = [link.send(np.full(100, 1.0 * RANK), rank, 7) for rank in others]
check(all(link.finish(receiving) for receiving in coming))
check(not others or time.monotonic() - began >= 2e-3)
check(all((boxes[rank] == rank).all() for rank in others))
for request in sent:
    wait(request)

# Ranks start with lax timers, but whoever waits for messages sleeps no longer than it means to.
lax = 10_000_000
set_timer_slack(lax)
make_link(COMM, network)
check(set_timer_slack(lax) in (0, USUAL_SLACK))
never = COMM.Irecv(np.empty(1), RANK, 8)
looks = iter((False, True))  # the first before it sleeps, the second after some naps
check(not wait_unless(never, lambda: next(looks), 1e-3))
check(set_timer_slack(USUAL_SLACK) in (0, USUAL_SLACK))
never.Cancel()
never.Wait()

for wrong in (mp2a.EmulatedNetwork(-1.0, 1e9), mp2a.EmulatedNetwork(1.0, 0.0)):
    try:
        make_link(COMM, wrong)
        check(False)
    except mp2a.InputError as error:
        check("network" in str(error))
check.done()
