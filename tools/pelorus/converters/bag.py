# SPDX-License-Identifier: MIT
"""Opens a ROS 1 or ROS 2 bag: .bag, a folder with metadata.yaml, .mcap, .db3."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack
from functools import cached_property, partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple

from pelorus.converters.transforms import Tree
from pelorus.errors import PelorusError
from pelorus.io.foreign import ForeignFileError
from pelorus.program.extras import extra

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

NS = 10**9
PERIOD_NS = 1000 << 32  # of a 32-bit counter of microseconds
ACROSS_NS = NS  # longest pause of a stream across which a wrap is recognised
HEADER, LOG = "header", "log"
WHOLE = (0.0, math.inf)


class Stamped(NamedTuple):
    """A message with its time in ns."""

    topic: str
    t_ns: int
    message: Any
    arrival_ns: int


class Bag(AbstractContextManager["Bag"]):
    """An open bag.

    `stamps`: whether a message's time is its header's or its arrival; `part`: which messages are
    read, by their arrival, s since the bag's beginning. `remarks` are on what was read of it.
    """

    def __init__(self, path: Path, stamps: str = HEADER, part: tuple[float, float] = WHOLE) -> None:
        self.path, self.stamps = path, stamps
        if not path.exists():
            raise ForeignFileError(path, "there is no such file or folder")
        if path.is_dir() and not (path / "metadata.yaml").is_file():
            raise ForeignFileError(
                path,
                "is a folder without metadata.yaml; a ROS 1 bag (.bag), a ROS 2 bag (a folder with "
                "metadata.yaml), a .mcap or a .db3 is expected (ros2 bag reindex makes a "
                "metadata.yaml)",
            )
        self._open_files = ExitStack()
        self._reader = self._opened()
        self._seconds = max(self._reader.duration, 1) / NS
        self.begins_ns = int(self._reader.start_time)
        self._part_s = part
        self.wrapped: dict[str, None] = {}  # topics whose counter wrapped
        self.remarks: list[str] = []

    def _opened(self) -> AnyReader:
        with extra("rosbags"):
            from rosbags.highlevel import AnyReader  # noqa: PLC0415 - an extra
            from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
        try:
            # bags from before ROS 2 iron hold no definitions
            store = get_typestore(Stores.ROS2_HUMBLE)
            return self._open_files.enter_context(AnyReader([self.path], default_typestore=store))
        except Exception as error:  # the readers raise a dozen kinds on damaged files
            raise self._unreadable(error) from error

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._open_files.close()

    @cached_property
    def tree(self) -> Tree:
        """Returns the poses of the robot's frames."""
        return Tree(self)

    def where(self, topic: str) -> Path:
        """Returns the bag with the topic, as a path for messages to the user."""
        return self.path / topic.lstrip("/")

    def error(self, topic: str, what: str) -> ForeignFileError:
        """Returns an error in the messages of a topic."""
        return ForeignFileError(self.path, what, at=topic)

    @property
    def types(self) -> dict[str, str]:
        """Returns the message types by topic."""
        return {name: info.msgtype or "mixed types" for name, info in self._reader.topics.items()}

    def of_type(self, *kinds: str) -> list[str]:
        """Returns the topics with messages of these types, which are written as in ROS 2."""
        topics = self._reader.topics
        return [
            name for name, kind in self.types.items() if kind in kinds and topics[name].msgcount
        ]

    def require(self, topic: str, *kinds: str) -> str:
        """Returns the topic if it holds messages of such a type; raises PelorusError otherwise."""
        if topic not in self.types:
            raise PelorusError(f"{self.path}: has no topic {topic}; {self.listing()}")
        if self.types[topic] not in kinds or topic not in self.of_type(*kinds):
            raise PelorusError(
                f"{self.path}: {topic} holds {self._reader.topics[topic].msgcount} messages of "
                f"{self.types[topic]}; some of {' or '.join(kinds)} are expected"
            )
        return topic

    def listing(self) -> str:
        """Returns the topics with types and rates, in words."""
        lines = [
            f"    {name}  {info.msgtype}  {info.msgcount} messages, "
            f"{max(info.msgcount - 1, 0) / self._seconds:.3g} Hz"
            for name, info in sorted(self._reader.topics.items())
        ]
        return "there are:\n" + ("\n".join(lines) or "    none")

    def count(self, topics: Sequence[str]) -> int:
        """Returns the number of messages of these topics."""
        return sum(self._reader.topics[topic].msgcount for topic in topics)

    def messages(self, topics: Sequence[str], whole: bool = False) -> Iterator[Stamped]:
        """Yields messages in the order of arrival; `whole`: of all the bag, not of the part."""
        return self._messages(self._reader, topics, whole)

    def written(self, topics: Sequence[str]) -> Iterator[Stamped]:
        """Yields messages in the order of the file, whatever the recorder's clock said."""
        return self._messages(self._by_place, topics)

    @cached_property
    def _by_place(self) -> AnyReader:
        reader = self._opened()
        for one in reader.readers:
            _keep_order(one)
        return reader

    def _messages(
        self, reader: AnyReader, topics: Sequence[str], whole: bool = False
    ) -> Iterator[Stamped]:
        wanted = [c for c in reader.connections if c.topic in topics]
        first_s, last_s = self._part_s
        latest: dict[str, int] = {}
        try:
            for connection, arrival_ns, raw in reader.messages(wanted):
                if not whole and not first_s <= (arrival_ns - self.begins_ns) / NS <= last_s:
                    continue
                message: Any = reader.deserialize(raw, connection.msgtype)
                t_ns = self._time(message, arrival_ns)
                if self.stamps == HEADER:
                    t_ns = self._unwrapped(connection.topic, t_ns, latest)
                yield Stamped(connection.topic, t_ns, message, arrival_ns)
        except PelorusError:
            raise
        except Exception as error:
            raise self._unreadable(error) from error

    def _time(self, message: Any, arrival_ns: int) -> int:
        if self.stamps == LOG or not hasattr(message, "header"):
            return arrival_ns
        stamp = message.header.stamp
        return int(stamp.sec) * NS + int(stamp.nanosec)

    def _unwrapped(self, topic: str, t_ns: int, latest: dict[str, int]) -> int:
        """Returns the time of a 32-bit counter of microseconds that wraps during the drive.

        A stamp within ACROSS_NS of the latest one, up to whole periods, is moved by these.
        """
        before = latest.get(topic, t_ns)
        if t_ns < PERIOD_NS:
            turns = round((before - t_ns) / PERIOD_NS)
            if turns > 0 and abs(t_ns + turns * PERIOD_NS - before) < ACROSS_NS:
                t_ns += turns * PERIOD_NS
                self.wrapped[topic] = None
        latest[topic] = t_ns
        return t_ns

    def _unreadable(self, error: Exception) -> ForeignFileError:
        words = (str(error).splitlines() or [type(error).__name__])[0]
        return ForeignFileError(
            self.path,
            f"cannot be read as a bag: {words}; a whole ROS 1 bag, ROS 2 bag or .mcap is expected "
            "(rosbag reindex, ros2 bag reindex or mcap recover mend one that was cut short)",
        )


# --- order ----------------------------------------------------------------------------------------


def _keep_order(reader: Any) -> None:
    """Makes the library return messages as they stand in the file; it sorts them by arrival."""
    from rosbags.rosbag1 import Reader as Reader1  # noqa: PLC0415 - an extra
    from rosbags.rosbag2.storage_mcap import McapReader  # noqa: PLC0415
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader  # noqa: PLC0415

    if isinstance(reader, Reader1):
        for index in reader.indexes.values():
            index.sort(key=lambda entry: (entry.chunk_pos, entry.offset))
        return
    for storage in getattr(reader.storage, "storages", [reader.storage]):
        if isinstance(storage, McapReader):
            storage.__dict__["messages"] = storage.messages_scan
        elif isinstance(storage, Sqlite3Reader):
            storage.__dict__["messages"] = partial(_rows_by_id, storage)


def _rows_by_id(
    storage: Sqlite3Reader, connections: Collection[Connection], *_: int | None
) -> Iterator[tuple[Connection, int, bytes]]:
    of_id = {connection.id: connection for connection in connections}
    assert storage.dbconn
    rows = storage.dbconn.execute(
        "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN "
        f"({','.join('?' * len(of_id))}) ORDER BY id",
        tuple(of_id),
    )
    for id, t_ns, packed in rows:
        yield of_id[id], t_ns, packed
