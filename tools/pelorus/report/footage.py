# SPDX-License-Identifier: MIT
"""Pictures of the moments that matter, with tracks, rejections and residuals drawn in.

The pictures are those that the recording was made from: a folder like EuRoC's, a drive of KITTI, a
bag, which are rectified by their own calibration; or one folder of the left camera's rectified
pictures, named by their times in ns, or as many as the log has frames.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pelorus.errors import PelorusError
from pelorus.explain.explanation import Explanation
from pelorus.explain.log import FilterLog, log_of
from pelorus.math.motion import Times, nearest
from pelorus.program.extras import extra
from pelorus.report.residuals import residuals_of
from pelorus.tracking import images
from pelorus.tracking.images import Gray
from pelorus.wire.frames import Message

if TYPE_CHECKING:
    from PIL import ImageDraw

MOMENTS_MOST = 16
WIDTH_PX = 560  # of a picture on the page
QUALITY = 55  # of WebP: some 20 KB a picture
TAIL_FRAMES = 5
RESIDUAL_TIMES = 5.0  # enlargement of the drawn residuals
GREEN, RED, ORANGE = (63, 208, 160), (255, 70, 40), (255, 190, 60)
BAGS = (".bag", ".mcap", ".db3")
CAPTION = (
    "Green: a point and its way through the last frames. Red: seen, and rejected. Orange, five "
    "times as long: from the point to where the ten frames before and the pose of this one say "
    "that it should be."
)


class Shown(NamedTuple):
    """A picture, as WebP."""

    t_s: float  # since the first frame
    words: str
    packed: bytes


class Footage(NamedTuple):
    """The pictures; `frames` is the number of frames in the log."""

    moments: list[Shown]
    frames: int


class _Source(NamedTuple):
    """Left pictures in order; times are on the log's clock, None where pictures are its frames."""

    where: Path
    t_ns: Times | None
    pictures: int
    left: Iterator[Gray]


def footage(
    messages: Sequence[Message], found: Explanation, source: Path, calibration: Sequence[Path] = ()
) -> Footage:
    """Returns the pictures of a log; raises PelorusError where they are not this log's.

    `calibration` is for raw pictures that do not bring their own.
    """
    log = log_of(messages)
    wanted = moments(log, found)
    artist = _Artist(log)
    with _opened(source, tuple(calibration)) as pictures:
        frame_of = _frames(pictures, log)
        chosen = {int(k): picture for picture, k in enumerate(frame_of) if k in wanted}
        by_picture = {picture: k for k, picture in chosen.items()}
        last = max(by_picture, default=-1)
        shown = []
        for number, left in enumerate(pictures.left):
            if number > last:
                break
            if number in by_picture:
                k = by_picture[number]
                t_s = (int(log.t_ns[k]) - log.origin_ns) * 1e-9
                shown.append(Shown(t_s, wanted[k], artist.draw(left, k, pictures.where)))
    if not shown:
        raise PelorusError(f"{source}: has no picture of a moment of this log")
    return Footage(sorted(shown), len(log.t_ns))


# --- which moments --------------------------------------------------------------------------------


def moments(log: FilterLog, found: Explanation) -> dict[int, str]:
    """Returns frames by number, with a reason: before and after each event begins, its worst,
    and some evenly.
    """
    wanted: dict[int, str] = {}
    gated = log.column("gated")
    room = MOMENTS_MOST // 2
    for number, episode in enumerate(found.episodes, 1):
        first = int(np.searchsorted(np.maximum.accumulate(log.t_ns), episode.from_ns))
        last = int(np.searchsorted(np.maximum.accumulate(log.t_ns), episode.to_ns, "right")) - 1
        first, last = (min(max(k, 0), len(log.t_ns) - 1) for k in (first, last))
        worst = first + int(np.argmax(gated[first : max(last, first) + 1]))
        cause = f"event {number}, {episode.first.cause}"
        for k, words in (
            (max(first - 1, 0), f"before {cause}"),
            (first, cause),
            (worst, f"{cause}: most rejected"),
        ):
            if len(wanted) < room:
                wanted.setdefault(k, words)
    for k in np.linspace(0, len(log.t_ns) - 1, MOMENTS_MOST - len(wanted)).round().astype(int):
        wanted.setdefault(int(k), "")
    return wanted


# --- where pictures come from ---------------------------------------------------------------------


@contextmanager
def _opened(source: Path, calibration: tuple[Path, ...]) -> Iterator[_Source]:
    from pelorus.converters import euroc, kitti, ros  # noqa: PLC0415 - they load slowly
    from pelorus.converters.bag import Bag  # noqa: PLC0415
    from pelorus.converters.ros_frames import Cameras  # noqa: PLC0415
    from pelorus.converters.streams import Asked  # noqa: PLC0415

    asked = Asked(calibration)
    if source.suffix in BAGS or (source / "metadata.yaml").is_file():
        with Bag(source) as bag:
            yield _of_streams(ros.read(bag, ros.Topics(Cameras()), asked), source)
    elif any((source / name).is_dir() for name in ("mav0", "cam0")):
        yield _of_streams(euroc.read(source, asked), source)
    elif (source / "calib.txt").is_file() or kitti.is_raw(source):
        yield _of_streams(kitti.read(source, asked, kitti.Made(0.5, 0.05, 1)), source)
    else:
        yield _of_folder(source)


def _of_streams(streams: Any, source: Path) -> _Source:
    from pelorus.converters.streams import Pictures  # noqa: PLC0415 - as above

    frames, rig = streams.frames, streams.calibrated.rig
    if not isinstance(frames, Pictures):
        raise PelorusError(f"{source}: holds tracks and no pictures")
    t_ns = frames.t_ns if rig is None else rig.on_body_clock(frames.t_ns)

    def left() -> Iterator[Gray]:
        rectified = None
        for pair in frames.read():
            if rectified is None and rig is not None:
                height, width = pair[0].shape
                rectified = rig.of_size(width, height).rectification().pictures
            yield pair[0] if rectified is None else rectified(*pair)[0]

    return _Source(source, t_ns, len(t_ns), left())


def _of_folder(folder: Path) -> _Source:
    """Returns rectified pictures of the left camera in a folder."""
    by_name = images.pictures(folder)
    names = sorted(by_name, key=lambda name: (len(name), name))
    low, high = images.NS_DIGITS
    timed = all(name.isdecimal() and low <= len(name) <= high for name in names)
    t_ns = np.array([int(name) for name in names], np.int64) if timed else None
    return _Source(folder, t_ns, len(names), (images.gray(by_name[name]) for name in names))


def _frames(source: _Source, log: FilterLog) -> NDArray[np.int64]:
    """Returns the log's frame of each picture, -1 where it has none."""
    count = len(log.t_ns)
    if source.t_ns is None:
        if source.pictures != count:
            raise PelorusError(
                f"{source.where}: {source.pictures} pictures whose names are no times, the log has "
                f"{count} frames: name them by their times in ns, or give one a frame"
            )
        return np.arange(count)
    order = np.argsort(log.t_ns, kind="stable")
    at = order[nearest(log.t_ns[order], source.t_ns)]
    period = np.median(np.diff(log.t_ns)) if count > 1 else 0
    apart = np.abs(log.t_ns[at] - source.t_ns)
    frames = np.where(apart <= period / 2, at, -1)
    if (frames < 0).all():
        raise PelorusError(
            f"{source.where}: pictures from {source.t_ns.min()} to {source.t_ns.max()} ns, and the "
            f"log's frames from {log.t_ns.min()} to {log.t_ns.max()} ns: they are of another drive"
        )
    return np.asarray(frames, np.int64)


# --- drawing --------------------------------------------------------------------------------------


class _Artist:
    def __init__(self, log: FilterLog) -> None:
        self._log = log

    def draw(self, picture: Gray, k: int, where: Path) -> bytes:
        height, width = picture.shape
        header = self._log.header
        expected = (header.image_width_px, header.image_height_px)
        if expected[0] and (width, height) != expected:
            raise PelorusError(
                f"{where}: pictures of {width} x {height} pixels, and the log's are "
                f"{expected[0]} x {expected[1]}: the rectified ones are expected"
            )
        scale = WIDTH_PX / width
        size = (WIDTH_PX, round(height * scale))
        with extra("PIL"):
            from PIL import Image, ImageDraw  # noqa: PLC0415 - an extra
        image = Image.fromarray(picture).resize(size).convert("RGB")
        pen = ImageDraw.Draw(image)
        rejected = self._rejected(k)
        for id, way in self._ways(k).items():
            colour = RED if id in rejected else GREEN
            points = [tuple(x) for x in (np.array(way) * scale).tolist()]
            if len(points) > 1:
                pen.line(points, fill=colour)
            _dot(pen, points[-1], colour)
        found = residuals_of(self._log, k)
        for at, off in zip(found.pixels[:, :2], found.off[:, :2], strict=True):
            end = at - RESIDUAL_TIMES * off
            pen.line([tuple(at * scale), tuple(end * scale)], fill=ORANGE)
        packed = io.BytesIO()
        image.save(packed, "WEBP", quality=QUALITY)
        return packed.getvalue()

    def _rejected(self, k: int) -> set[int]:
        evidence = self._log.evidence[k]
        return set() if evidence is None else set(evidence.rejected["id"].tolist())

    def _ways(self, k: int) -> dict[int, list[list[float]]]:
        """Returns the tails of this frame's ids in the left picture, oldest point first."""
        ways: dict[int, list[list[float]]] = {id: [] for id in self._log.frames[k].ids.tolist()}
        for frame in self._log.frames[max(k - TAIL_FRAMES, 0) : k + 1]:
            for id, at in zip(frame.ids.tolist(), frame.pixels[:, :2].tolist(), strict=True):
                if id in ways and np.isfinite(at).all():
                    ways[id].append(at)
        return {id: way for id, way in ways.items() if way}


def _dot(pen: ImageDraw.ImageDraw, at: tuple[float, ...], colour: tuple[int, int, int]) -> None:
    x, y = at
    pen.ellipse((x - 2.5, y - 2.5, x + 2.5, y + 2.5), fill=colour)
