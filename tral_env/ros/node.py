"""A node of ROS 2 on Cyclone DDS: topics by their ROS names, the clock, the log, and the graph that `ros2` shows."""

from __future__ import annotations

import logging
import os
import re
import time
from typing import Generic, TypeVar

from cyclonedds.core import DDSException, Entity, Policy, Qos, ReadCondition, SampleState, WaitSet
from cyclonedds.core import InstanceState as Instance
from cyclonedds.core import ViewState as View
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from tral_env.errors import ConfigError, HardwareError
from tral_env.ros.definition import type_hash
from tral_env.ros.msg.graph import Gid, NodeEntitiesInfo, ParticipantEntitiesInfo
from tral_env.ros.msg.std import Clock, Log
from tral_env.ros.qos import CLOCK, GRAPH, LOG, Profile
from tral_env.ros.times import nanoseconds, seconds_ns, stamp

MAX_DOMAIN = 232
"""Domains above have no port."""
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_UNREAD = SampleState.NotRead | Instance.Any | View.Any
INFO, WARN, ERROR = 20, 30, 40
"""Levels of rcl_interfaces/msg/Log."""
M = TypeVar("M", bound=IdlStruct)


def domain_id() -> int:
    """The domain that the environment variable ROS_DOMAIN_ID names; 0 without it.

    Raises:
        ConfigError: it is no whole number in 0 to 232.
    """
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if not text.isdecimal() or int(text) > MAX_DOMAIN:
        raise ConfigError(f"ROS_DOMAIN_ID = {text!r}: expected a whole number, 0 to {MAX_DOMAIN}")
    return int(text)


def check_namespace(namespace: str) -> str:
    """A namespace with its leading slash, such as /car1; the root is "/".

    Raises:
        ConfigError: a part is no name of ROS.
    """
    parts = [part for part in namespace.strip("/").split("/") if part]
    if any(_NAME.fullmatch(part) is None for part in parts):
        raise ConfigError(f"namespace = {namespace!r}: expected names of letters, digits and _, such as /car1")
    return "/" + "/".join(parts)


class Publisher(Generic[M]):
    """Sends messages of a topic."""

    def __init__(self, writer: DataWriter[M]) -> None:
        """Send by this writer."""
        self._writer = writer
        self.sent = 0
        """Number of messages until now."""

    @property
    def listeners(self) -> int:
        """Number of subscriptions that hear it now."""
        return len(self._writer.get_matched_subscriptions())

    def publish(self, message: M) -> None:
        """Send a message; one that cannot be sent in time is lost, as the profile says."""
        try:
            self._writer.write(message)
        except DDSException as error:
            if error.code != DDSException.DDS_RETCODE_TIMEOUT:
                raise
        self.sent += 1


class Subscription(Generic[M]):
    """Hears messages of a topic."""

    def __init__(self, reader: DataReader[M], depth: int) -> None:
        """Hear by this reader."""
        self._reader, self._depth = reader, depth

    def take(self) -> list[M]:
        """All messages that came since the last call, the oldest first."""
        return [message for message in self._reader.take(self._depth) if hasattr(message, "serialize")]

    @property
    def publishers(self) -> int:
        """Number of publishers that it hears now."""
        return len(self._reader.get_matched_publications())

    @property
    def alive(self) -> int:
        """Number of publishers that it hears now and whose process lives."""
        return int(self._reader.get_liveliness_changed_status().alive_count)

    @property
    def is_dead(self) -> bool:
        """Whether the processes of all its publishers are dead or cut off; one that left in order is not among them."""
        status = self._reader.get_liveliness_changed_status()
        return int(status.alive_count) == 0 and int(status.not_alive_count) > 0

    @property
    def lost(self) -> int:
        """Number of messages that were sent and never came, or were pushed out by newer ones."""
        return int(self._reader.get_sample_lost_status().total_count)


class Node:
    """One node: a participant of its own, as a process has in ROS 2.

    It waits by a wait set, not by a listener: a listener is called with locks of Cyclone DDS held, and would wait for
    Python's lock while a thread that has that one writes to the same topic and waits for those.
    """

    def __init__(
        self, name: str, *, namespace: str = "", use_sim_time: bool = False, clock_topic: str = "/clock"
    ) -> None:
        """Join the domain.

        Args:
            name: of the node, such as "car".
            namespace: before all names that do not begin with a slash.
            use_sim_time: whether the time is that of the topic /clock, and not the computer's.

        Raises:
            ConfigError: a name or the domain is none.
            HardwareError: DDS does not start here: no network, or a wrong CYCLONEDDS_URI.
        """
        if _NAME.fullmatch(name) is None:
            raise ConfigError(f"node = {name!r}: expected a name of letters, digits and _")
        self.name, self.namespace = name, check_namespace(namespace)
        self.use_sim_time = use_sim_time
        try:
            self._participant = DomainParticipant(domain_id(), qos=Qos(Policy.Userdata(b"enclave=/;")))
        except DDSException as error:
            raise HardwareError(
                f"DDS does not start in the domain {domain_id()}: {error} Look at the network and at CYCLONEDDS_URI"
            ) from error
        self._readers: list[Entity] = []
        self._writers: list[Entity] = []
        self._wakes = WaitSet(self._participant)
        self._graph = self._writer("ros_discovery_info", ParticipantEntitiesInfo, GRAPH)
        self._log = self.publisher("/rosout", Log, LOG)
        self._clock = self.subscription("/clock", Clock, CLOCK) if use_sim_time else None
        self._sim_ns = 0

    @property
    def full_name(self) -> str:
        """Name with its namespace, such as /car1/fsm."""
        return f"{self.namespace.rstrip('/')}/{self.name}"

    def resolve(self, topic: str) -> str:
        """The full name of a topic: "scan" is /car1/scan in the namespace /car1; "~/x" is below the node."""
        if topic.startswith("~/"):
            return f"{self.full_name}/{topic[2:]}"
        return topic if topic.startswith("/") else f"{self.namespace.rstrip('/')}/{topic}"

    def publisher(self, topic: str, kind: type[M], profile: Profile) -> Publisher[M]:
        """Begin to send a topic."""
        writer = self._writer(f"rt{self.resolve(topic)}", kind, profile)
        self._writers.append(writer)
        self._tell_graph()
        return Publisher(writer)

    def subscription(self, topic: str, kind: type[M], profile: Profile, *, wakes: bool = False) -> Subscription[M]:
        """Begin to hear a topic.

        Args:
            topic: its name.
            kind: type of its messages.
            profile: how they come.
            wakes: whether a message that was not taken yet ends a `wait`.
        """
        described = Topic(self._participant, f"rt{self.resolve(topic)}", kind)
        reader = DataReader(self._participant, described, profile.qos(_hash_of(kind)))
        if wakes:
            self._wakes.attach(ReadCondition(reader, _UNREAD))
        self._readers.append(reader)
        self._tell_graph()
        return Subscription(reader, profile.depth)

    def wait(self, seconds: float) -> bool:
        """Wait until a subscription that wakes has a message that was not taken; whether one has."""
        return self._wakes.wait(seconds_ns(max(seconds, 0.0))) > 0

    def now_ns(self) -> int:
        """The time of ROS: that of the computer, or of /clock; 0 before the first one."""
        if self._clock is None:
            return time.time_ns()
        for message in self._clock.take():
            self._sim_ns = nanoseconds(message.clock)
        return self._sim_ns

    def log(self, text: str, level: int = INFO) -> None:
        """Tell something on /rosout, and to the logger of Python of this name, whose levels are the same."""
        name = self.full_name.strip("/").replace("/", ".")
        self._log.publish(Log(stamp=stamp(self.now_ns()), level=level, name=name, msg=text))
        logging.getLogger(f"tral.ros.{name}").log(level, text)

    def close(self) -> None:
        """Leave the domain: others know it at once."""
        self._participant._delete(self._participant._ref)  # and all that it holds
        conditions = self._wakes.get_entities()
        for entity in (*self._readers, *self._writers, *conditions, self._wakes, self._graph, self._participant):
            Entity._entities.pop(entity._ref, None)
        self._wakes.attached.clear()
        self._readers, self._writers = [], []

    def _writer(self, topic: str, kind: type[M], profile: Profile) -> DataWriter[M]:
        return DataWriter(self._participant, Topic(self._participant, topic, kind), profile.qos(_hash_of(kind)))

    def _tell_graph(self) -> None:
        """Say which readers and writers are those of this node."""
        node = NodeEntitiesInfo(
            node_namespace=self.namespace,
            node_name=self.name,
            reader_gid_seq=[_gid(reader) for reader in self._readers],
            writer_gid_seq=[_gid(writer) for writer in self._writers],
        )
        self._graph.write(ParticipantEntitiesInfo(gid=_gid(self._participant), node_entities_info_seq=[node]))


def _gid(entity: Entity) -> Gid:
    return Gid(data=list(entity.guid.bytes))


def _hash_of(kind: type[IdlStruct]) -> bytes:
    return f"typehash={type_hash(kind)};".encode()
