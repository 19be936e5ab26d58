# SPDX-License-Identifier: MIT
"""Everyday faults put into a recording, each at three strengths; as a program it measures how many
are named rightly in the whole of it, as `pelorus check` looks at it, and how often a clean piece of
it is called faulty; FIRST:LAST are seeds of tests/python/everyday.py, the last left out:

    python tests/python/injected.py DRIVE.plr... FIRST:LAST...
    python tests/python/injected.py --clean DRIVE.plr... FIRST:LAST...
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from everyday import drawn, drive
from injected_known import Known
from pelorus.check.contents import recording_of
from pelorus.faults.fault import Fault
from pelorus.faults.handeye import first_part
from pelorus.faults.named import faults_in, judged_of
from pelorus.io.recording import Recording
from pelorus.io.tracks import project, triangulate
from pelorus.math import se3
from pelorus.wire import framing
from pelorus.wire.frames import Message, Stereo, Twist

PIECE = 300  # frames of a clean piece


def turned(recording: Recording, F: np.ndarray) -> Recording:
    """Twists in axes that the extrinsic does not mean."""
    return replace(recording, v_B_mps=recording.v_B_mps @ F.T, w_B_radps=recording.w_B_radps @ F.T)


def mirrored(recording: Recording, axis: int) -> Recording:
    """One axis the other way round."""
    flip = np.ones(3)
    flip[axis] = -1
    return replace(
        recording, v_B_mps=recording.v_B_mps * flip, w_B_radps=-recording.w_B_radps * flip
    )


def inverted(recording: Recording, _: int) -> Recording:
    """The extrinsic's inverse in its place."""
    T = se3.inverse(recording.T_CB)
    return recording.with_extrinsic(T)


def axes(recording: Recording, k: int) -> Recording:
    """Twists in other axes than the extrinsic's."""
    order = [[[0, 1, 0], [-1, 0, 0], [0, 0, 1]], [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
             [[0, 0, 1], [1, 0, 0], [0, 1, 0]]][k]  # fmt: skip
    return turned(recording, np.array(order, np.float64))


def pitched(recording: Recording, k: int) -> Recording:
    """A pitch of the camera that the extrinsic does not know."""
    angle = np.radians((15, 20, 30)[k])
    tilt = se3.exp(np.zeros(3), np.array([angle, 0, 0]))
    return recording.with_extrinsic(recording.T_CB._replace(R=tilt.R @ recording.T_CB.R))


def pitched_a_little(recording: Recording, k: int) -> Recording:
    """Such a one as a calibration gets wrong."""
    tilt = se3.exp(np.zeros(3), np.radians([(6, -7, 8)[k], 0, 0]))
    return recording.with_extrinsic(recording.T_CB._replace(R=tilt.R @ recording.T_CB.R))


def pixels(recording: Recording, new: np.ndarray) -> Recording:
    """Other pixels on the same tracks."""
    return replace(recording, tracks=replace(recording.tracks, pixels=new))


def unrectified(recording: Recording, k: int) -> Recording:
    """Rows of the right picture that lie lower, and slanted."""
    new = recording.tracks.pixels.copy()
    new[:, 3] += (3.0, 6.0, 12.0)[k] + 0.01 * (k + 1) * (new[:, 2] - new[:, 2].mean())
    return pixels(recording, new)


def scaled(recording: Recording, k: int) -> Recording:
    """A baseline, a focal length or an odometry that is wrong by some percent."""
    camera = recording.header.camera
    if k == 0:
        return recording.with_header(camera=replace(camera, baseline_m=1.05 * camera.baseline_m))
    if k == 1:
        long = replace(camera, fx_px=1.06 * camera.fx_px, fy_px=1.06 * camera.fy_px)
        return recording.with_header(camera=long)
    return replace(recording, v_B_mps=0.9 * recording.v_B_mps)


def swapped_lever(recording: Recording, k: int) -> Recording:
    """The camera's position in the body in place of the translation, or that with a wrong sign."""
    T = recording.T_CB
    return recording.with_extrinsic(T._replace(p=-T.p if k == 1 else -T.R.T @ T.p))


def late(recording: Recording, k: int) -> Recording:
    """Frames with a clock of their own."""
    by_ns = (20, 50, -90)[k] * 10**6
    return replace(recording, frame_t_ns=recording.frame_t_ns + by_ns)


def wandering(recording: Recording, k: int) -> Recording:
    """Some of the points swing to and fro, each its own way, by 2.5 m."""
    tracks, camera = recording.tracks, recording.header.camera
    t_s = (recording.frame_t_ns[tracks.frame] - recording.frame_t_ns[0]) * 1e-9
    rows = np.nonzero((tracks.id * 7919) % 100 < (22, 30, 40)[k])[0]
    own = tracks.id[rows]
    swing = 2.5 * np.sin(2 * np.pi * t_s[rows] / 4 + own * 2.4)
    way_W = np.stack((swing * np.cos(1.7 * own), swing * np.sin(1.7 * own), 0 * swing), axis=-1)
    path = recording.dead_reckoning()
    R_CW = recording.T_CB.R @ np.swapaxes(path.R, 1, 2)
    px = tracks.pixels.copy()
    px[rows, 2] = np.minimum(px[rows, 2], px[rows, 0] - 1)
    q = triangulate(camera, px[rows])
    q += np.einsum("nij,nj->ni", R_CW[tracks.frame[rows]], way_W)
    q[:, 2] = np.maximum(q[:, 2], 0.5)
    px[rows] = project(camera, q)
    return pixels(recording, px)


def row_ids(recording: Recording, k: int) -> Recording:
    """Row numbers for ids."""
    tracks = recording.tracks
    own = np.arange(len(tracks)) - tracks.bounds()[tracks.frame]
    return replace(recording, tracks=replace(tracks, id=own + k))


def slot_ids(recording: Recording, k: int) -> Recording:
    """A live track has a slot; one that ends gives it to the next."""
    tracks = recording.tracks
    pairs = tracks.pairs(1)
    goes_on = np.zeros(len(tracks), bool)  # a tracker loses what is out of sight
    goes_on[pairs.first] = True
    free: list[int] = []
    out = np.empty_like(tracks.id)
    held: dict[int, int] = {}
    for frame in range(tracks.frame_count):
        a, b = tracks.bounds()[frame : frame + 2]
        for row in range(a, b):
            id = int(tracks.id[row])
            if id not in held:
                held[id] = free.pop() if free else len(held) + len(free) + k
            out[row] = held[id]
        free += [held.pop(int(id)) for id in tracks.id[a:b][~goes_on[a:b]]]
    return replace(recording, tracks=type(tracks).from_rows(
        tracks.frame_count, tracks.frame, out, tracks.pixels))  # fmt: skip


def frozen(recording: Recording, k: int) -> Recording:
    """From a frame in the middle of fast motion on that shows some points."""
    tracks = recording.tracks
    speed = np.linalg.norm(recording.body_motion(1).p, axis=1)
    run = (4, 8, 16)[k]
    bounds, keep = tracks.bounds(), np.ones(len(tracks), bool)
    way = np.convolve(speed, np.ones(run), "valid")
    shows = np.diff(bounds)[: len(way)] >= np.median(np.diff(bounds))
    at = int(np.argmax(np.where(shows, way, -1.0))) if len(speed) > run else 0
    keep[bounds[at + 1] : bounds[at + run + 1]] = False
    rows = np.arange(bounds[at], bounds[at + 1])
    parts = [(tracks.frame[keep], tracks.id[keep], tracks.pixels[keep])]
    parts += [
        (np.full(len(rows), f), tracks.id[rows], tracks.pixels[rows])
        for f in range(at + 1, at + run + 1)
    ]
    frame, id, px = (np.concatenate([part[j] for part in parts]) for j in range(3))
    return replace(recording, tracks=type(tracks).from_rows(tracks.frame_count, frame, id, px))


Change = Callable[[Recording, int], Recording]
ALIKE = ("inverted", "degrees", "km/h", "mm/s", "left-right", "u-v", "gravity")  # at any strength
OF_RECORDINGS: dict[str, tuple[Change, tuple[str, ...]]] = {
    "inverted": (inverted, ("inverted", "axes", "extrinsic")),
    "axes": (axes, ("axes",)),
    "mirrored": (mirrored, ("axes",)),
    "pitch": (pitched, ("pitch",)),
    "small-pitch": (pitched_a_little, ("pitch",)),
    "degrees": (lambda r, _: replace(r, w_B_radps=np.degrees(r.w_B_radps)), ("unit-degrees",)),
    "km/h": (lambda r, _: replace(r, v_B_mps=3.6 * r.v_B_mps), ("unit-km/h",)),
    "mm/s": (lambda r, _: replace(r, v_B_mps=1e3 * r.v_B_mps), ("unit-mm/s",)),
    "scale": (scaled, ("scale",)),
    "left-right": (lambda r, _: pixels(r, r.tracks.pixels[:, [2, 3, 0, 1]]), ("left-right",)),
    "u-v": (lambda r, _: pixels(r, r.tracks.pixels[:, [1, 0, 3, 2]]), ("u-v",)),
    "unrectified": (unrectified, ("unrectified",)),
    "ids-rows": (row_ids, ("ids-rows",)),
    "ids-slots": (slot_ids, ("ids-slots",)),
    "lever": (swapped_lever, ("lever",)),
    "clock": (late, ("clock",)),
    "moving": (wandering, ("moving",)),
    "frozen": (frozen, ("frozen",)),
}


def imu(recording: Recording, of_gyro: np.ndarray, of_force: np.ndarray) -> Recording:
    """An IMU in other axes or units."""
    own = recording.inertial
    turned = own._replace(w_B_radps=own.w_B_radps @ of_gyro.T, a_B_mps2=own.a_B_mps2 @ of_force.T)
    return replace(recording, inertial=turned)


def mirrored_imu(recording: Recording, k: int) -> Recording:
    """A left-handed frame."""
    F = np.diag(np.where(np.arange(3) == k, -1.0, 1.0))
    return imu(recording, -F, F)


def turned_imu(recording: Recording, k: int) -> Recording:
    """Both in other axes than the extrinsic's."""
    F = np.array([[[0, 1, 0], [-1, 0, 0], [0, 0, 1]], [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
                  [[0, 0, 1], [1, 0, 0], [0, 1, 0]]][k], np.float64)  # fmt: skip
    return imu(recording, F, F)


def swapped_imu(recording: Recording, k: int) -> Recording:
    """x and y: of both, of the force, of the gyro with a sign."""
    F = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])
    return imu(recording, (F, np.eye(3), -F)[k], (F, F, np.eye(3))[k])


def calibrated(recording: Recording, baseline: float, focal: float) -> Recording:
    """Another calibration than the camera's own."""
    camera = recording.header.camera
    f = {name: focal * getattr(camera, name) for name in ("fx_px", "fy_px")}
    return recording.with_header(
        camera=replace(camera, baseline_m=baseline * camera.baseline_m, **f)
    )


def imu_clock(recording: Recording, k: int) -> Recording:
    """Stamps of the readings in other units than the frames'."""
    own = recording.inertial
    t_ns = (own.t_ns // 1000, own.t_ns // 10**6, own.t_ns * 1000)[k]
    return replace(recording, inertial=own._replace(t_ns=t_ns))


NONE = np.eye(3)
OF_IMU: dict[str, tuple[Change, tuple[str, ...]]] = {
    "inverted": (inverted, ("inverted",)),
    "lever": (swapped_lever, ("lever",)),
    "axes": (turned_imu, ("axes",)),
    "mirrored": (mirrored_imu, ("axes",)),
    "x-y": (swapped_imu, ("axes",)),
    "degrees": (lambda r, k: imu(r, NONE * (57.2958, 57.2958, 0.0174533)[k], NONE),
                ("unit-degrees",)),
    "g": (lambda r, k: imu(r, NONE, NONE / (9.81, 9.81e-3, 1e-3)[k]), ("unit-force",)),
    "gravity": (lambda r, _: imu(r, NONE, -NONE), ("gravity-sign",)),
    "baseline": (lambda r, k: calibrated(r, (1.02, 0.95, 1.12)[k], 1.0), ("scale",)),
    "focal": (lambda r, k: calibrated(r, 1.0, (0.98, 1.05, 0.9)[k]), ("scale",)),
    "pitch": (pitched, ("pitch",)),
    "clock": (late, ("clock",)),
    "time-unit": (imu_clock, ("time-unit",)),
    "left-right": OF_RECORDINGS["left-right"],
    "u-v": OF_RECORDINGS["u-v"],
    "unrectified": OF_RECORDINGS["unrectified"],
    "ids-rows": OF_RECORDINGS["ids-rows"],
    "ids-slots": OF_RECORDINGS["ids-slots"],
}  # fmt: skip


def of_times(messages: list[Message], k: int, name: str) -> list[Message]:
    """Faults of the clocks as a robot's own recorder would write them."""
    out: list[Message] = []
    last: dict[type[Message], int] = {}
    for count, message in enumerate(messages):
        if not isinstance(message, Twist | Stereo):
            out.append(message)
            continue
        t = message.t_ns
        if name == "time-unit":
            t *= (1000, 1000, 1_000_000)[k]
        elif name == "time-order" and count % 7 == 0:
            t = max(last.get(type(message), t) - (0, 10**6, 10**9)[k], 0)
        elif name == "time-gap" and count > len(messages) // 2:
            t += (2, 5, 30)[k] * 10**9
        last[type(message)] = t
        out.append(replace(message, t_ns=t))
    return out


def found_in(recording: Recording) -> list[Fault]:
    """What is named, of tracks and twists alone."""
    return judged_of([recording.header], recording).faults


def injections(recording: Recording) -> Iterator[tuple[str, int, Recording, tuple[str, ...]]]:
    """Fault, strength, the recording that has it, what is expected."""
    by_imu = len(recording.inertial.t_ns) > 0
    for name, (change, due) in (OF_IMU if by_imu else OF_RECORDINGS).items():
        for k in range(1 if name in ALIKE else 3):
            yield name, k, change(recording, k), due


def piece(recording: Recording, first: int) -> Recording:
    """Some of the frames."""
    tracks = recording.tracks
    rows = (tracks.frame >= first) & (tracks.frame < first + PIECE)
    t = recording.frame_t_ns[first : first + PIECE]
    count = len(t)
    own = recording.inertial
    own = own.at((own.t_ns > t[0] - 10**9) & (own.t_ns < t[-1] + 10**9))
    return replace(recording, frame_t_ns=t, inertial=own, tracks=type(tracks)(
        count, tracks.frame[rows] - first, tracks.id[rows], tracks.pixels[rows]))  # fmt: skip


def recordings(words: list[str]) -> Iterator[tuple[str, Recording]]:
    """Files, or simulated drives by their seeds."""
    for word in words:
        first, colon, last = word.partition(":")
        if colon and first.isdigit():
            for seed in range(int(first), int(last)):
                settings = drawn(seed)
                yield f"{seed} ({settings.kind})", drive(settings, seed)
        else:
            yield word, recording_of(framing.messages_of(Path(word)))


def clean_pieces(name: str, whole: Recording) -> tuple[int, int]:
    """How many there are, and how many are called faulty."""
    count, false = 0, 0
    for first in range(0, max(whole.tracks.frame_count - PIECE // 2, 1), PIECE):
        said = found_in(piece(whole, first))
        count, false = count + 1, false + bool(said)
        if said:
            print(name, "clean", first, [f"{f.name}: {f.words}" for f in said], flush=True)
    return count, false


def injected(name: str, recording: Recording, share: float = 1.0) -> tuple[int, int, int]:
    """Returns how many faults were named right, of how many, and how many cannot be named; of a
    share of them, drawn by the recording's name."""
    right, asked, beyond = 0, 0, 0
    chance = np.random.default_rng(list(name.encode()))
    known = Known.of(first_part(recording))
    own = {fault.name for fault in found_in(recording)}
    print(name, "as it is:", *(own or ["clean"]), flush=True)
    for kind, k, wrong, due in injections(recording):
        if chance.random() >= share:
            continue
        said = faults_in(wrong)
        named = [fault.name for fault in said if fault.name not in own - set(due)]
        good = bool(named) and named[0] in due
        right, asked = right + good, asked + 1
        if not good:
            why = known.too_little(kind, k, first_part(wrong))
            beyond += bool(why)
            words = [f"{f.name}: {f.words}" for f in said]
            print(name, kind, k, words, f"cannot be told: {why}" if why else "MISSED", flush=True)
    return right, asked, beyond


def main(words: list[str]) -> None:
    """Print what was named wrongly, why the drive may not tell it, and the shares."""
    clean_only = "--clean" in words
    sums = np.zeros(5, np.int64)
    for name, whole in recordings([word for word in words if word != "--clean"]):
        count, false = clean_pieces(name, whole)
        faults = (0, 0, 0) if clean_only else injected(name, whole)
        sums += (*faults, count, false)
        print(f"{name}: {faults[0]} of {faults[1]}, {false} of {count} clean", flush=True)
    right, asked, beyond, clean, false = sums.tolist()
    print(
        f"{right} of {asked} named rightly, {beyond} of the rest cannot be told; "
        f"{false} of {clean} clean pieces called faulty"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
