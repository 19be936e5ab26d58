# SPDX-License-Identifier: MIT
"""Shows a drive in Rerun: in a file, in a viewer that it starts, or in a running one.

Path and map grow, and are kept in pieces of ten seconds: an entity that is logged anew with each
frame would store the drive as often as it has frames.
"""

from __future__ import annotations

import os
import socket
import sysconfig
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from pelorus.errors import PelorusError
from pelorus.math.ellipsoids import Ellipsoids, of_pose
from pelorus.view.drive import Moment, optional, quaternion
from pelorus.wire.frames import Header, Landmark
from pelorus.wire.layout import Floats

S = 1_000_000_000
PIECE_NS = 10 * S
SHOWN_NS = S  # interval at which the last piece is shown anew
GREEN, RED, BLUE, ORANGE, GRAY = (
    (63, 208, 160),
    (213, 94, 0),
    (86, 180, 233),
    (230, 159, 0),
    (160, 160, 160),
)
SCHEMES = ("rerun+http", "rerun+https", "rerun")
PORT, CONNECT_S, START_S, FLUSH_S = 9876, 5.0, 15.0, 60.0
LEVELS = ("INFO", "WARN", "ERROR", "CRITICAL")  # by health
PANELS = ("innovations", "sigma", "points", "doubt", "odometry", "bias", "computing")


class InRerun:
    """A Viewer. `rrd` is a file; `connect` is a viewer's URL; `spawn` starts one."""

    def __init__(
        self, rrd: Path | None = None, connect: str | None = None, spawn: bool = False
    ) -> None:
        os.environ.setdefault("RUST_LOG", "error")  # its warnings are for programmers
        self._rr = optional("rerun")
        self._stream = self._rr.RecordingStream("pelorus")
        views = self._views()
        try:
            if rrd is not None:
                self._stream.save(rrd, default_blueprint=views)
            elif connect is not None:
                _require_viewer(connect)
                self._stream.connect_grpc(connect, default_blueprint=views)
            elif spawn:
                here = sysconfig.get_path("scripts")  # the viewer came with the SDK
                os.environ["PATH"] = os.pathsep.join((here, os.environ.get("PATH", "")))
                self._stream.spawn(connect=False)
                _await_viewer()
                self._stream.connect_grpc(default_blueprint=views)
        except (RuntimeError, ValueError) as error:
            raise PelorusError(
                f"Rerun cannot open {rrd or connect or 'its viewer'}: {error}"
            ) from error
        self._origin_ns: int | None = None
        self._condition = ""
        self._way: list[Floats] = []
        self._map: list[tuple[Landmark, Floats, Floats]] = []  # half axes, and their rotation
        self._piece = 0
        self._shown_ns = 0

    def _views(self) -> Any:
        rrb = optional("rerun.blueprint")
        curves = [rrb.TimeSeriesView(origin=f"curves/{name}", name=name) for name in PANELS]
        pictures = rrb.Spatial2DView(origin="world/body/camera", name="points in the left picture")
        words = rrb.TextLogView(origin="health", name="health, and why")
        scene = rrb.Spatial3DView(origin="world", name="way, map, three sigma")
        left = rrb.Vertical(scene, rrb.Horizontal(pictures, words), row_shares=[2, 1])
        all_of_it = rrb.Horizontal(left, rrb.Vertical(*curves), column_shares=[3, 2])
        return rrb.Blueprint(all_of_it, collapse_panels=True)

    def begin(self, header: Header) -> None:
        rr, log = self._rr, self._stream.log
        self._stream.send_recording_name(header.name or "drive")
        R_BC = np.asarray(header.R_CB).T
        turn = rr.Quaternion(xyzw=quaternion(R_BC))
        p_BC_m = -R_BC @ header.t_CB_m
        log("world/body/camera", rr.Transform3D(translation=p_BC_m, quaternion=turn), static=True)
        camera = header.camera
        size = (
            header.image_width_px or 2 * camera.cx_px,
            header.image_height_px or 2 * camera.cy_px,
        )
        K = [[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1]]
        log("world/body/camera", rr.Pinhole(image_from_camera=K, resolution=size), static=True)

    def moment(self, moment: Moment) -> None:
        rr, log = self._rr, self._stream.log
        if self._origin_ns is None:
            self._origin_ns = self._shown_ns = moment.t_ns
        self._stream.set_time("drive", duration=np.timedelta64(moment.t_ns - self._origin_ns, "ns"))
        if moment.t_ns - self._shown_ns >= SHOWN_NS:
            self._show_pieces(moment.t_ns)
        if (pose := moment.pose) is not None:
            self._way.append(np.asarray(pose.p_WB_m))
            turn = rr.Quaternion(xyzw=quaternion(np.asarray(pose.R_WB)))
            log("world/body", rr.Transform3D(translation=pose.p_WB_m, quaternion=turn))
            if (shape := of_pose(pose)) is not None:
                log(
                    "world/body/three-sigma",
                    rr.Ellipsoids3D(half_sizes=shape.half_m, quaternions=shape.turn, colors=BLUE),
                )
        if moment.truth_W_m is not None:
            log(
                "world/truth",
                rr.Points3D([moment.truth_W_m], colors=GRAY, radii=rr.Radius.ui_points(6)),
            )
        self._points(moment)
        for name, values in moment.curves().items():
            for title, value in values.items():
                log(f"curves/{name}/{rr.escape_entity_path_part(title)}", rr.Scalars(value))
        if moment.condition != self._condition:
            self._condition = moment.condition
            health = 0 if moment.report is None else min(moment.report.health, len(LEVELS) - 1)
            log("health", rr.TextLog(self._condition, level=LEVELS[health]))

    def _points(self, moment: Moment) -> None:
        """Shows the points of the left picture, the rejected ones red."""
        frame = moment.frame
        rejected = np.isin(frame.ids, moment.rejected)
        colours = np.where(rejected[:, None], RED, GREEN).astype(np.uint8)
        labels = [str(i) for i in frame.ids.tolist()]
        points = self._rr.Points2D(
            frame.pixels[:, :2], colors=colours, radii=3.0, labels=labels, show_labels=False
        )
        self._stream.log("world/body/camera/points", points)

    def landmarks(
        self,
        t_ns: int,  # noqa: ARG002 - of the moment before
        landmarks: Sequence[Landmark],
        shapes: Ellipsoids,
    ) -> None:
        self._map += zip(landmarks, *shapes, strict=True)

    def end(self) -> None:
        if self._origin_ns is not None:
            self._show_pieces(self._shown_ns)
        self._stream.flush(timeout_sec=FLUSH_S)
        self._stream.disconnect()

    def _show_pieces(self, t_ns: int) -> None:
        rr, log = self._rr, self._stream.log
        self._shown_ns = t_ns
        assert self._origin_ns is not None
        if len(self._way) > 1:
            strip = rr.LineStrips3D([np.array(self._way)], colors=BLUE)
            log(f"world/way/{self._piece}", strip)
        if self._map:
            marks, half_m, turn = zip(*self._map, strict=True)
            balls = rr.Ellipsoids3D(
                centers=[m.p_W_m for m in marks],
                half_sizes=half_m,
                quaternions=turn,
                colors=GREEN,
                labels=[str(m.id) for m in marks],
                show_labels=False,
            )
            log(f"world/map/{self._piece}", balls)
        piece = (t_ns - self._origin_ns) // PIECE_NS
        if piece > self._piece:
            self._piece, self._way, self._map = piece, self._way[-1:], []


def _await_viewer() -> None:
    """Waits for a viewer that was started; without a display it ends at once."""
    until = time.monotonic() + START_S
    while time.monotonic() < until:
        with suppress(OSError):
            socket.create_connection(("127.0.0.1", PORT), CONNECT_S).close()
            return
        time.sleep(0.2)
    raise PelorusError(
        "Rerun's viewer does not start: has this machine a display? --rrd keeps the drive in a file"
    )


def _require_viewer(url: str) -> None:
    """Refuses a URL without a viewer, for which the SDK would wait for ever."""
    forms = " or ".join(SCHEMES)
    expected = PelorusError(
        f"{url}: is no viewer's address: {forms}://HOST:{PORT}/proxy is expected"
    )
    try:
        at = urlsplit(url)
        port = at.port or PORT
    except ValueError:
        raise expected from None
    if at.scheme not in SCHEMES or at.hostname is None:
        raise expected
    try:
        socket.create_connection((at.hostname, port), CONNECT_S).close()
    except OSError as error:
        raise PelorusError(
            f"{url}: no viewer answers there: {error.strerror or error}; `rerun` starts one"
        ) from error
