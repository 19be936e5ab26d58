# SPDX-License-Identifier: MIT
"""Writes a drive as MCAP with Foxglove's own schemas, for Foxglove and other readers of MCAP."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pelorus.errors import PelorusError
from pelorus.math.ellipsoids import Ellipsoids, of_pose
from pelorus.view.drive import Moment, optional, quaternion
from pelorus.wire.frames import Header, Landmark, Pose
from pelorus.wire.layout import Floats, unpack_symmetric

S = 1_000_000_000
WORLD, BODY, CAMERA = "world", "body", "camera"
GREEN, RED, BLUE = (0.25, 0.82, 0.63), (0.84, 0.37, 0.0), (0.34, 0.71, 0.91)
WAY_POINTS = 200  # in a piece of the path


class InFoxglove:
    """A Viewer; the file is complete after `end`."""

    def __init__(self, path: Path) -> None:
        foxglove = optional("foxglove")
        self._to = optional("foxglove.messages")
        channels = optional("foxglove.channels")
        self._context = foxglove.Context()
        try:
            self._file = foxglove.open_mcap(path, context=self._context, allow_overwrite=True)
        except (OSError, RuntimeError, ValueError) as error:
            raise PelorusError(f"{path}: cannot be written: {error}") from error
        made = {
            "odometry": channels.OdometryChannel,
            "tf": channels.FrameTransformChannel,
            "calibration": channels.CameraCalibrationChannel,
            "points": channels.ImageAnnotationsChannel,
            "scene": channels.SceneUpdateChannel,
            "truth": channels.PoseInFrameChannel,
            "health": channels.LogChannel,
        }
        self._channels = {
            name: kind(f"/pelorus/{name}", context=self._context) for name, kind in made.items()
        }
        self._curves: dict[str, Any] = {}
        self._foxglove = foxglove
        self._header: Header | None = None
        self._condition = ""
        self._way: list[Floats] = []
        self._piece = 0

    def begin(self, header: Header) -> None:
        self._header = header

    def _begun(self, t_ns: int, header: Header) -> None:
        """Writes what holds for the whole drive, at its first frame's time."""
        to, camera = self._to, header.camera
        R_BC = np.asarray(header.R_CB).T
        self._frame(t_ns, BODY, CAMERA, -R_BC @ header.t_CB_m, R_BC)
        fx, fy, cx, cy = (camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px)
        calibration = to.CameraCalibration(
            timestamp=self._stamp(t_ns),
            frame_id=CAMERA,
            width=header.image_width_px or round(2 * cx),
            height=header.image_height_px or round(2 * cy),
            K=[fx, 0, cx, 0, fy, cy, 0, 0, 1],
            R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
            P=[fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0],
        )
        self._say("calibration", t_ns, calibration)

    def moment(self, moment: Moment) -> None:
        t_ns = moment.t_ns
        if self._header is not None:
            self._begun(t_ns, self._header)
            self._header = None
        if moment.pose is not None:
            self._pose(t_ns, moment.pose)
        if moment.truth_W_m is not None:
            to = self._to
            there = to.Pose(
                position=self._vector(moment.truth_W_m), orientation=to.Quaternion(w=1.0)
            )
            told = to.PoseInFrame(timestamp=self._stamp(t_ns), frame_id=WORLD, pose=there)
            self._say("truth", t_ns, told)
        self._points(moment)
        for name, values in moment.curves().items():
            if name not in self._curves:
                self._curves[name] = self._curve(name, values)
            self._curves[name].log(values, log_time=t_ns)
        if moment.condition != self._condition:
            self._condition = moment.condition
            self._log(moment)

    def _curve(self, name: str, values: dict[str, float]) -> Any:
        """Returns a channel of JSON, for Foxglove has no schema of plain numbers."""
        numbers = {title: {"type": "number"} for title in values}
        schema = json.dumps({"type": "object", "properties": numbers}).encode()
        return self._foxglove.Channel(
            f"/pelorus/curves/{name}",
            schema=self._foxglove.Schema(
                name=f"pelorus.{name}", encoding="jsonschema", data=schema
            ),
            message_encoding="json",
            context=self._context,
        )

    def _log(self, moment: Moment) -> None:
        to = self._to
        levels = (to.LogLevel.Info, to.LogLevel.Warning, to.LogLevel.Error, to.LogLevel.Fatal)
        health = 0 if moment.report is None else min(moment.report.health, len(levels) - 1)
        told = to.Log(
            timestamp=self._stamp(moment.t_ns),
            level=levels[health],
            message=self._condition,
            name="pelorus",
        )
        self._say("health", moment.t_ns, told)

    def _pose(self, t_ns: int, pose: Pose) -> None:
        to, R = self._to, np.asarray(pose.R_WB)
        self._frame(t_ns, WORLD, BODY, pose.p_WB_m, R)
        world_axes = np.kron(np.eye(2), R)
        P, V = (
            unpack_symmetric(np.asarray(packed)[None], 6)[0]
            for packed in (pose.covariance, pose.velocity_covariance)
        )
        P = world_axes @ P @ world_axes.T if pose.knows_covariance else np.zeros((6, 6))
        told = to.Odometry(
            timestamp=self._stamp(t_ns),
            frame_id=WORLD,
            body_frame_id=BODY,
            pose=to.Pose(position=self._vector(pose.p_WB_m), orientation=self._turn(quaternion(R))),
            linear_velocity=self._vector(pose.v_B_mps),
            angular_velocity=self._vector(pose.w_B_radps),
            pose_covariance=P.ravel().tolist(),
            velocity_covariance=np.where(np.isfinite(V), V, 0.0).ravel().tolist(),
        )
        self._say("odometry", t_ns, told)
        self._way.append(np.asarray(pose.p_WB_m))
        entities = [self._way_entity(t_ns)]
        if (shape := of_pose(pose)) is not None:
            ball = self._ball(np.zeros(3), shape.half_m[0], shape.turn[0], BLUE)
            entities.append(self._entity(t_ns, "three-sigma", BODY, spheres=[ball]))
        self._say("scene", t_ns, to.SceneUpdate(entities=entities))
        if len(self._way) >= WAY_POINTS:
            self._piece, self._way = self._piece + 1, self._way[-1:]

    def _way_entity(self, t_ns: int) -> object:
        to = self._to
        line = to.LinePrimitive(
            type=to.LinePrimitiveLineType.LineStrip,
            thickness=2.0,
            scale_invariant=True,
            points=[to.Point3(x=x, y=y, z=z) for x, y, z in np.array(self._way).tolist()],
            color=to.Color(r=BLUE[0], g=BLUE[1], b=BLUE[2], a=1.0),
        )
        return self._entity(t_ns, f"way {self._piece}", WORLD, lines=[line])

    def _points(self, moment: Moment) -> None:
        to, frame = self._to, moment.frame
        rejected = np.isin(frame.ids, moment.rejected).tolist()
        told = to.PointsAnnotation(
            timestamp=self._stamp(moment.t_ns),
            type=to.PointsAnnotationType.Points,
            points=[to.Point2(x=u, y=v) for u, v in frame.pixels[:, :2].tolist()],
            outline_colors=[
                to.Color(r=r, g=g, b=b, a=1.0)
                for r, g, b in (RED if bad else GREEN for bad in rejected)
            ],
            thickness=4.0,
        )
        self._say("points", moment.t_ns, to.ImageAnnotations(points=[told]))

    def landmarks(self, t_ns: int, landmarks: Sequence[Landmark], shapes: Ellipsoids) -> None:
        entities = [
            self._entity(t_ns, f"landmark {m.id}", WORLD, spheres=[self._ball(m.p_W_m, *at, GREEN)])
            for m, at in zip(landmarks, zip(*shapes, strict=True), strict=True)
        ]
        self._say("scene", t_ns, self._to.SceneUpdate(entities=entities))

    def end(self) -> None:
        self._file.close()

    # --- Foxglove's messages ----------------------------------------------------------------------

    def _say(self, channel: str, t_ns: int, message: object) -> None:
        self._channels[channel].log(message, log_time=t_ns)

    def _stamp(self, t_ns: int) -> object:
        return self._to.Timestamp(sec=t_ns // S, nsec=t_ns % S)

    def _vector(self, x: Floats) -> object:
        return self._to.Vector3(x=float(x[0]), y=float(x[1]), z=float(x[2]))

    def _turn(self, q: Floats) -> object:
        x, y, z, w = q.tolist()
        return self._to.Quaternion(x=x, y=y, z=z, w=w)

    def _frame(self, t_ns: int, parent: str, child: str, p: Floats, R: Floats) -> None:
        told = self._to.FrameTransform(
            timestamp=self._stamp(t_ns),
            parent_frame_id=parent,
            child_frame_id=child,
            translation=self._vector(p),
            rotation=self._turn(quaternion(R)),
        )
        self._say("tf", t_ns, told)

    def _ball(
        self, centre: Floats, half_m: Floats, turn: Floats, colour: tuple[float, float, float]
    ) -> object:
        to, (r, g, b) = self._to, colour
        return to.SpherePrimitive(
            pose=to.Pose(position=self._vector(centre), orientation=self._turn(turn)),
            size=self._vector(2 * half_m),
            color=to.Color(r=r, g=g, b=b, a=0.5),
        )

    def _entity(self, t_ns: int, name: str, frame: str, **parts: object) -> object:
        return self._to.SceneEntity(
            timestamp=self._stamp(t_ns), frame_id=frame, id=name, frame_locked=True, **parts
        )


# --- a layout -------------------------------------------------------------------------------------


SCENE, IMAGE, LOG = "3D!pelorus", "Image!pelorus", "RosOut!pelorus"
# title, and the curves in it: topic, numbers
PLOTS = (
    ("Innovations", (("innovations", "NIS of a degree of freedom"),)),
    ("Sigma", (("sigma", "position, m"), ("sigma", "rotation, deg"))),
    ("Points", (("points", "observations"), ("points", "used"), ("points", "gated"))),
    ("Doubt", (("doubt", "statistic"), ("odometry", "weight"), ("odometry", "agreement"))),
)
TOPICS = ("odometry", "scene", "truth")


def layout() -> str:
    """Returns the layout as JSON."""
    panels: dict[str, Any] = {
        SCENE: {
            "followTf": "world",
            "topics": {f"/pelorus/{name}": {"visible": True} for name in TOPICS},
        },
        IMAGE: {
            "imageMode": {
                "calibrationTopic": "/pelorus/calibration",
                "annotations": {"/pelorus/points": {"visible": True}},
            }
        },
        LOG: {"topicToRender": "/pelorus/health"},
    }
    panels |= {f"Plot!pelorus{k}": _plot(*plot) for k, plot in enumerate(PLOTS)}
    plots = [name for name in panels if name.startswith("Plot")]
    beside = _split("column", SCENE, _split("row", IMAGE, LOG), 65)
    whole = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", beside, _stacked(plots), 60),
    }
    return json.dumps(whole, indent=2) + "\n"


def _plot(title: str, curves: tuple[tuple[str, str], ...]) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": title,
        "paths": [
            {
                "value": f'/pelorus/curves/{topic}."{name}"',
                "label": name,
                "enabled": True,
                "timestampMethod": "receiveTime",
            }
            for topic, name in curves
        ],
        "xAxisVal": "timestamp",
        "showLegend": True,
        "isSynced": True,
    }


def _split(direction: str, first: Any, second: Any, percent: int = 50) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percent}


def _stacked(names: list[str]) -> Any:
    """Returns panels one above the other, of equal height."""
    head, *rest = names
    return _split("column", head, _stacked(rest), round(100 / len(names))) if rest else head
