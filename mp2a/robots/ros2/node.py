"""A node of ROS 2, by DDS itself: no ROS installation is needed. Without numpy, for the watchdog needs none."""

import os
import time
from collections.abc import Callable
from typing import Any

from mp2a.exceptions import DependencyError
from mp2a.robots.ros_backend import Take, TopicWriter

_SECOND = 1_000_000_000
_FAST_DDS = "1.15"
"""A maker of DDS by its number in the protocol. Version 3 (ROS 2 Kilted) describes arrays and sequences with flags that
the standard calls invalid; Cyclone DDS then refuses the topic. Without descriptions, types are matched by name alone,
as all of ROS 2 did before."""
_RECEIVE_BUFFER = "8MB"
"""Asked of the kernel, which may give less. A cloud of 130 000 points is 2 MB at once; with the default of 1 MB half of
such clouds were lost here, where nobody repeats them."""
_SETTINGS = (
    f"<CycloneDDS><Domain><Compatibility><IgnoreTypeInformation>{_FAST_DDS}</IgnoreTypeInformation></Compatibility>"
    f'<Internal><SocketReceiveBufferSize max="{_RECEIVE_BUFFER}"/></Internal></Domain></CycloneDDS>'
)
_domains: dict[int, Any] = {}
"""Of this process; settings are made once for each, and end with it."""


class Ros2Node:
    """Reads and writes topics as a node of ROS 2 does; the domain is that of ``ROS_DOMAIN_ID``.

    Settings in ``CYCLONEDDS_URI`` hold as usual. Type descriptions of Fast DDS are not looked at.

    Raises
    ------
    DependencyError
        If cyclonedds is not installed, or its settings (``CYCLONEDDS_URI``) do not work here.
    """

    name = "ROS 2"

    def __init__(self, role: str) -> None:
        try:
            from cyclonedds.core import DDSException
            from cyclonedds.domain import DomainParticipant
        except ImportError as error:
            raise DependencyError(f"ROS 2: {error}; pip install 'mp2a[ros2]'") from error
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        if not domain.isdigit():
            raise DependencyError(f"ROS 2: ROS_DOMAIN_ID is {domain!r}, expected a whole number")
        try:
            _set_up(int(domain))
            self._participant = DomainParticipant(int(domain))
        except (DDSException, UnicodeEncodeError) as error:
            why = f"({error}); are CYCLONEDDS_URI and ROS_DOMAIN_ID right?"
            raise DependencyError(f"ROS 2: DDS does not start {why}") from error

    def message(self, kind: str) -> Any:
        """Return the class of a type of messages."""
        from mp2a.robots.ros2.messages import ROS2_MESSAGES

        return ROS2_MESSAGES[kind]

    def header(self, frame: str) -> Any:
        """Return a ``std_msgs/Header`` of now."""
        stamp = self.message("builtin_interfaces/msg/Time")(*divmod(time.time_ns(), _SECOND))
        return self.message("std_msgs/msg/Header")(stamp, frame)

    def clock(self) -> float:
        """Return the time that stamps go by, s."""
        return time.time()

    def writer(self, topic: str, kind: str, *, depth: int = 10, kept: bool = False) -> TopicWriter:
        """Open a topic for writing."""
        from cyclonedds.pub import DataWriter

        message, quality = self.message(kind), _quality(True, 1 if kept else depth, kept)
        opened = DataWriter(self._participant, self._topic(topic, message), quality)
        return TopicWriter(
            lambda *fields: opened.write(message(*fields)), lambda: len(opened.get_matched_subscriptions())
        )

    def reader(
        self, topic: str, kind: str, *, depth: int = 1, kept: bool = False, reliable: bool = False, own: bool = True
    ) -> Take:
        """Open a topic for reading; one that is not reliable takes what either kind sends."""
        from cyclonedds.core import Policy, Qos
        from cyclonedds.sub import DataReader

        quality = _quality(reliable, depth, kept)
        if not own:
            quality = Qos(Policy.IgnoreLocal.Participant, base=quality)
        opened = DataReader(self._participant, self._topic(topic, self.message(kind)), quality)

        def take() -> list[tuple[float, Any]]:
            now = time.monotonic()
            return [(now, sample) for sample in opened.take(N=1000) if sample.sample_info.valid_data]

        return take

    def acquire(self, topic: str, acquire: str, release: str) -> Callable[[], None]:
        """Refuse: ROS 2 has no such mux."""
        raise DependencyError(f"ROS 2: acquire: got {acquire}, expected none; muxes that must be asked are ROS 1's")

    def close(self) -> None:
        """Hold nothing: DDS lets go when the process ends."""

    def _topic(self, topic: str, message: Any) -> Any:
        from cyclonedds.topic import Topic

        return Topic(self._participant, f"rt/{topic.lstrip('/')}", message)


def _set_up(number: int) -> None:
    """Begin a domain with our settings, and the user's, which win; one that this process has already stays as it is."""
    from cyclonedds.core import DDSException
    from cyclonedds.domain import Domain

    if number in _domains:
        return
    try:
        _domains[number] = Domain(number, ",".join(filter(None, (_SETTINGS, os.environ.get("CYCLONEDDS_URI")))))
    except DDSException as error:
        if error.code != DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
            raise


def _quality(reliable: bool, depth: int, kept: bool) -> Any:
    """Return those of ROS 2's defaults; its types are in the plain old representation."""
    from cyclonedds.core import Policy, Qos

    return Qos(
        Policy.Reliability.Reliable(max_blocking_time=_SECOND // 10) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if kept else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )
