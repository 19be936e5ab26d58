# SPDX-License-Identifier: MIT
"""The data that a viewer gets of a drive, frame by frame, from a log or live.

Times are in ns on the recording's clock. Positions are in the filter's world, m; ellipsoids are of
three sigma.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

import numpy as np
import scipy

from pelorus.evaluate.evaluation import accuracy_of
from pelorus.evaluate.frame_table import DIAGONAL
from pelorus.evaluate.health import reasons
from pelorus.io.trajectory import is_finite
from pelorus.math.ellipsoids import Ellipsoids, of_landmarks
from pelorus.program.extras import extra
from pelorus.wire import schema
from pelorus.wire.evidence import Evidence
from pelorus.wire.frames import Header, Kind, Landmark, Message, Pose, Report, Role, Stereo
from pelorus.wire.layout import Floats

COUNTS = ("observations", "matched", "used", "gated", "created", "active")  # of REPORT
TWIST = tuple(f"{kind} {axis}" for kind in ("linear", "turn") for axis in "xyz")


def optional(module: str) -> Any:
    """Imports a library of the extra `view`."""
    with extra(module.partition(".")[0]):
        return import_module(module)


@dataclass
class Moment:
    """A stereo frame with the filter's answer."""

    frame: Stereo
    pose: Pose | None = None  # None of a refused frame
    report: Report | None = None
    evidence: Evidence | None = None
    truth_W_m: Floats | None = None

    @property
    def t_ns(self) -> int:
        return self.frame.t_ns

    @property
    def condition(self) -> str:
        """Returns the health in words: `degraded: identical pixels`."""
        if self.report is None:
            return "no answer"
        health = schema.HEALTHS.get(self.report.health, f"health {self.report.health}")
        if self.report.status:
            health = f"refused, {schema.STATUSES.get(self.report.status, self.report.status)}"
        why = ", ".join(reasons(self.report.reasons))
        return f"{health}: {why}" if why else health

    @property
    def rejected(self) -> list[int]:
        """Returns ids that were seen and not used."""
        return [] if self.evidence is None else self.evidence.rejected["id"].tolist()

    def curves(self) -> dict[str, dict[str, float]]:
        """Returns numbers over time, by chart."""
        found: dict[str, dict[str, float]] = {}
        if (report := self.report) is not None:
            found["points"] = {name: float(getattr(report, name)) for name in COUNTS}
            found["health"] = {"health": float(report.health)}
            if report.nis_dof:
                found["innovations"] = {"NIS of a degree of freedom": report.nis / report.nis_dof}
            if report.update_us:
                found["computing"] = {"ms": report.update_us * 1e-3}
        if (pose := self.pose) is not None:
            if pose.knows_covariance:
                sigma = np.sqrt(np.clip(np.asarray(pose.covariance)[DIAGONAL], 0, None))
                found["sigma"] = {
                    "position, m": float(np.linalg.norm(sigma[:3])),
                    "rotation, deg": float(np.degrees(np.linalg.norm(sigma[3:]))),
                }
            found["velocity"] = dict(zip(TWIST, (*pose.v_B_mps, *pose.w_B_radps), strict=True))
            found["bias"] = dict(zip(TWIST, pose.bias, strict=True))
        if (evidence := self.evidence) is not None:
            found["doubt"] = {"statistic": evidence.statistic}
            found["odometry"] = {"weight": evidence.weight, "agreement": evidence.agreement}
        return found


class Viewer(Protocol):
    """A viewer that shows a drive or writes it to a file."""

    def begin(self, header: Header) -> None: ...

    def moment(self, moment: Moment) -> None: ...

    def landmarks(self, t_ns: int, landmarks: Sequence[Landmark], shapes: Ellipsoids) -> None:
        """Shows landmarks that have left the state, or were in it at the end."""
        ...

    def end(self) -> None: ...


class ShownDrive:
    """Hands messages on to viewers as moments, in their order."""

    def __init__(
        self, viewers: Sequence[Viewer], truth_W_m: Mapping[int, Floats] | None = None
    ) -> None:
        self._viewers = viewers
        self._truth = truth_W_m or {}
        self._begun = False
        self._moment: Moment | None = None
        self._pose: Pose | None = None
        self._p_W_m = np.zeros(3)
        self._left: list[Landmark] = []

    def take(self, message: Message) -> None:
        """Takes the next message, an input or an answer."""
        match message:
            case Header() if not self._begun:
                self._begun = True
                for viewer in self._viewers:
                    viewer.begin(message)
            case Stereo() if self._begun:
                self._hand_on()
                self._moment = Moment(message, truth_W_m=self._truth.get(message.t_ns))
            case Pose() if (
                self._answers(message.t_ns) and message.after_stereo and is_finite(message)
            ):
                self._pose, self._p_W_m = message, np.asarray(message.p_WB_m)
            case Report() if message.subject == Kind.STEREO and self._answers(message.t_ns):
                assert self._moment is not None
                self._moment.report, self._moment.pose = message, self._pose
            case Evidence() if self._answers(message.t_ns):
                assert self._moment is not None
                self._moment.evidence = message
            case Landmark() if message.role != Role.KNOWN and np.isfinite(message.p_W_m).all():
                self._left.append(message)
            case _:
                pass

    def end(self) -> None:
        """Ends the drive."""
        self._hand_on()
        for viewer in self._viewers:
            viewer.end()

    def _answers(self, t_ns: int) -> bool:
        return self._moment is not None and self._moment.t_ns == t_ns

    def _hand_on(self) -> None:
        if self._moment is not None:
            for viewer in self._viewers:
                viewer.moment(self._moment)
                if self._left:
                    shapes = of_landmarks(self._left, self._p_W_m)
                    viewer.landmarks(self._moment.t_ns, self._left, shapes)
            self._left = []
        self._moment = self._pose = None


def show(messages: Sequence[Message], viewers: Sequence[Viewer]) -> None:
    """Shows a whole log, with its truth moved to the estimate's start."""
    drive = ShownDrive(viewers, _truth(messages))
    for message in messages:
        drive.take(message)
    drive.end()


def _truth(messages: Sequence[Message]) -> dict[int, Floats]:
    accuracy = accuracy_of(messages)
    if accuracy is None:
        return {}
    return dict(zip(accuracy.t_ns.tolist(), accuracy.truth.p, strict=True))


def quaternion(R: Floats) -> Floats:
    """Returns the quaternion (4,), x y z w."""
    return np.asarray(scipy.spatial.transform.Rotation.from_matrix(R).as_quat())
