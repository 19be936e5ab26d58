# SPDX-License-Identifier: MIT
"""Bags as they are found: clocks that were set, sensors in parts, twists in other axes, frames."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from bags import NS, Recorder
from converted import SHORT, Run, messages_of
from drives import clean
from numpy.typing import NDArray
from pelorus.converters import order, ros_frames
from pelorus.converters.bag import Bag
from pelorus.evaluate.inertial_survey import readings_of
from pelorus.io.recording import Recording
from pelorus.math import motion
from pelorus.wire.frames import Imu, Twist
from rigs import opencv_text
from scipy.spatial.transform import Rotation
from test_convert_ros import written

Floats = NDArray[np.float64]
DRIVE = SHORT | {"duration_s": 12.0}
WORDS = ("--fix", "none", "--force")


@pytest.fixture
def drive() -> Recording:
    return clean(**DRIVE)


def on_body(folder: Path, drive: Recording) -> tuple[object, ...]:
    """The calibration of the drive, with where its camera sits."""
    T = drive.T_CB
    body = folder / "body.json"
    body.write_text(f'{{"R_CB": {T.R.tolist()}, "t_CB_m": {T.p.tolist()}}}')
    return (*of_cameras(folder, drive), "--extrinsic", body)


def of_cameras(folder: Path, drive: Recording) -> tuple[object, ...]:
    """The same without a word of the body."""
    c = drive.header.camera
    K = np.array([[c.fx_px, 0, c.cx_px], [0, c.fy_px, c.cy_px], [0, 0, 1]])
    T = np.array([[-c.baseline_m], [0], [0]])
    text = opencv_text(K1=K, K2=K, D1=np.zeros(5), D2=np.zeros(5), R=np.eye(3), T=T)
    (folder / "stereo.yaml").write_text(text)
    return ("--calibration", folder / "stereo.yaml", *WORDS)


def with_tracks(recorder: Recorder, drive: Recording, frame: str = "") -> Recorder:
    bounds = drive.tracks.bounds()
    for k, t in enumerate(drive.frame_t_ns.tolist()):
        rows = slice(bounds[k], bounds[k + 1])
        names = dict(zip(("uL", "vL", "uR", "vR"), drive.tracks.pixels[rows].T, strict=True))
        recorder.cloud("/tracks", t + NS, {"id": drive.tracks.id[rows], **names}, frame)
    return recorder


def odometry(
    recorder: Recorder, drive: Recording, v: Floats, w: Floats, child: str = "base_link"
) -> Recorder:
    """With the poses of dead reckoning."""
    poses = motion.dead_reckoning(
        drive.twist_t_ns, drive.v_B_mps, drive.w_B_radps, drive.header.twist_timing
    )
    for k, t in enumerate(drive.twist_t_ns.tolist()):
        recorder.odometry("/odom", t + NS, v[k], w[k], poses.at(k), child)
    return recorder


def twists_of(path: Path) -> Floats:
    return np.array([[*m.v_B_mps, *m.w_B_radps] for m in messages_of(path, Twist)])


# --- order ----------------------------------------------------------------------------------------


def set_back(
    period: int, before: int, after: int, by_ns: int, jitter: int = 0
) -> NDArray[np.int64]:
    chance = np.random.default_rng(5)
    t = (
        NS
        + np.arange(before + after) * period
        + chance.integers(-jitter, jitter + 1, before + after)
    )
    t[before:] -= by_ns
    return t


def judged(t_ns: NDArray[np.int64], numbers: Floats | None = None) -> list[str]:
    """The remarks on these stamps; the bag is only named."""
    bag = Bag.__new__(Bag)
    bag.path, bag.remarks = Path("bag"), list[str]()
    bag.begins_ns = 0
    kept = order.in_order(bag, "/x", order.Stamps(t_ns, t_ns, numbers))
    assert (np.diff(t_ns[kept]) > 0).all()
    return bag.remarks


@pytest.mark.parametrize("by_sorting", [False, True])
@pytest.mark.parametrize(
    ("period_ms", "by_s"), [(10, 0.313), (5, 2.0), (2.5, 7.0011), (100, 3.04), (33, 10.0)]
)
def test_a_clock_that_was_set_back_is_told_with_time_and_message(
    period_ms: float, by_s: float, by_sorting: bool
) -> None:
    """Whether the messages stand as they came or sorted by their arrival."""
    period = round(period_ms * 1e6)
    before = round(20e9 / period)
    t = set_back(period, before, round(15e9 / period), round(by_s * 1e9), period // 50)
    with pytest.raises(Exception, match="stamps go back by") as caught:
        judged(np.sort(t) if by_sorting else t)
    words = str(caught.value).split()
    assert float(words[words.index("by") + 1]) == pytest.approx(by_s, abs=2.1 * period * 1e-9)
    at = words[words.index("message") + 1].rstrip(";")
    assert abs(int(at) - before) <= 2


def test_what_is_late_repeated_or_uneven_is_no_clock_that_was_set() -> None:
    chance = np.random.default_rng(3)
    even = NS + np.arange(3000) * 5_000_000
    late = even.copy()
    late[700:704], late[704:720] = even[716:720].copy(), even[700:716].copy()  # a burst overtakes
    late[[50, 51]] = late[[51, 50]]
    assert "17 messages come late, by up to" in judged(late)[0]
    pairs = NS + np.repeat(np.arange(1500) * 10_000_000, 2) + np.tile([0, 400_000], 1500)
    faster = np.concatenate((even[:1000], even[1000] + np.arange(4000) * 2_500_000))
    held_up = even.copy()
    held_up[900:960] = even[960] - np.arange(60, 0, -1) * 100_000  # stalls, and hurries
    jitter = even + chance.integers(-2_000_000, 2_000_000, 3000)
    gap = even.copy()
    gap[1500:] += 40 * NS
    for t_ns in (even, pairs, faster, held_up, jitter, gap, even[:4]):
        assert judged(t_ns) == []
    twice = np.sort(np.concatenate((even, even[200:900])))
    numbers = np.sin(twice * 1e-9)[:, None]
    assert judged(twice, numbers) == ["/x: 700 messages repeat a time and are left out"]
    coarse = even // 10_000_000 * 10_000_000
    with pytest.raises(Exception, match="1500 of 3000 messages have other numbers at the time of"):
        judged(coarse, np.arange(3000, dtype=np.float64)[:, None])
    with pytest.raises(Exception, match=r"stamps go back by 3\.5\d* s"):
        judged(twice, np.arange(len(twice), dtype=np.float64)[:, None])


def test_an_imu_whose_clock_was_set_back_is_refused_whatever_the_bag(
    drive: Recording, tmp_path: Path, pelorus: Run
) -> None:
    for form in ("ros1", "sqlite3", "lone mcap"):
        recorder = with_tracks(Recorder(1 if form == "ros1" else 2), drive)
        for k, t in enumerate(set_back(5_000_000, 1300, 900, 2_431_000_000).tolist()):
            recorder.imu("/imu", t, (0.1, 0.2, 9.8), (0.01 * k, 0, 0))
            if form != "sqlite3":  # the recorder's own clock is right
                topic, kind, _, message = recorder.found.pop()
                recorder.found.append((topic, kind, NS + k * 5_000_000, message))
        bag, target = written(recorder, tmp_path / form, form), tmp_path / "out.plr"
        calibration = on_body(tmp_path, drive)
        said = pelorus("convert", "ros", bag, target, *calibration, status=1).err
        assert "/imu: stamps go back by 2.4" in said, said
        assert "--stamps log is expected" in said
        assert not target.exists()
        limits = re.findall(r"(--until|--from) (\d+\.\d+)", said)
        counts = []
        for option, limit in limits:
            pelorus("convert", "ros", bag, target, *calibration, option, limit)
            counts.append(sum(len(m.a_B_mps2) for m in messages_of(target, Imu)))
        whole = (1300, 900) if form != "sqlite3" else (1300 - 486, 900 - 486)
        assert np.abs(np.subtract(counts, whole)).max() <= 3, said
        target.unlink()


def test_a_stamp_that_was_never_set_is_left_out_and_one_that_begins_a_clock_is_kept() -> None:
    bag = Bag.__new__(Bag)
    bag.path, bag.remarks = Path("bag"), list[str]()
    nothing = np.zeros((100, 0))
    today = 1_700_000_000 * NS + np.arange(100) * 5_000_000
    today[:3] = 0
    assert order.sound(bag, "/x", today, nothing).sum() == 97
    assert bag.remarks == ["/x: 3 of 100 headers have no time: left out"]
    assert order.sound(bag, "/x", np.arange(100) * 5_000_000, nothing).all()
    with pytest.raises(Exception, match="100 of 100 headers have no time; times in header"):
        order.sound(bag, "/x", np.zeros(100, np.int64), nothing)


def test_bad_messages_are_left_out_and_counted_and_many_are_refused(
    drive: Recording, tmp_path: Path, pelorus: Run
) -> None:
    target, calibration = tmp_path / "out.plr", on_body(tmp_path, drive)
    for bad, status in ((7, 0), (400, 1)):
        recorder = with_tracks(Recorder(), drive)
        for k in range(2400):
            force = (np.nan, 0, 9.8) if k % 300 == 17 or k < bad - 7 else (0.1, 0.2, 9.8)
            recorder.imu("/imu", NS + k * 5_000_000, force, (0, 0, 0.01))
        recorder.imu("/imu", NS + 600 * 5_000_000, (9, 9, 9), (1, 1, 1))
        bag = written(recorder, tmp_path / f"{bad}", "mcap")
        outcome = pelorus("convert", "ros", bag, target, *calibration, status=status)
        if status:
            assert "399 of 2401 messages hold a number that is not finite" in outcome.err
            continue
        assert "/imu: 8 of 2401 messages hold a number that is not finite: left out" in outcome.out
        assert "/imu: 1 messages repeat a time and are left out" in outcome.out
        assert sum(len(m.a_B_mps2) for m in messages_of(target, Imu)) == 2392


# --- pictures -------------------------------------------------------------------------------------


def test_a_lost_picture_leaves_its_partner_out_however_wide_the_pairing(
    tmp_path: Path,
) -> None:
    lost = {4, 9, 10}
    recorder = Recorder()
    for k in range(40):
        recorder.image("/left", NS + k * 50_000_000, np.full((64, 80), k, np.uint8))
        if k not in lost:
            t_ns = NS + k * 50_000_000 + 9_000_000
            recorder.image("/right", t_ns, np.full((64, 80), 100 + k, np.uint8))
    with Bag(written(recorder, tmp_path, "mcap")) as bag:
        cameras = ros_frames.Cameras("/left", "/right", apart_ns=130_000_000)
        calibrated: Any = None
        pictures: Any = ros_frames.read(bag, cameras, calibrated)
        shown = [(int(left[0, 0]), int(right[0, 0]) - 100) for left, right in pictures.read()]
    assert shown == [(k, k) for k in range(40) if k not in lost]
    assert bag.remarks[-1:] == ["3 pictures have no partner and are left out"]
    assert [
        remark.startswith("left and right pictures are 9 ms apart") for remark in bag.remarks
    ] == [
        True,
        False,
    ]


@pytest.mark.parametrize("packing", ["<u2", ">u2", "png"])
@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_pictures_of_16_bits_are_scaled_by_the_bits_that_all_of_them_use(
    bits: int, packing: str, tmp_path: Path
) -> None:
    top = (1 << bits) - 1
    recorder = Recorder()
    for k in range(4):
        grey = np.linspace(0, top * (k + 1) / 4, 64 * 80).reshape(64, 80)
        for topic in ("/left", "/right"):
            if packing == "png":
                png = cv2.imencode(".png", grey.astype(np.uint16))[1].tobytes()
                recorder.compressed(topic, NS + k * 50_000_000, png)
                continue
            recorder.image(topic, NS + k * 50_000_000, grey.astype(packing), "mono16")
            recorder.found[-1][3].is_bigendian = int(packing == ">u2")
    with Bag(written(recorder, tmp_path, "mcap")) as bag:
        calibrated: Any = None
        pictures: Any = ros_frames.read(bag, ros_frames.Cameras("/left", "/right"), calibrated)
        brightest = [int(left.max()) for left, _ in pictures.read()]
    assert brightest == [(top * (k + 1) // 4) >> (bits - 8) for k in range(4)]
    told = f"pictures of 16 bits hold {bits} (the brightest pixel is {top} of 65535)"
    assert [remark.partition(": ")[2] for remark in bag.remarks] == ([told] if bits < 16 else [])


# --- gyro and accelerometer apart -----------------------------------------------------------------


def force(t: Floats) -> Floats:
    return np.stack((np.sin(t), 0.3 * t, 9.8 + 0 * t), axis=-1)


def rate(t: Floats) -> Floats:
    return np.stack((0.1 * t, np.cos(t), 0.2 + 0 * t), axis=-1)


def apart(drive: Recording, periods: tuple[float, float], vectors: bool) -> Recorder:
    """An accelerometer and a gyro with such periods in s, the former from 1.013 s to a pause."""
    recorder = with_tracks(Recorder(), drive)
    for topic, at, kind in (("/accel", 1.013, force), ("/gyro", 1.0, rate)):
        period = periods[topic == "/gyro"]
        times = at + np.arange(round(11 / period)) * period
        for t, x in zip(times.tolist(), kind(np.asarray(times, np.float64)), strict=True):
            if topic == "/accel" and 5 < t < 6:
                continue
            if vectors:
                recorder.vector(topic, round(t * 1e9), x)
            else:
                halves = (x, (0, 0, 0)) if kind is force else ((0, 0, 0), x)
                recorder.imu(topic, round(t * 1e9), *halves)
    return recorder


@pytest.mark.parametrize("periods", [(1 / 63, 1 / 200), (1 / 250, 1 / 100)])
@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--imu-topic", "/accel"),
        ("--imu-topic", "/gyro"),
        ("--imu-topic", "/accel", "--gyro-topic", "/gyro"),
    ],
)
def test_gyro_and_accelerometer_on_topics_of_their_own_are_joined(
    words: tuple[str, ...],
    periods: tuple[float, float],
    drive: Recording,
    tmp_path: Path,
    pelorus: Run,
) -> None:
    bag = written(apart(drive, periods, len(words) > 2), tmp_path, "mcap")
    target = tmp_path / "out.plr"
    said = pelorus("convert", "ros", bag, target, *on_body(tmp_path, drive), *words).out
    slow = (
        "accel: interpolated to the times of" if periods[0] > periods[1] else "gyro: interpolated"
    )
    assert slow in said
    t = np.concatenate([m.times_ns for m in messages_of(target, Imu)]) * 1e-9
    a = np.concatenate([m.a_B_mps2 for m in messages_of(target, Imu)])
    w = np.concatenate([m.w_B_radps for m in messages_of(target, Imu)])
    assert np.abs(a - force(t)).max() < 1e-3
    assert np.abs(w - rate(t)).max() < 1e-3
    assert np.median(np.diff(t)) == pytest.approx(min(periods), rel=1e-3)
    assert not ((t > 5.1) & (t < 5.9)).any(), "nothing is made up in the accelerometer's pause"


def test_a_half_that_nobody_has_is_asked_for(
    drive: Recording, tmp_path: Path, pelorus: Run
) -> None:
    recorder = with_tracks(Recorder(), drive)
    for k in range(2000):
        recorder.imu("/accel", NS + k * 5_000_000, (0.1, 0.1, 9.8), (0, 0, 0))
    bag, target = written(recorder, tmp_path, "mcap"), tmp_path / "out.plr"
    said = pelorus("convert", "ros", bag, target, *on_body(tmp_path, drive), status=1).err
    assert "/accel: all its rates of turn are 0; are they on another topic? --imu-topic" in said


# --- the axes of twists ---------------------------------------------------------------------------


def into_world(drive: Recording, x: Floats) -> Floats:
    poses = motion.dead_reckoning(
        drive.twist_t_ns, drive.v_B_mps, drive.w_B_radps, drive.header.twist_timing
    )
    return np.asarray(np.einsum("nij,nj->ni", poses.R, x))


@pytest.mark.parametrize(
    ("world", "said"),
    [
        ("vw", "its poses say that its velocities"),
        ("v", "its poses say that its velocities"),
        ("", ""),
        ("0", "all 241 twists are zero and the poses move: twists are made of the poses"),
    ],
)
def test_odometry_in_world_axes_or_without_twists_is_seen_by_its_poses(
    world: str, said: str, tmp_path: Path, pelorus: Run
) -> None:
    drive = clean(**(DRIVE | {"twist_rate_hz": 20.0, "seed": 3}))
    v, w = drive.v_B_mps, drive.w_B_radps
    right = np.hstack((v, w))
    if world == "0":
        v, w = np.zeros_like(v), np.zeros_like(w)
    v = into_world(drive, v) if "v" in world else v
    w = into_world(drive, w) if "w" in world else w
    chance = np.random.default_rng(2)
    noise = 0.02 * chance.standard_normal(v.shape) * (world != "0")
    bag = written(odometry(with_tracks(Recorder(), drive), drive, v + noise, w), tmp_path, "mcap")
    target, calibration = tmp_path / "out.plr", on_body(tmp_path, drive)
    outcome = pelorus("convert", "ros", bag, target, *calibration)
    assert (said in outcome.out) if said else ("its poses say" not in outcome.out)
    assert np.abs(twists_of(target) - right)[:-1].max() < 0.12
    words = {"vw": "world", "v": "world-velocity", "": "body", "0": "poses"}[world]
    before = twists_of(target)
    pelorus("convert", "ros", bag, target, *calibration, "--twist-in", words)
    flat = np.abs(drive.w_B_radps[:, :2]).max() < 1e-9
    assert flat or np.array_equal(before, twists_of(target))
    pelorus("convert", "ros", bag, target, *calibration, "--twist-in", "body")
    assert np.abs(twists_of(target) - np.hstack((v + noise, w))).max() < 1e-6


def test_twists_of_a_file_are_turned_by_their_own_orientation(
    tmp_path: Path, drive: Recording, pelorus: Run
) -> None:
    poses = motion.dead_reckoning(
        drive.twist_t_ns, drive.v_B_mps, drive.w_B_radps, drive.header.twist_timing
    )
    q = Rotation.from_matrix(poses.R).as_quat()
    table = np.column_stack(
        (drive.twist_t_ns, into_world(drive, drive.v_B_mps), drive.w_B_radps, q)
    )
    head = "t_ns,vx_mps,vy_mps,vz_mps,wx_radps,wy_radps,wz_radps"
    rows = [",".join([str(int(row[0])), *(f"{x:.9f}" for x in row[1:])]) for row in table]
    (tmp_path / "twists.csv").write_text("\n".join([head + ",qx,qy,qz,qw", *rows, ""]))
    recorder = with_tracks(Recorder(), drive)
    recorder.found = [(*f[:2], f[2] - NS, f[3]) for f in recorder.found]
    bag, target = written(recorder, tmp_path, "mcap"), tmp_path / "out.plr"
    words = (*on_body(tmp_path, drive), "--stamps", "log", "--twists", tmp_path / "twists.csv")
    pelorus("convert", "ros", bag, target, *words, "--twist-in", "world-velocity")
    assert np.abs(twists_of(target) - np.hstack((drive.v_B_mps, drive.w_B_radps))).max() < 1e-6
    said = pelorus("convert", "ros", bag, target, *words, "--twist-in", "poses", status=1).err
    assert "twists.csv: has no places; px_m, py_m, pz_m are expected" in said
    (tmp_path / "twists.csv").write_text(
        "\n".join([head, *[",".join(row.split(",")[:7]) for row in rows], ""])
    )
    said = pelorus("convert", "ros", bag, target, *words, "--twist-in", "world", status=1).err
    assert "has no orientation, and --twist-in world turns by it" in said


# --- stamps of drivers and devices ----------------------------------------------------------------


def test_readings_of_a_bag_that_share_a_stamp_are_spread(
    drive: Recording, tmp_path: Path, pelorus: Run
) -> None:
    recorder, count, batch = with_tracks(Recorder(2), drive), 2400, 8
    true = NS + (np.arange(count) + 1) * 5_000_000
    for k, t in enumerate(true[np.arange(count) // batch * batch + batch - 1].tolist()):
        recorder.imu("/imu", t, (0.1, 0.2, 9.8), (0.01 * k, 0, 0))
        topic, kind, _, message = recorder.found.pop()
        recorder.found.append((topic, kind, int(true[k]) + 1_000_000, message))
    bag, target = written(recorder, tmp_path / "b", "lone mcap"), tmp_path / "out.plr"
    said = pelorus("convert", "ros", bag, target, *on_body(tmp_path, drive)).out
    assert "/imu: 8 readings have one stamp (the median): spread" in " ".join(said.split())
    t_ns = readings_of(messages_of(target, Imu)).t_ns
    assert len(t_ns) > 0.95 * count
    assert np.abs(t_ns - true[-len(t_ns) :]).max() <= 1


def test_a_bag_whose_device_counts_32_bits_of_us_is_unwrapped(
    drive: Recording, tmp_path: Path, pelorus: Run
) -> None:
    period = 1000 << 32
    begin = period - 5 * NS
    recorder = Recorder(2)
    bounds = drive.tracks.bounds()
    for k, t in enumerate((drive.frame_t_ns - drive.frame_t_ns[0]).tolist()):
        rows = slice(bounds[k], bounds[k + 1])
        names = dict(zip(("uL", "vL", "uR", "vR"), drive.tracks.pixels[rows].T, strict=True))
        columns = {"id": drive.tracks.id[rows], **names}
        recorder.cloud("/tracks", (begin + t) % period, columns, "")
        topic, kind, _, message = recorder.found.pop()
        recorder.found.append((topic, kind, 9 * NS + t, message))
    for k in range(2400):
        recorder.imu("/imu", (begin + k * 5_000_000) % period, (0.1, 0.2, 9.8), (0.01 * k, 0, 0))
        topic, kind, _, message = recorder.found.pop()
        recorder.found.append((topic, kind, 9 * NS + k * 5_000_000, message))
    bag, target = written(recorder, tmp_path / "b", "lone mcap"), tmp_path / "out.plr"
    said = " ".join(pelorus("convert", "ros", bag, target, *on_body(tmp_path, drive)).out.split())
    assert "/imu: its clock of 32 bits of us starts again at 0: unwrapped" in said
    t_ns = readings_of(messages_of(target, Imu)).t_ns
    assert len(t_ns) == 2400
    assert (np.diff(t_ns) == 5_000_000).all()
