# SPDX-License-Identifier: MIT
"""Where the frames of the robot stand, as /tf_static says: each child has one parent."""

from __future__ import annotations

from typing import Any

from pelorus.math import se3
from pelorus.math.se3 import IDENTITY, Poses

from pelorus_ros.conventions import pose_of

FRAMES_SHOWN = 12


def bare(frame: str) -> str:
    """Returns the name without the slash that tf of ROS 1 knew in front."""
    return frame.strip().lstrip("/")


class NoChain(Exception):
    """Two frames are not joined; the text says which frames there are."""


class Mounting:
    """The transforms that were heard, by child: q_parent = R s_child + p."""

    def __init__(self) -> None:
        self._links: dict[str, tuple[str, Poses]] = {}

    def add(self, message: Any) -> bool:
        """Takes a TFMessage; returns whether it says anything new."""
        before = len(self._links)
        for one in message.transforms:
            t, q = one.transform.translation, one.transform.rotation
            T = pose_of((t.x, t.y, t.z), (q.x, q.y, q.z, q.w))
            child, parent = bare(one.child_frame_id), bare(one.header.frame_id)
            if T is not None and child != parent:
                self._links[child] = parent, T
        return len(self._links) != before

    @property
    def frames(self) -> list[str]:
        return sorted({*self._links, *(parent for parent, _ in self._links.values())})

    def between(self, source: str, target: str) -> Poses:
        """Returns T with q_target = T s_source; NoChain where none joins them."""
        if source == target:
            return IDENTITY
        up, down = self._ancestors(source), self._ancestors(target)
        meeting = next((frame for frame in up if frame in down), None)
        if meeting is None:
            unknown = [f"{frame!r}" for frame in (source, target) if frame not in self.frames]
            known = ", ".join(self.frames[:FRAMES_SHOWN]) or "none"
            raise NoChain(
                f"/tf_static does not say where {' and '.join(unknown) or f'{source!r}'} stands "
                f"({source!r} to {target!r} is wanted); known frames: {known}"
            )
        T = se3.compose(se3.inverse(self._to(down, meeting)), self._to(up, meeting))
        return Poses(se3.nearest_rotation(T.R), T.p)

    def _ancestors(self, frame: str) -> list[str]:
        found = [frame]
        while found[-1] in self._links and self._links[found[-1]][0] not in found:
            found.append(self._links[found[-1]][0])
        return found

    def _to(self, chain: list[str], meeting: str) -> Poses:
        T = IDENTITY
        for child in chain[: chain.index(meeting)]:
            T = se3.compose(self._links[child][1], T)
        return T
