"""Topics of ROS 2 by DDS itself: no ROS installation is needed. Without numpy, for the watchdog needs none."""

import os
from typing import Any

from mp2a.exceptions import DependencyError

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


class Node:
    """Reads and writes topics as a node of ROS 2 does; the domain is that of ``ROS_DOMAIN_ID``.

    Settings in ``CYCLONEDDS_URI`` hold as usual. Type descriptions of Fast DDS are not looked at.

    Raises
    ------
    DependencyError
        If cyclonedds is not installed, or its settings (``CYCLONEDDS_URI``) do not work here.
    """

    def __init__(self) -> None:
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

    def writer(self, topic: str, kind: Any, kept: bool = False) -> Any:
        """Return a writer of a topic; ``writer.write(message)``. What is kept reaches those who come later, too."""
        from cyclonedds.pub import DataWriter

        return DataWriter(self._participant, self._topic(topic, kind), _quality(True, 1 if kept else 10, kept))

    def reader(
        self, topic: str, kind: Any, depth: int = 1, reliable: bool = False, kept: bool = False, own: bool = True
    ) -> Any:
        """Return a reader of a topic, for `take`.

        One that is not reliable takes what either kind sends. Without ``own`` it does not hear this node itself.
        """
        from cyclonedds.core import Policy, Qos
        from cyclonedds.sub import DataReader

        quality = _quality(reliable, depth, kept)
        if not own:
            quality = Qos(Policy.IgnoreLocal.Participant, base=quality)
        return DataReader(self._participant, self._topic(topic, kind), quality)

    def _topic(self, topic: str, kind: Any) -> Any:
        from cyclonedds.topic import Topic

        return Topic(self._participant, f"rt/{topic.lstrip('/')}", kind)


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
    """Those of ROS 2's defaults; its types are in the plain old representation."""
    from cyclonedds.core import Policy, Qos

    return Qos(
        Policy.Reliability.Reliable(max_blocking_time=_SECOND // 10) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if kept else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


def take(reader: Any) -> list[Any]:
    """Messages that have come since the last call, oldest first; never waits."""
    return [sample for sample in reader.take(N=1000) if sample.sample_info.valid_data]
