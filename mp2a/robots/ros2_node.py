"""Topics of ROS 2 by DDS itself: no ROS installation is needed. Without numpy, for the watchdog needs none."""

import os
from typing import Any

from mp2a.exceptions import MissingError

_SECOND = 1_000_000_000


class Node:
    """Reads and writes topics as a node of ROS 2 does; the domain is that of ``ROS_DOMAIN_ID``.

    Raises
    ------
    MissingError
        If cyclonedds is not installed, or its settings (``CYCLONEDDS_URI``) do not work here.
    """

    def __init__(self) -> None:
        try:
            from cyclonedds.core import DDSException
            from cyclonedds.domain import DomainParticipant
        except ImportError as error:
            raise MissingError(f"ROS 2: {error}; pip install 'mp2a[ros2]'") from error
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        if not domain.isdigit():
            raise MissingError(f"ROS 2: ROS_DOMAIN_ID is {domain!r}, expected a whole number")
        try:
            self._participant = DomainParticipant(int(domain))
        except DDSException as error:
            raise MissingError(f"ROS 2: DDS does not start ({error}); is CYCLONEDDS_URI right?") from error

    def writer(self, topic: str, kind: Any) -> Any:
        """Return a writer of a topic; ``writer.write(message)``."""
        from cyclonedds.pub import DataWriter

        return DataWriter(self._participant, self._topic(topic, kind), _quality(reliable=True))

    def reader(self, topic: str, kind: Any, depth: int = 1, reliable: bool = False, own: bool = True) -> Any:
        """Return a reader of a topic, for `take`.

        One that is not reliable takes what either kind sends. Without ``own`` it does not hear this node itself.
        """
        from cyclonedds.core import Policy, Qos
        from cyclonedds.sub import DataReader

        quality = _quality(reliable, depth)
        if not own:
            quality = Qos(Policy.IgnoreLocal.Participant, base=quality)
        return DataReader(self._participant, self._topic(topic, kind), quality)

    def _topic(self, topic: str, kind: Any) -> Any:
        from cyclonedds.topic import Topic

        return Topic(self._participant, f"rt/{topic.lstrip('/')}", kind)


def _quality(reliable: bool, depth: int = 10) -> Any:
    """Those of ROS 2's defaults; its types are in the plain old representation."""
    from cyclonedds.core import Policy, Qos

    return Qos(
        Policy.Reliability.Reliable(max_blocking_time=_SECOND // 10) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


def take(reader: Any) -> list[Any]:
    """Messages that have come since the last call, oldest first; never waits."""
    return [sample for sample in reader.take(N=1000) if sample.sample_info.valid_data]
