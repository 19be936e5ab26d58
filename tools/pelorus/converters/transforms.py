# SPDX-License-Identifier: MIT
"""The poses of a robot's frames, by a bag's /tf_static and by the links of /tf that never move.

A transform is the pose of its child in its parent: p_parent = R p_child + t. Each child has one
parent, so two frames are joined by one chain or by none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pelorus.errors import PelorusError
from pelorus.math import se3
from pelorus.math.se3 import IDENTITY, Poses
from pelorus.program.console import progress

if TYPE_CHECKING:
    from pelorus.converters.bag import Bag

TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
STATIC = "tf_static"
SAME = 1e-4  # m and rad: difference of two messages on one mounting
FRAMES_SHOWN = 20
OPTICAL = "optical"  # in the name of a frame whose z looks forward (REP 103)


class FrameLink(NamedTuple):
    """A link to the parent of a frame."""

    parent: str
    T: Poses


class Chain(NamedTuple):
    """A chain of links: q = T s maps points of the first frame to the last one."""

    T: Poses
    frames: tuple[str, ...]

    @property
    def words(self) -> str:
        return " - ".join(self.frames)


def bare(frame: str) -> str:
    """Returns the name without the leading slash of ROS 1's tf."""
    return frame.strip().lstrip("/")


class Tree:
    """The links by child; no chain may use those in `moving` and `double`.

    /tf is long, and read only where /tf_static does not suffice.
    """

    def __init__(self, bag: Bag) -> None:
        self.bag = bag
        self.links: dict[str, FrameLink] = {}
        self.moving: dict[str, str] = {}
        self.double: dict[str, set[str]] = {}
        topics = bag.of_type(*TF)
        self._unread = [topic for topic in topics if topic.rpartition("/")[2] != STATIC]
        self._read([topic for topic in topics if topic not in self._unread], is_static=True)

    def _read(self, topics: list[str], is_static: bool) -> None:
        found = self.bag.messages(topics, whole=True) if topics else ()
        for stamped in progress(found, "reading transforms", self.bag.count(topics)):
            for one in stamped.message.transforms:
                self._add(one, is_static)

    def knows(self, *frames: str) -> bool:
        """Returns whether all these frames are known."""
        if not self.frames.issuperset(frames) and self._unread:
            unread, self._unread = self._unread, []
            self._read(unread, is_static=False)
        return self.frames.issuperset(frames)

    def _add(self, stamped: Any, is_static: bool) -> None:
        child, parent = bare(stamped.child_frame_id), bare(stamped.header.frame_id)
        t, q = stamped.transform.translation, stamped.transform.rotation
        quaternion = np.array([q.x, q.y, q.z, q.w])
        p = np.array([t.x, t.y, t.z])
        norm = np.linalg.norm(quaternion)
        if child == parent or not np.isfinite(p).all() or not 0.9 < norm < 1.1:
            return
        link = FrameLink(parent, Poses.of_quaternions(quaternion, p))
        known = self.links.setdefault(child, link)
        if known.parent == parent and _same(known.T, link.T):
            return
        if is_static:
            self.double.setdefault(child, {known.parent}).add(parent)
        else:
            self.moving[child] = parent

    def chain(self, first: str, last: str) -> Chain:
        """Returns the chain between two frames; raises with a reason if there is none."""
        up, down = self._ancestors(first), self._ancestors(last)
        if up[-1] != down[-1] and self._unread:
            self.knows("")  # reads the rest
            up, down = self._ancestors(first), self._ancestors(last)
        meeting = next((frame for frame in up if frame in down), None)
        if meeting is None:
            raise PelorusError(
                f"{self.bag.path}: no chain of transforms joins {first!r} and {last!r}: they end "
                f"at {up[-1]!r} and at {down[-1]!r}; --extrinsic FILE is expected, or --body-frame "
                f"and --camera-frame, one of {self.listing}"
            )
        up, down = up[: up.index(meeting) + 1], down[: down.index(meeting)]
        for child in (*up[:-1], *down):
            self._require_firm(child)
        T = IDENTITY
        for child in up[:-1]:
            T = se3.compose(self.links[child].T, T)
        for child in reversed(down):
            T = se3.compose(se3.inverse(self.links[child].T), T)
        return Chain(T, (*up, *reversed(down)))

    def _ancestors(self, frame: str) -> list[str]:
        if not self.knows(frame):
            raise PelorusError(
                f"{self.bag.path}: no transform of /tf_static has the frame {frame!r}; --extrinsic "
                f"FILE is expected, or --body-frame and --camera-frame, one of {self.listing}"
            )
        found = [frame]
        while found[-1] in self.links and self.links[found[-1]].parent not in found:
            found.append(self.links[found[-1]].parent)
        return found

    def _require_firm(self, child: str) -> None:
        parent = self.links[child].parent
        if child in self.double:
            said = " and ".join(sorted(self.double[child]))
            raise PelorusError(
                f"{self.bag.path}: /tf_static says twice, and differently, where {child!r} stands "
                f"(in {said}); --extrinsic FILE is expected"
            )
        if child in self.moving:
            raise PelorusError(
                f"{self.bag.path}: {parent!r} to {child!r} moves (/tf), so it tells no mounting; "
                "--extrinsic FILE is expected, or --body-frame on the camera's side of it"
            )

    def optical_of(self, frame: str) -> list[str]:
        """Returns the frames that only turn this one, as a camera's optical frame does."""
        return [
            child
            for child, link in self.links.items()
            if link.parent == frame and OPTICAL in child and np.abs(link.T.p).max() < SAME
        ]

    @property
    def frames(self) -> set[str]:
        return {*self.links, *(link.parent for link in self.links.values())}

    @property
    def listing(self) -> str:
        known = sorted(self.frames)
        more = f" and {len(known) - FRAMES_SHOWN} more" if len(known) > FRAMES_SHOWN else ""
        return (", ".join(known[:FRAMES_SHOWN]) or "none") + more


def _same(one: Poses, other: Poses) -> bool:
    return bool(np.abs(one.R - other.R).max() < SAME and np.abs(one.p - other.p).max() < SAME)
