"""Formations larger than any machine at hand: a schedule and compute costs, replayed by SimGrid; all times simulated.

A *program* is what all ranks do, as plain data: phases in order, each rank going through those it is in. A phase is
computing (`ComputePhase`) or messages in flight together (`MessagePhase`), after which a rank waits for its own, as a
robot does between two rounds. Programs come from a schedule (`schedule_program`) or are that of gather and scatter
(`gather_scatter_program`).

A program becomes the text of a replay, a line an action, which SimGrid's SMPI carries out on a platform of one host a
robot. Its correction factors are off (`NEUTRAL`), so that a network is its latency, its bandwidth and who shares them.
A message leaves once its receiver has asked for it; real small ones leave at once, and where ranks drift apart a round
or two of a few robots come sooner than here. SMPI adds 16 bytes to every message, as an MPI adds an envelope.
"""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mp2a.bench.costs import ComputeCosts
from mp2a.cores import available_memory
from mp2a.exceptions import DependencyError, InputError
from mp2a.schedule import Round, Schedule

Ranks = NDArray[np.intp]

SPEED = 1e9
"""Flop/s of a simulated host: a second of computing is as many flops."""

NEUTRAL = {
    "network/model": "CM02",  # the default, SMPI, bends latency and bandwidth as one cluster of 2013 had them
    "network/latency-factor": "1",
    "network/bandwidth-factor": "1",
    "network/weight-S": "0",  # equal shares, whatever the latency
    "network/TCP-gamma": "0",  # no TCP window: it would cap a flow at window / (2 latency)
    "network/crosstraffic": "0",  # no acknowledgements that take 5 % of the other direction
    "smpi/os": "0:0:0:0:0",  # no processor time a message
    "smpi/or": "0:0:0:0:0",
    "smpi/ois": "0:0:0:0:0",
    "smpi/async-small-thresh": "0",  # a message of any size leaves once both sides are ready, and …
    "smpi/send-is-detached-thresh": "0",  # … its sender may see whether it has arrived
    "smpi/cpu-threshold": "-1",  # what replaying takes is no part of what is replayed
    "smpi/host-speed": f"{SPEED:.0f}f",
}
"""SimGrid's settings that would change what a latency or a bandwidth means, and what they are set to."""

_LEAN = {
    "smpi/privatization": "no",  # a replay has no global variables to keep apart
    "contexts/stack-size": "64",  # KiB, all of it touched; the default of 8 MiB is 0.5 TB for 65 536 ranks
    "contexts/guard-size": "0",  # a guard page a rank is more mappings than Linux allows a process
}
_RANK_BYTES = 110_000
"""Memory of a simulated rank (measured: 81 kB with 65 536 ranks, of which 64 KiB are its stack)."""
_TIME = re.compile(r"Simulated time: (\S+) seconds")
_BYTE = "2"  # of the datatypes a replay knows, the one of 1 byte


class ComputePhase(NamedTuple):
    """Some ranks compute for equally long, at the same time."""

    ranks: Ranks
    seconds: float


class Flow(NamedTuple):
    """Messages of equal size."""

    source: Ranks
    target: Ranks
    size: int
    """Bytes of each."""


class MessagePhase(NamedTuple):
    """Messages in flight together: each rank starts all of its own and waits for all of them."""

    flows: tuple[Flow, ...]


Phase = ComputePhase | MessagePhase


class SimulatedNetwork(NamedTuple):
    """What lies between the robots."""

    label: str
    latency: float
    """Of a message, end to end, s."""
    speed: float
    """Of a robot's link, or of the one channel, bit/s."""
    sharing: str
    """``duplex``: a robot sends and receives at full speed. ``half duplex``: both share its radio. ``channel``: all
    robots share one."""


NETWORKS = {
    "infiniband": SimulatedNetwork("InfiniBand-like cluster", 1.5e-6, 100e9, "duplex"),
    "ethernet": SimulatedNetwork("gigabit Ethernet", 50e-6, 1e9, "duplex"),
    "radio": SimulatedNetwork("slow radio mesh", 5e-3, 6e6, "half duplex"),
    "channel": SimulatedNetwork("radio, one channel for all", 5e-3, 6e6, "channel"),
}
"""Networks by name. Everybody reaches everybody in one hop."""


# ---- programs ------------------------------------------------------------------------------------------------------


def schedule_program(
    schedule: Schedule, doubles: Mapping[str, int], samples: int, costs: ComputeCosts
) -> Iterator[Phase]:
    """Program of robots that schedule_program a schedule.

    Parameters
    ----------
    schedule
        Who sends what to whom.
    doubles
        Numbers a sample in each kind of message.
    samples
        Samples in each message.
    costs
        What a robot computes in between.
    """
    everybody = np.arange(schedule.nodes)
    before: Round | None = None
    for round_ in schedule.rounds:
        if before is not None and before.recurrence == round_.recurrence:
            yield ComputePhase(_union([target for _, _, target in before.transfers]), costs.between[round_.recurrence])
        else:
            yield ComputePhase(everybody, costs.start[round_.recurrence])
        yield MessagePhase(tuple(Flow(s, t, 8 * doubles[kind] * samples) for kind, s, t in round_.transfers))
        before = round_
    yield ComputePhase(everybody, costs.end)


def gather_scatter_program(n: int, doubles: tuple[int, int], samples: int, seconds: float) -> Iterator[Phase]:
    """Program of gather and scatter: all send to rank 0, which computes and sends to all; directly, no tree.

    Parameters
    ----------
    n
        Number of robots.
    doubles
        Numbers a sample that a robot sends and gets.
    samples
        Samples in each message.
    seconds
        What rank 0 computes for one robot, all samples.
    """
    others, root = np.arange(1, n), np.zeros(n - 1, dtype=np.intp)
    yield MessagePhase((Flow(others, root, 8 * doubles[0] * samples),))
    yield ComputePhase(np.zeros(1, dtype=np.intp), n * seconds)
    yield MessagePhase((Flow(root, others, 8 * doubles[1] * samples),))


# ---- text ----------------------------------------------------------------------------------------------------------


def replay(n: int, program: Iterable[Phase]) -> Iterator[str]:
    """Text of a replay of n ranks, in pieces: one file for all, each line beginning with whose it is.

    In an exchange a rank waits for what it receives and for what it sent in the exchange before, as
    `mp2a.transport.base.Transport` has it. Lines are in the order of the phases, so that the simulator, which reads on
    until it finds a line of the rank it is at, hardly has to keep more than a phase.
    """
    owed = [""] * n
    tag = 0
    yield _lines(np.arange(n), "init")
    for phase in program:
        if isinstance(phase, ComputePhase):
            if phase.seconds > 0:
                yield _lines(phase.ranks, f"compute {phase.seconds * SPEED:.6g}")
            continue
        posts, waits = [], []
        sent: list[tuple[int, str]] = []
        for flow in phase.flows:
            tag += 1
            rest = f"{tag} {flow.size} {_BYTE}\n"
            for s, t in zip(flow.source.tolist(), flow.target.tolist(), strict=True):
                posts.append(f"{t} irecv {s} {rest}{s} isend {t} {rest}")
                waits.append(f"{t} wait {s} {t} {tag}\n")
                sent.append((s, f"{s} wait {s} {t} {tag}\n"))
        for rank in _union([side for flow in phase.flows for side in (flow.source, flow.target)]).tolist():
            waits.append(owed[rank])
            owed[rank] = ""
        for rank, line in sent:
            owed[rank] += line
        yield "".join(posts)
        yield "".join(waits)
    yield "".join(owed)
    yield _lines(np.arange(n), "finalize")


def _lines(ranks: Ranks, action: str) -> str:
    return "".join([f"{rank} {action}\n" for rank in ranks.tolist()])


def _union(parts: Sequence[Ranks]) -> Ranks:
    if len(parts) == 1 and len(parts[0]) == 1:
        return parts[0]
    return np.unique(np.concatenate(parts)) if parts else np.zeros(0, dtype=np.intp)


def platform(network: SimulatedNetwork, n: int) -> str:
    """SimGrid's description of a network of n hosts r0, r1, …, as XML.

    A message crosses its sender's link and its receiver's, so each has half the latency; in between nothing is ever
    short (full bisection). With one channel for all, the links are so fast that only the channel counts.
    """
    link = {"bw": f"{network.speed / 8:.9g}Bps", "lat": f"{network.latency / 2:.9g}s", "sharing_policy": "SPLITDUPLEX"}
    if network.sharing == "half duplex":
        link["sharing_policy"] = "SHARED"
    elif network.sharing == "channel":
        link |= {"bw": f"{network.speed * 1e3:.9g}Bps", "lat": "0s"}
        link |= {"bb_bw": f"{network.speed / 8:.9g}Bps", "bb_lat": f"{network.latency:.9g}s"}
        link["bb_sharing_policy"] = "SHARED"
    elif network.sharing != "duplex":
        raise InputError(f"sharing: got {network.sharing!r}, expected 'duplex', 'half duplex' or 'channel'")
    attributes = " ".join(f'{name}="{value}"' for name, value in link.items())
    return (
        "<?xml version='1.0'?>\n"
        '<!DOCTYPE platform SYSTEM "https://simgrid.org/simgrid.dtd">\n'
        '<platform version="4.1">\n'
        f'  <cluster id="formation" prefix="r" suffix="" radical="0-{n - 1}" speed="{SPEED:.0f}f" {attributes}/>\n'
        "</platform>\n"
    )


# ---- simulation ----------------------------------------------------------------------------------------------------


def simulate(network: SimulatedNetwork, n: int, program: Iterable[Phase], limit: float | None = None) -> float:
    """Simulate a program, and return the time from the start of the first rank to the end of the last, s.

    Parameters
    ----------
    network
        What lies between the ranks.
    n
        Number of ranks.
    program
        What they do.
    limit
        Seconds of real time the simulator may take.

    Raises
    ------
    DependencyError
        Without SimGrid, or if the simulator ends without a result, as it does when it runs out of memory.
    TimeoutError
        If the simulator takes longer.
    """
    smpirun = find_smpirun()
    need, free = n * _RANK_BYTES, available_memory()
    if free is not None and need > free:
        raise DependencyError(f"simulating {n} ranks takes {need / 1e9:.1f} GB and {free / 1e9:.1f} GB are free")
    with tempfile.TemporaryDirectory(prefix="mp2a-") as name:
        folder = Path(name)
        with (folder / "trace").open("w", encoding="ascii") as file:
            file.writelines(replay(n, program))
        (folder / "index").write_text("trace\n", encoding="ascii")
        (folder / "hosts").write_text("".join(f"r{rank}\n" for rank in range(n)), encoding="ascii")
        (folder / "platform.xml").write_text(platform(network, n), encoding="ascii")
        return _run(smpirun, n, folder, limit)


def find_smpirun() -> str:
    """Where SimGrid's launcher is."""
    smpirun = shutil.which("smpirun")
    if smpirun is None:
        raise DependencyError(
            "smpirun: not found; it belongs to SimGrid (tested with 3.32), which simulates networks; "
            "on Debian and Ubuntu: apt-get install libsimgrid-dev"
        )
    return smpirun


def _run(smpirun: str, n: int, folder: Path, limit: float | None) -> float:
    files = ["-platform", "platform.xml", "-hostfile", "hosts", "-replay", "index"]
    settings = [f"--cfg={name}:{value}" for name, value in (NEUTRAL | _LEAN).items()]
    show = ["--cfg=smpi/display-timing:yes", "--log=root.thresh:warning", "--log=smpi_utils.thresh:info"]
    command = [smpirun, "-quiet", "-np", str(n), *files, *settings, *show]
    process = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    try:
        output, _ = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        raise TimeoutError(f"simulation of {n} ranks: longer than {limit:g} s") from None
    finally:
        if process.poll() is None:
            process.terminate()  # smpirun passes it on to the simulator
            process.communicate()
    time = _TIME.search(output)
    if process.returncode or not time:
        last = output.strip().splitlines()[-1:] or ["no output"]
        raise DependencyError(f"smpirun: exit status {process.returncode} with {n} ranks ({last[0]})")
    return float(time[1])
