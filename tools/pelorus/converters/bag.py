# SPDX-License-Identifier: MIT
"""A ROS 1 or ROS 2 bag, opened: .bag, a folder with metadata.yaml, .mcap, .db3."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from pelorus.errors import PelorusError
from pelorus.foreign import ForeignFileError

NS = 10**9
HEADER, LOG = "header", "log"


class Stamped(NamedTuple):
    """A message with its time in ns."""

    topic: str
    t_ns: int
    message: Any


def require_messages(bag: Bag, topic: str, count: int) -> None:
    """Refuse a topic of which nothing can be read, whatever the bag's index says."""
    if not count:
        raise ForeignFileError(bag.path, "no message can be read", at=topic)


class Bag(AbstractContextManager["Bag"]):
    """`stamps`: whether a message's time is that of its header or of its arrival in the bag."""

    def __init__(self, path: Path, stamps: str = HEADER) -> None:
        self.path, self.stamps = path, stamps
        if not path.exists():
            raise ForeignFileError(path, "there is no such file or folder")
        if path.is_dir() and not (path / "metadata.yaml").is_file():
            raise ForeignFileError(
                path,
                "is a folder without metadata.yaml",
                due="a ROS 1 bag (.bag), a ROS 2 bag (a folder with metadata.yaml), a .mcap or a "
                ".db3 is due (ros2 bag reindex makes a metadata.yaml)",
            )
        try:
            # bags of before ROS 2 iron hold no definitions
            self._reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
            self._reader.open()
        except Exception as error:  # the readers raise a dozen kinds on damaged files
            raise self._unreadable(error) from error
        self._seconds = max(self._reader.duration, 1) / NS

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._reader.close()

    @property
    def types(self) -> dict[str, str]:
        """Of the messages, by topic."""
        return {name: info.msgtype or "mixed types" for name, info in self._reader.topics.items()}

    def of_type(self, *kinds: str) -> list[str]:
        """The topics with messages of these types, in ROS 2's way of writing them."""
        topics = self._reader.topics
        return [
            name for name, kind in self.types.items() if kind in kinds and topics[name].msgcount
        ]

    def require(self, topic: str, *kinds: str) -> str:
        """The topic, if it is there and holds messages of such a type."""
        if topic not in self.types:
            raise PelorusError(f"{self.path}: has no topic {topic}; {self.listing()}")
        if self.types[topic] not in kinds or topic not in self.of_type(*kinds):
            raise PelorusError(
                f"{self.path}: {topic} holds {self._reader.topics[topic].msgcount} messages of "
                f"{self.types[topic]}; some of {' or '.join(kinds)} are due"
            )
        return topic

    def listing(self) -> str:
        """Topics with types and rates."""
        lines = [
            f"    {name}  {info.msgtype}  {info.msgcount} messages, "
            f"{max(info.msgcount - 1, 0) / self._seconds:.3g} Hz"
            for name, info in sorted(self._reader.topics.items())
        ]
        return "there are:\n" + ("\n".join(lines) or "    none")

    def count(self, topics: Sequence[str]) -> int:
        """Of their messages."""
        return sum(self._reader.topics[topic].msgcount for topic in topics)

    def messages(self, topics: Sequence[str]) -> Iterator[Stamped]:
        """In the order of their arrival."""
        wanted = [c for c in self._reader.connections if c.topic in topics]
        try:
            for connection, arrival_ns, raw in self._reader.messages(wanted):
                message: Any = self._reader.deserialize(raw, connection.msgtype)
                yield Stamped(connection.topic, self._time(message, arrival_ns), message)
        except PelorusError:
            raise
        except Exception as error:
            raise self._unreadable(error) from error

    def _time(self, message: Any, arrival_ns: int) -> int:
        if self.stamps == LOG or not hasattr(message, "header"):
            return arrival_ns
        stamp = message.header.stamp
        return int(stamp.sec) * NS + int(stamp.nanosec)

    def _unreadable(self, error: Exception) -> ForeignFileError:
        words = (str(error).splitlines() or [type(error).__name__])[0]
        return ForeignFileError(
            self.path,
            f"cannot be read as a bag: {words}",
            due="a whole ROS 1 bag, ROS 2 bag or .mcap is due (rosbag reindex, ros2 bag reindex or "
            "mcap recover mend one that was cut short)",
        )
