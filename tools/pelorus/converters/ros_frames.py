# SPDX-License-Identifier: MIT
"""Reads what a bag's cameras saw: stereo pictures, or features that were tracked already.

Tracks are sensor_msgs/PointCloud2 or PointCloud with the fields (or channels) id, uL, vL, uR, vR,
px, or messages with a list `features` of id, u0, v0, u1, v1 (msckf_vio): rays x/z and y/z.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pelorus.converters.bag import Bag
from pelorus.converters.order import Stamps, in_order, leave_out, sound
from pelorus.converters.streams import Pictures, RawTracks
from pelorus.converters.transforms import bare
from pelorus.errors import PelorusError
from pelorus.io.foreign import ForeignFileError
from pelorus.io.tracks import Tracks
from pelorus.math import motion
from pelorus.math.motion import Times
from pelorus.program.console import progress
from pelorus.program.extras import cv2
from pelorus.rig.camera_info import Info, Infos
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.read import Calibrated
from pelorus.rig.rectification import Gray
from pelorus.rig.rig import Rig
from pelorus.tracking import images
from pelorus.wire.layout import Floats

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
CLOUD2, CLOUD = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/PointCloud"
FIELDS = ("id", "uL", "vL", "uR", "vR")
RAYS = ("id", "u0", "v0", "u1", "v1")
TO_GRAY = {  # OpenCV's names
    "rgb8": "COLOR_RGB2GRAY",
    "bgr8": "COLOR_BGR2GRAY",
    "8UC3": "COLOR_BGR2GRAY",
    "rgba8": "COLOR_RGBA2GRAY",
    "bgra8": "COLOR_BGRA2GRAY",
    "bayer_rggb8": "COLOR_BayerRGGB2GRAY",
    "bayer_bggr8": "COLOR_BayerBGGR2GRAY",
    "bayer_gbrg8": "COLOR_BayerGBRG2GRAY",
    "bayer_grbg8": "COLOR_BayerGRBG2GRAY",
    "yuv422": "COLOR_YUV2GRAY_UYVY",
    "uyvy": "COLOR_YUV2GRAY_UYVY",
    "yuv422_yuy2": "COLOR_YUV2GRAY_YUY2",
    "yuyv": "COLOR_YUV2GRAY_YUY2",
}
CHANNELS = {"rgb8": 3, "bgr8": 3, "8UC3": 3, "rgba8": 4, "bgra8": 4}
CHANNELS |= dict.fromkeys(("yuv422", "uyvy", "yuv422_yuy2", "yuyv"), 2)
PLAIN, DEEP = ("mono8", "8UC1"), ("mono16", "16UC1")
SIDES = (("left", "right"), ("infra1", "infra2"), ("fisheye1", "fisheye2"))  # and RealSense
NUMBERED = (("cam0", "cam1"), ("camera0", "camera1"), ("cam_0", "cam_1"), ("camera_0", "camera_1"))
TOGETHER_MS = 3.0  # a pair within this time counts as simultaneous at a robot's speeds
WAITING_MAX = 200  # pictures of one side that wait for the other
# numpy's types for those of PointCloud2.
TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


@dataclass(frozen=True)
class Cameras:
    """The topics of pictures, or of tracks, and the largest time between the pictures of a pair."""

    left: str = ""
    right: str = ""
    tracks: str = ""
    apart_ns: int = images.APART_NS
    left_info: str = ""
    right_info: str = ""
    frame: str = ""  # of the left one, instead of what its messages say


def pictures(bag: Bag) -> list[str]:
    """Returns the topics with pictures."""
    return bag.of_type(IMAGE, COMPRESSED)


def chosen(bag: Bag, cameras: Cameras, rig: Rig | None = None) -> Cameras:
    """Returns the user's topics, else the calibration's, else the only pair of left and right.

    A pair may also be called 0 and 1, where 0 is the calibration's first camera.
    """
    if cameras.tracks:
        return cameras
    there = pictures(bag)
    if cameras.left and cameras.right:
        for topic in (cameras.left, cameras.right):
            bag.require(topic, IMAGE, COMPRESSED)
        return cameras
    if rig is not None and len(rig.topics) == 2 and all(topic in there for topic in rig.topics):
        return replace(cameras, left=rig.topics[0], right=rig.topics[1])
    swap = rig is not None and rig.swapped
    pairs = _partners(there, SIDES) or [
        (second, first) if swap else (first, second) for first, second in _partners(there, NUMBERED)
    ]
    if len(pairs) == 1:
        return replace(cameras, left=pairs[0][0], right=pairs[0][1])
    tracked = bag.of_type(CLOUD, CLOUD2)
    if not there and len(tracked) == 1:
        return replace(cameras, tracks=tracked[0])
    several = f"; pairs are {', '.join(map(' and '.join, pairs))}" if pairs else ""
    raise PelorusError(
        f"{bag.path}: which topics are the left and the right camera? --left-topic and "
        f"--right-topic are expected ({IMAGE}, {COMPRESSED}), or --tracks-topic{several}; "
        f"{bag.listing()}"
    )


def _partners(topics: list[str], words: tuple[tuple[str, str], ...]) -> list[tuple[str, str]]:
    """Returns the pairs of topics whose names differ only in a camera's word.

    A packed copy of another topic by image_transport (/compressed) is not a picture of its own.
    """
    there = {t.lower(): t for t in topics if t.rsplit("/", 1)[0] not in topics}
    found = {
        (there[name], there[other])
        for first, second in words
        for name in there
        if first in name and (other := name.replace(first, second)) in there
    }
    return sorted(found)


def read(bag: Bag, cameras: Cameras, calibrated: Calibrated) -> Pictures | RawTracks:
    """Reads pictures, or tracks."""
    if cameras.tracks:
        return _tracks(bag, cameras.tracks, calibrated)
    return _pictures(bag, cameras)


# --- pictures -------------------------------------------------------------------------------------


def _pictures(bag: Bag, cameras: Cameras) -> Pictures:
    """Returns pairs by the times of their headers: each left picture with the nearest right one."""
    topics = [cameras.left, cameras.right]
    stamps: dict[str, list[tuple[int, int]]] = {topic: [] for topic in topics}
    brightest: int | None = None  # of 16-bit pictures
    for found in progress(bag.written(topics), "finding pictures", bag.count(topics)):
        stamps[found.topic].append((found.t_ns, found.arrival_ns))
        deep = _of_16_bits(bag, found.topic, found.message, len(stamps[found.topic]))
        if deep is not None:
            brightest = max(brightest or 0, int(deep.max(initial=0)))
    bits = 16 if brightest is None else images.bits_up_to(brightest, bag.path, bag.remarks)
    left, right = (
        np.array(stamps[topic], np.int64)[_chosen(bag, topic, stamps[topic]), 0] for topic in topics
    )
    pairs = _paired(bag, cameras, left, right)
    where = bag.where(cameras.left), bag.where(cameras.right)
    return Pictures(where, pairs[:, 0], lambda: _in_pairs(bag, cameras, pairs, bits))


def _chosen(bag: Bag, topic: str, stamps: list[tuple[int, int]]) -> NDArray[np.intp]:
    """Returns the messages that have a time, in its order, by stamps and arrivals."""
    if not stamps:
        raise bag.error(topic, "no message can be read")
    t_ns, arrival_ns = np.array(stamps, np.int64).T
    good = np.nonzero(sound(bag, topic, t_ns, np.zeros((len(t_ns), 0))))[0]
    return good[in_order(bag, topic, Stamps(t_ns, arrival_ns).at(good))]


def _of_16_bits(bag: Bag, topic: str, message: Any, count: int) -> NDArray[Any] | None:
    """Returns the pixels of a 16-bit picture; None for others.

    Of packed ones only the first, second, fourth, ... are unpacked, for it takes time.
    """
    where = bag.where(topic)
    if getattr(message, "encoding", "") in DEEP:
        return _deep(where, message)
    if not hasattr(message, "format") or count & (count - 1):
        return None
    pixels = images.unpacked(where, bytes(message.data))
    return None if pixels.dtype == np.uint8 else pixels


def _paired(bag: Bag, cameras: Cameras, left: Times, right: Times) -> Times:
    """Returns (n, 2) times: two pictures of which each is the nearest to the other."""
    found = images.together(left, right, cameras.apart_ns)
    count = len(found.pairs)
    if images.too_many_alone(count, found.alone) or count < images.PAIRS_MIN:
        apart_ms = np.median(np.abs(right[motion.nearest(right, left)] - left)) * 1e-6
        raise PelorusError(
            f"{bag.path}: of {len(left)} pictures of {cameras.left} {count} have one of "
            f"the {len(right)} of {cameras.right} within {cameras.apart_ns * 1e-6:g} ms (median "
            f"{apart_ms:.3g} ms); cameras that are triggered together are expected, or "
            "--pair-within MS"
        )
    pairs = np.stack((left[found.pairs[:, 0]], right[found.pairs[:, 1]]), axis=-1)
    bag.remarks += [*apart_words(pairs), *found.remarks]
    return pairs


def apart_words(pairs: Times) -> list[str]:
    """Returns a remark on pairs whose stamps differ by more than matters in a turn."""
    apart_ns = pairs[:, 1] - pairs[:, 0]
    usual_ms = float(np.median(np.abs(apart_ns))) * 1e-6
    if usual_ms <= TOGETHER_MS:
        return []
    later = "right" if np.median(apart_ns) > 0 else "left"
    return [
        f"left and right pictures are {usual_ms:.3g} ms apart in the median, up to "
        f"{float(np.abs(apart_ns).max()) * 1e-6:.3g} ms, the {later} ones later: at 1 rad/s a "
        f"point moves by {usual_ms * 1e-3:.2g} of the focal length meanwhile, and its depth is "
        "wrong. Cameras that are triggered together are expected"
    ]


def _in_pairs(bag: Bag, cameras: Cameras, pairs: Times, bits: int) -> Iterator[tuple[Gray, Gray]]:
    """Yields the pairs in one pass through the bag; an early picture waits for its partner."""
    wanted = {cameras.left: set(pairs[:, 0].tolist()), cameras.right: set(pairs[:, 1].tolist())}
    waiting: dict[str, dict[int, Gray]] = {cameras.left: {}, cameras.right: {}}
    expected = iter(pairs.tolist())
    first, second = next(expected)
    for topic, t_ns, message, _ in bag.messages([cameras.left, cameras.right]):
        if t_ns not in wanted[topic] or t_ns in waiting[topic]:
            continue
        waiting[topic][t_ns] = gray(bag.where(topic), message, bits)
        if len(waiting[topic]) > WAITING_MAX:
            raise PelorusError(f"{bag.path}: {topic}: pictures lie in no order of time")
        while first in waiting[cameras.left] and second in waiting[cameras.right]:
            pair = waiting[cameras.left].pop(first), waiting[cameras.right].pop(second)
            yield pair
            wanted[cameras.left].discard(first)
            wanted[cameras.right].discard(second)
            following = next(expected, None)
            if following is None:
                return
            first, second = following


def gray(where: Path, message: Any, bits: int = 16) -> Gray:
    """Returns (rows, columns) of 8 bits; of a 16-bit picture the upper eight of the used bits."""
    if hasattr(message, "format"):
        return images.decoded(where, bytes(message.data), bits)
    encoding = message.encoding
    channels = CHANNELS.get(encoding, 1)
    if encoding not in (*PLAIN, *DEEP, *TO_GRAY):
        known = ", ".join((*PLAIN, *DEEP, *TO_GRAY))
        raise ForeignFileError(where, f"pictures are encoded as {encoding}; {known} are expected")
    if encoding in DEEP:
        return np.asarray(_deep(where, message) >> (bits - 8), np.uint8)
    plain = _lines(where, message, channels)
    if encoding in PLAIN:
        return plain
    shaped = plain.reshape(len(plain), -1, channels) if channels > 1 else plain
    return np.asarray(cv2.cvtColor(shaped, getattr(cv2, TO_GRAY[encoding])), np.uint8)


def _lines(where: Path, message: Any, pixel_bytes: int) -> NDArray[np.uint8]:
    """Returns (rows, bytes of a row), without padding."""
    rows, columns, step = int(message.height), int(message.width), int(message.step)
    packed = np.asarray(message.data, np.uint8)
    if len(packed) < rows * step or step < columns * pixel_bytes:
        raise ForeignFileError(
            where, f"a picture of {columns} x {rows} has {len(packed)} bytes in rows of {step}"
        )
    return np.ascontiguousarray(
        packed[: rows * step].reshape(rows, step)[:, : columns * pixel_bytes]
    )


def _deep(where: Path, message: Any) -> NDArray[np.uint16]:
    order = ">u2" if message.is_bigendian else "<u2"
    return _lines(where, message, 2).view(order).astype(np.uint16)


# --- tracks ---------------------------------------------------------------------------------------


def _tracks(bag: Bag, topic: str, calibrated: Calibrated) -> RawTracks:
    if topic not in bag.types:
        raise PelorusError(f"{bag.path}: has no topic {topic}; {bag.listing()}")
    where = bag.where(topic)
    stamps, messages = [], []
    for found in progress(bag.written([topic]), f"reading {topic}", bag.count([topic])):
        stamps.append((found.t_ns, found.arrival_ns))
        messages.append(observations(where, found.message, calibrated))
    order = _chosen(bag, topic, stamps)
    rows = [messages[k] for k in order]
    table = np.concatenate(rows)
    broken = ~np.isfinite(table).all(axis=1)
    leave_out(bag, topic, broken, "observations are not finite")
    frame = np.repeat(np.arange(len(rows)), [len(one) for one in rows])[~broken]
    table, times = table[~broken], np.array(stamps, np.int64)[order, 0]
    tracks = Tracks.from_rows(len(times), frame, table[:, 0].astype(np.int64), table[:, 1:])
    tracks.check(bag.path)
    if tracks.twice() is not None:
        raise bag.error(topic, "an id stands twice in a message")
    return RawTracks(where, times, tracks)


def observations(where: Path, message: Any, calibrated: Calibrated) -> Floats:
    """Returns (n, 5): id, uL, vL, uR, vR in px."""
    if hasattr(message, "features"):
        found = [[float(getattr(f, name)) for name in RAYS] for f in message.features]
        rows = np.array(found).reshape(-1, len(RAYS))
        left, right = _lenses(calibrated)
        pixels = left.distort(rows[:, 1:3]), right.distort(rows[:, 3:5])
        return np.hstack((rows[:, :1], *pixels))
    if hasattr(message, "channels"):
        columns = {channel.name: np.asarray(channel.values, float) for channel in message.channels}
    elif hasattr(message, "point_step"):
        columns = _fields(where, message)
    else:
        columns = {}
    lacking = [name for name in FIELDS if name not in columns]
    if lacking:
        raise ForeignFileError(
            where,
            f"holds no tracks: lacks {', '.join(lacking)}; {CLOUD2} or {CLOUD} with "
            f"{', '.join(FIELDS)} is expected, or features of {', '.join(RAYS)}; there are: "
            f"{', '.join(columns) or 'none of them'}",
        )
    return np.stack([columns[name] for name in FIELDS], axis=-1)


def _fields(where: Path, message: Any) -> dict[str, Floats]:
    order = ">" if message.is_bigendian else "<"
    known = [field for field in message.fields if field.datatype in TYPES]
    row = np.dtype(
        {
            "names": [field.name for field in known],
            "formats": [order + TYPES[field.datatype] for field in known],
            "offsets": [field.offset for field in known],
            "itemsize": message.point_step,
        }
    )
    count = int(message.width) * int(message.height)
    packed = np.asarray(message.data, np.uint8).tobytes()
    if len(packed) < count * row.itemsize:
        raise ForeignFileError(where, f"{count} points have {len(packed)} bytes")
    table = np.frombuffer(packed, row, count)
    return {name: table[name].astype(np.float64) for name in row.names or ()}


def _lenses(calibrated: Calibrated) -> tuple[Lens, Lens]:
    if calibrated.rig is not None:
        return calibrated.rig.left, calibrated.rig.right
    c = calibrated.header.camera
    plain = Lens(LensModel.NONE, (c.fx_px, c.fy_px, c.cx_px, c.cy_px))
    return plain, plain


# --- camera_info ----------------------------------------------------------------------------------


def camera_frame(bag: Bag, topic: str) -> str:
    """Returns the frame in the messages of a topic."""
    first = next(bag.messages([topic], whole=True), None)
    return "" if first is None else bare(first.message.header.frame_id)


def camera_infos(bag: Bag, cameras: Cameras) -> Infos | None:
    """Returns the first camera_info of each picture topic; None where there are not two."""
    named = (cameras.left, cameras.left_info), (cameras.right, cameras.right_info)
    beside = [
        bag.require(info, CAMERA_INFO) if info else _info_topic(bag, topic) for topic, info in named
    ]
    if not all(beside):
        return None
    left, right = (_info(bag, topic) for topic in beside)
    rectified = "rect" in cameras.left.removesuffix("/compressed").rpartition("/")[2]
    return Infos(left, right, rectified)


def _info_topic(bag: Bag, topic: str) -> str:
    """Returns /left/camera_info, or the only one beside it, for /left/image_raw(/compressed)."""
    parts = topic.split("/")
    for k in range(len(parts) - 1, 0, -1):
        folder = "/".join([*parts[:k], ""])
        beside = [t for t in bag.of_type(CAMERA_INFO) if t.rpartition("/")[0] + "/" == folder]
        if folder + "camera_info" in beside:
            return folder + "camera_info"
        if len(beside) == 1:
            return beside[0]
    return ""


def _info(bag: Bag, topic: str) -> Info:
    info = next(bag.messages([topic], whole=True)).message
    # ROS 1 uses capital letters, ROS 2 small ones
    K, D, R, P = (
        np.array(getattr(info, name if hasattr(info, name) else name.upper()), np.float64)
        for name in "kdrp"
    )
    matrices = K.reshape(3, 3), D, R.reshape(3, 3), P.reshape(3, 4)
    where = bag.where(topic)
    return Info(where, "", *matrices, info.distortion_model, info.width, info.height)
