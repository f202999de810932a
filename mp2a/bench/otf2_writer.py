"""A trace in the Open Trace Format 2, which Vampir, Scalasca, Score-P's tools and others open."""

import shutil
import tempfile
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from mp2a.dependencies import need
from mp2a.exceptions import OutputError

_ANCHOR = "traces.otf2"
_NANOSECONDS = 1_000_000_000


def check_writable(folder: Path) -> None:
    """Find out before a long computation whether an archive can be written to a folder.

    Raises
    ------
    DependencyError
        If the package otf2 is not installed.
    OutputError
        If there is a file or a folder of that name that is no archive, or it cannot be made.
    """
    need("otf2", extra="otf2", purpose="--format otf2")
    if folder.exists() and not (folder / _ANCHOR).is_file():
        raise OutputError(f"{folder}: cannot be written (it is there and no OTF2 archive)")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        Path(tempfile.mkdtemp(dir=folder.parent)).rmdir()
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error


def write_otf2(trace: Mapping[str, Any], folder: Path) -> None:
    """Write a trace as an OTF2 archive, whole or not at all: a location a robot, in one process each.

    Parameters
    ----------
    trace
        What `mp2a.bench.timeline.trace_call` returned.
    folder
        Of the archive, which takes the place of another one that is there.

    Raises
    ------
    DependencyError, OutputError
        As `check_writable` does.
    """
    check_writable(folder)
    with tempfile.TemporaryDirectory(dir=folder.parent) as elsewhere:
        made = Path(elsewhere) / folder.name
        try:
            _write(trace, made)
            if folder.exists():
                shutil.rmtree(folder)
            made.replace(folder)
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written ({error.strerror})") from error


def _write(trace: Mapping[str, Any], folder: Path) -> None:
    otf2, enums = (need(module, extra="otf2", purpose="writing OTF2") for module in ("otf2", "otf2.enums"))
    spans, sends, receives = _by_rank(trace)
    roles = {"compute": enums.RegionRole.FUNCTION, "exchange": enums.RegionRole.POINT2POINT}
    mpi = {"paradigm": enums.Paradigm.MPI}
    with otf2.writer.open(str(folder), timer_resolution=_NANOSECONDS) as archive:
        known = archive.definitions
        machine = known.system_tree_node("formation", class_name="machine")
        locations = []
        for rank in range(trace["mp2a"]["n"]):
            name = f"robot {rank + 1}"
            locations.append(known.location(name, group=known.location_group(name, system_tree_parent=machine)))
        members = tuple(locations)
        known.group("ranks", group_type=enums.GroupType.COMM_LOCATIONS, members=members, **mpi)
        chain = known.group("chain", group_type=enums.GroupType.COMM_GROUP, members=members, **mpi)
        comm = known.comm("chain", group=chain)
        for rank, location in enumerate(locations):
            writer = archive.event_writer_from_location(location)
            for span in spans[rank]:
                began, ended = _nanoseconds(span["ts"]), _nanoseconds(span["ts"] + span["dur"])
                region = known.region(span["name"], region_role=roles[span["cat"]])
                key = rank, span["args"]["recurrence"], span["args"]["round"]
                exchanged = span["cat"] == "exchange"
                writer.enter(began, region)
                for message in sends[key] if exchanged else ():
                    writer.mpi_send(began, message.target, comm, message.round, message.bytes)
                for message in receives[key] if exchanged else ():
                    writer.mpi_recv(ended, message.source, comm, message.round, message.bytes)
                writer.leave(ended, region)


class _Message(NamedTuple):
    source: int
    target: int
    round: int
    bytes: int


_Messages = dict[tuple[int, str, int], list[_Message]]
"""By rank, recurrence and round."""


def _by_rank(trace: Mapping[str, Any]) -> tuple[dict[int, list[Mapping[str, Any]]], _Messages, _Messages]:
    """Return the spans of each rank, in order, and the messages of each of its exchanges, sent and received."""
    spans, sends, receives = defaultdict(list), defaultdict(list), defaultdict(list)
    targets = {event["id"]: event["tid"] for event in trace["traceEvents"] if event["ph"] == "f"}
    for event in trace["traceEvents"]:
        if event["ph"] == "X":
            spans[event["tid"]].append(event)
        elif event["ph"] == "s":
            about = event["args"]
            message = _Message(event["tid"], targets[event["id"]], about["round"], about["bytes"])
            sends[message.source, event["name"], message.round].append(message)
            receives[message.target, event["name"], message.round].append(message)
    return spans, sends, receives


def _nanoseconds(microseconds: float) -> int:
    return round(1e3 * microseconds)
