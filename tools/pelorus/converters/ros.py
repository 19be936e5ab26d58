# SPDX-License-Identifier: MIT
"""Reads bags of ROS 1 and ROS 2: pictures or tracks, and twists, an IMU or wheel speeds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from pelorus.converters import ros_beside, ros_frames, ros_motion
from pelorus.converters.bag import Bag
from pelorus.converters.ros_beside import Beside
from pelorus.converters.ros_frames import CAMERA_INFO, Cameras
from pelorus.converters.ros_motion import IMU, MotionTopics
from pelorus.converters.streams import Asked, Readings, Streams, Twists
from pelorus.converters.transforms import TF, Chain, bare
from pelorus.errors import PelorusError, resolved
from pelorus.math import se3
from pelorus.rig import read as rig_files
from pelorus.rig.read import Calibrated
from pelorus.rig.rig import Rig

WRAPPED = "its clock of 32 bits of us starts again at 0: unwrapped"


@dataclass(frozen=True)
class Topics:
    """The topics that the user names; the others are taken where there is only one."""

    cameras: Cameras
    moving: MotionTopics = field(default_factory=MotionTopics)
    position: str = ""  # of a GNSS receiver
    position_sigma_m: float = 0.0  # 0: as its messages say
    wheels: Beside | None = None  # of an IMU's recording


def read(bag: Bag, topics: Topics, asked: Asked) -> Streams:
    """Reads what becomes a recording; pictures are read later, so the bag must stay open."""
    motion = asked.motion or ros_motion.read(bag, topics.moving, asked)
    calibrated, cameras = _calibrated(bag, topics, asked, motion)
    if cameras.left != topics.cameras.left:
        bag.remarks.append(f"left pictures are {cameras.left}, right ones {cameras.right}")
    frames = ros_frames.read(bag, cameras, calibrated)
    small = []
    body = bare(topics.moving.frame) or motion.frame
    if topics.wheels is not None:
        if isinstance(motion, Twists):
            raise PelorusError("--twists moves the body, and --wheel-topic goes beside an IMU")
        small += ros_beside.wheels_beside(bag, topics.wheels, body)
    if topics.position:
        known = topics.position, topics.position_sigma_m
        small += ros_beside.positions(bag, *known, body)
    truth = asked.truth
    if truth is None and topics.moving.truth:
        truth = ros_motion.truth(bag, topics.moving.truth)
    bag.remarks += [f"{topic}: {WRAPPED}" for topic in bag.wrapped]
    return Streams(calibrated, frames, motion, truth, small, bag.remarks, bool(topics.position))


# --- cameras --------------------------------------------------------------------------------------


def _calibrated(
    bag: Bag, topics: Topics, asked: Asked, motion: Twists | Readings
) -> tuple[Calibrated, Cameras]:
    """Returns calibration and cameras by the files, else by the bag's camera_info.

    Their place on the body is by the files or /tf_static.
    """
    name = resolved(bag.path).stem
    if rig_files.is_own(asked.calibration):
        found = rig_files.read(asked.calibration, name, asked.extrinsic, asked.lens)
        return found, ros_frames.chosen(bag, topics.cameras)
    # the cameras are those of the bag's camera_info
    of_imu = rig_files.are_of_imu(asked.calibration)
    if asked.calibration and not of_imu:
        named = asked.cameras or _named(bag, topics.cameras, rig_files.topics(asked.calibration))
        rig = rig_files.read_rig(asked.calibration, asked.lens, named)
        cameras = ros_frames.chosen(bag, topics.cameras, rig)
    else:
        cameras = ros_frames.chosen(bag, topics.cameras)
        rig = _of_camera_info(bag, cameras)
        if rig.swapped:
            bag.remarks.append(f"{cameras.left} stands on the right: taken as the right camera")
            cameras = replace(cameras, left=cameras.right, right=cameras.left)
        if of_imu:
            rig = rig_files.with_imu(rig, asked.calibration)
    if asked.extrinsic is None:
        body = bare(topics.moving.frame) or motion.frame
        rig = _on_body(bag, rig, cameras, body, isinstance(motion, Twists))
    return rig_files.of_rig(rig, name, asked.extrinsic), cameras


def _named(bag: Bag, cameras: Cameras, known: set[str]) -> tuple[str, ...]:
    """Returns the user's two topics if the calibration has them, else its two that the bag has.

    Empty otherwise.
    """
    given = (cameras.left, cameras.right)
    if known.issuperset(given):
        return given
    there = sorted(known.intersection(ros_frames.pictures(bag)))
    return tuple(there) if len(there) == 2 < len(known) else ()


def _of_camera_info(bag: Bag, cameras: Cameras) -> Rig:
    infos = ros_frames.camera_infos(bag, cameras)
    if infos is None:
        raise PelorusError(
            f"{bag.path}: which topics of {CAMERA_INFO} are the cameras'? --left-info-topic and "
            "--right-info-topic are expected, or --calibration FILE (docs/CONVERT.md lists which "
            f"are read); {bag.listing()}"
        )
    apart = None
    if not infos.have_baseline:
        left, right = (
            ros_frames.camera_frame(bag, topic) for topic in (cameras.left, cameras.right)
        )
        chain = bag.tree.chain(left, right)
        bag.remarks.append(f"the right camera stands as /tf_static says: {chain.words}")
        apart = chain.T
    return infos.rig(apart)


def _on_body(bag: Bag, rig: Rig, cameras: Cameras, body: str, by_twists: bool) -> Rig:
    """Returns the rig with its place on the body, by /tf_static where the rig has none.

    Where the rig has it for an IMU that does not move the body, it is chained by the IMU's frame.
    """
    if rig.T_LB is not None:
        chain = _by_way_of_imu(bag, body) if by_twists else None
        if chain is None:
            return rig
        bag.remarks.append(f"the IMU of the calibration sits as /tf_static says: {chain.words}")
        return rig.on_body(se3.compose(rig.T_LB, chain.T))
    if not bag.of_type(*TF):
        return rig
    frame = bare(cameras.frame) or ros_frames.camera_frame(bag, cameras.tracks or cameras.left)
    if not body:
        raise PelorusError(
            f"{bag.path}: what moves the body does not name its frame; --body-frame NAME is "
            f"expected, one of {bag.tree.listing}, or --extrinsic FILE"
        )
    if not frame:
        raise PelorusError(
            f"{bag.path}: the left camera's messages do not name their frame; --camera-frame NAME "
            f"is expected, one of {bag.tree.listing}, or --extrinsic FILE"
        )
    turned = [] if cameras.frame else bag.tree.optical_of(frame)
    if turned:
        raise PelorusError(
            f"{bag.path}: the left camera's messages are of {frame!r}, which has the optical frame "
            f"{' and '.join(turned)}: in which does the camera look along z? --camera-frame "
            "is expected"
        )
    chain = bag.tree.chain(body, frame)
    bag.remarks.append(f"the left camera sits on the body as /tf_static says: {chain.words}")
    return rig.on_body(se3.compose(rig.T_LF, chain.T))


def _by_way_of_imu(bag: Bag, body: str) -> Chain | None:
    """Returns the chain from the twists' frame to the bag's only IMU, if both are known."""
    frames = {ros_frames.camera_frame(bag, topic) for topic in bag.of_type(IMU)} - {""}
    if len(frames) != 1 or not bag.tree.knows(body, *frames):
        return None
    return None if frames == {body} else bag.tree.chain(body, frames.pop())
