# SPDX-License-Identifier: MIT
"""The frame format: every kind there and back, and what damage does."""

from __future__ import annotations

import io
import struct
import time
import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pelorus.errors import PelorusError
from pelorus.wire import cobs, framing, schema
from pelorus.wire.calibrated import Calibrated
from pelorus.wire.evidence import Evidence, EvidenceFlag
from pelorus.wire.frames import (
    NOT_SEEN_PX,
    Camera,
    Config,
    End,
    Header,
    Imu,
    Kind,
    Landmark,
    Message,
    Noise,
    Pose,
    Process,
    Reading,
    Report,
    Role,
    Start,
    StartFlag,
    State,
    StateAction,
    Stereo,
    Text,
    Truth,
    TruthKnows,
    Twist,
)
from pelorus.wire.framing import KINDS, Counts, Reader, Received, VersionError, Writer
from pelorus.wire.image import RigMessage, Side, TimedPair, bands_of
from pelorus.wire.layout import MalformedPayload, row_type
from pelorus.wire.schema import SENSORS
from pictures_back import pairs_of

CHANCE = np.random.default_rng(11)
R = np.linalg.qr(CHANCE.normal(size=(3, 3)))[0]


def stereo(count: int, t_ns: int = 3) -> Stereo:
    ids = CHANCE.integers(0, 2**32, count, dtype=np.uint32)
    return Stereo(t_ns, ids, CHANCE.normal(300, 100, (count, 4)).astype(np.float32), 17)


REJECTED = row_type(schema.MESSAGES["EVIDENCE"].rows)
COUNTS = tuple(range(100, 114))  # of a REPORT
MESSAGES: list[Message] = [
    Header(Camera(700.5, 701.5, 320.1, 240.2, 0.54), R, CHANCE.normal(size=3), name="Straße 7"),
    Config({1: 1.0, 8: 2.5, 200: -1e300}, 0xDEADBEEF, 256, 512, 8, 4),
    Start(2**63, R, CHANCE.normal(size=3), StartFlag(3), CHANCE.normal(size=21)),
    Twist(2**64 - 1, CHANCE.normal(size=3), np.array([np.nan, np.inf, -0.0])),
    stereo(5),
    stereo(0),
    stereo(4096),
    Truth(12, R, np.ones(3), TruthKnows(3), np.arange(3.0), np.arange(6.0)),
    Landmark(2**32 - 1, CHANCE.normal(size=3), CHANCE.normal(size=6), Role.FINAL, 99, 7),
    Pose(5, CHANCE.normal(size=3), R, CHANCE.normal(size=21), real_bytes=8, reset_count=3),
    Pose(5, CHANCE.normal(size=3), real_bytes=4, after_stereo=True, trace=0.5),
    Report(8, 5, -7, 3, 0xFFFF, 60, *COUNTS, nis=1.5, update_us=2**32 - 1, notice=3),  # type: ignore[misc]
    Evidence(14, nu=CHANCE.normal(size=6).astype(np.float32), doubt=3, flags=EvidenceFlag(255)),
    Evidence(15, statistic=2.5, adopted=7, rejected=np.array([(9, 4, 8, 40.5)], REJECTED)),
    Text("grün", 2),
    replace(stereo(3), sigmas=np.array([0.5, 0, 2], np.float32)),
    End(1, 2, 3, 4, 5, 6, 63, (7, 8, 9, 10, 11), 12, 13),
    State(9, StateAction.RESTORE, CHANCE.normal(size=6)),
    Reading(10, SENSORS["wheel"], 5, CHANCE.normal(size=3), np.ones(3), np.arange(3.0)),
    *bands_of(13, Side.RIGHT, np.arange(600, dtype=np.uint16).astype(np.uint8).reshape(20, 30)),
    RigMessage(
        752,
        480,
        1,
        458.5,
        457.5,
        367.5,
        248.5,
        2,
        457.5,
        456.5,
        379.5,
        255.5,
        CHANCE.normal(size=8),
        CHANCE.normal(size=8),
        R,
        CHANCE.normal(size=3),
        2e-5,
        120,
        60,
    ),
    Imu(11, CHANCE.normal(size=(1, 3)), CHANCE.normal(size=(1, 3))),
    Imu(11, CHANCE.normal(size=(20, 3)), CHANCE.normal(size=(20, 3)), 2_500_000),
    Calibrated(12, 5, Camera(1.5, 2.5, 3.5, 4.5, 0.1), R, np.ones(3), np.arange(11.0), np.ones(11)),
]
SIZES = {  # of the format's page; a HEADER's name has 9 bytes, a CONFIG 3 settings
    Kind.HEADER: [299 + 9],
    Kind.CONFIG: [11 + 9 * 3],
    Kind.START: [417],
    Kind.TWIST: [56],
    Kind.STEREO: [*(12 + 20 * n for n in (5, 0, 4096)), 12 + 24 * 3],
    Kind.TRUTH: [177],
    Kind.LANDMARK: [90],
    Kind.POSE: [36 + 63 * 8 + 32, 36 + 63 * 4 + 32],
    Kind.REPORT: [66],
    Kind.EVIDENCE: [127 + 11 * n for n in (0, 1)],
    Kind.TEXT: [1 + 5],
    Kind.END: [53],
    Kind.STATE: [57],
    Kind.READING: [58],
    Kind.IMU: [13 + 24 * n for n in (1, 20)],
    Kind.CALIBRATION: [250],
    Kind.IMAGE: [19 + n for n in (568, 32)],
    Kind.RIG: [306],
}


def stream_of(messages: Sequence[Message]) -> bytes:
    return b"".join(framing.encode(message, k) for k, message in enumerate(messages))


def read(data: bytes, piece: int = 1 << 20) -> tuple[list[Received], Counts]:
    reader = Reader()
    received: list[Received] = []
    for at in range(0, len(data), piece):
        received.extend(reader.feed(data[at : at + piece]))
    reader.finish()
    return received, reader.counts


def framed(content: bytes) -> bytes:
    """A frame with a good CRC over any kind, sequence and payload."""
    return cobs.encode(content + struct.pack("<I", zlib.crc32(content))) + b"\0"


def test_every_kind_is_tried() -> None:
    assert {message.kind for message in MESSAGES} == set(KINDS) == set(Kind)


@pytest.mark.parametrize("message", MESSAGES, ids=lambda m: m.kind.name)
def test_a_message_survives_its_payload_byte_by_byte(message: Message) -> None:
    payload = message.pack()
    assert type(message).unpack(payload).pack() == payload
    assert type(message).unpack(payload) == message


def test_payload_sizes_are_those_of_the_page() -> None:
    found: dict[Kind, list[int]] = {}
    for message in MESSAGES:
        found.setdefault(message.kind, []).append(len(message.pack()))
    assert found == SIZES


def test_sigmas_stand_behind_the_rows_where_one_is_told() -> None:
    frame = stereo(3)
    frame.pixels[:, 2:] = NOT_SEEN_PX  # of the left picture alone
    plain = frame.pack()
    told = replace(frame, sigmas=np.array([0.25, 0, 3], np.float32))
    assert told.sigmas is not None
    assert told.pack() == plain + told.sigmas.tobytes()
    assert replace(told, sigmas=np.zeros(3, np.float32)).pack() == plain
    back, before = Stereo.unpack(told.pack()), Stereo.unpack(plain)
    assert back.sigmas is not None
    assert back.sigmas.tolist() == [0.25, 0, 3]
    assert before.sigmas is None


def test_a_frame_is_these_bytes() -> None:
    payload = bytes.fromhex("00") + b"hi"
    content = b"\x0a\x34\x12" + payload
    crc = zlib.crc32(content)
    assert zlib.crc32(b"123456789") == 0xCBF43926  # the CRC's published check value
    expected = cobs.encode(content + crc.to_bytes(4, "little")) + b"\0"
    assert framing.encode(Text("hi"), 0x1234) == expected
    assert framing.encode(Text("hi"), 0x11234) == expected  # the sequence is mod 2^16


def test_fields_stand_where_the_page_puts_them() -> None:
    header = MESSAGES[0].pack()
    assert header[:10] == bytes([1, 9, 2, 0, 0, 9, 0, 0, 0, 0])
    assert header[202:211] == "Straße 7".encode()
    assert np.array_equal(np.frombuffer(header, "<f8", 6, 211), np.full(6, -1.0))
    assert header[259] == Process.TWIST
    assert np.array_equal(np.frombuffer(header, "<f8", 6, 260), np.full(6, -1.0))
    assert struct.unpack_from("<5d", header, 10) == (700.5, 701.5, 320.1, 240.2, 0.54)
    assert np.array_equal(np.frombuffer(header, "<f8", 9, 50), R.ravel())
    assert np.array_equal(np.frombuffer(header, "<f8", 7, 146), np.full(7, -1.0))
    landmark = MESSAGES[8].pack()
    assert struct.unpack_from("<QBBII", landmark) == (99, 2, 0, 2**32 - 1, 7)
    report = MESSAGES[11].pack()
    assert struct.unpack_from("<Bb", report, 8) == (5, -7)
    assert struct.unpack_from("<14H", report, 16) == tuple(range(100, 114))
    assert struct.unpack_from("<fI", report, 44) == (1.5, 2**32 - 1)
    pose = MESSAGES[10].pack()
    assert struct.unpack_from("<BBH", pose, 8) == (4, 1, 0)
    assert np.array_equal(np.frombuffer(pose, "<f4", 9, 36), np.eye(3, dtype="f4").ravel())
    observation = MESSAGES[4].pack()
    assert struct.unpack_from("<QHH", observation) == (3, 17, 5)


@pytest.mark.parametrize("piece", [1, 2, 7, 64, 1 << 20])
def test_pieces_of_any_size_give_the_same_messages(piece: int) -> None:
    few = [m for m in MESSAGES if len(m.pack()) < 1000]
    data = stream_of(few)
    received, counts = read(data, piece)
    assert [r.message for r in received] == few
    assert [r.sequence for r in received] == list(range(len(few)))
    assert counts.clean
    assert counts.ended
    assert counts.bytes == len(data)
    assert [data[r.offset - 1] for r in received[1:]] == [0] * (len(few) - 1)


def test_damage_at_every_byte_costs_no_more_than_the_frames_it_touches() -> None:
    few = [Twist(k, np.full(3, 0.1 * k), np.zeros(3)) for k in range(4)]
    data = stream_of(few)
    ends = [k for k, byte in enumerate(data) if byte == 0]
    for at in range(len(data)):
        for flip in (0x01, 0xFF, data[at]):  # the last makes it a delimiter
            broken = bytearray(data)
            broken[at] ^= flip
            if broken == data:
                continue
            received, counts = read(bytes(broken))
            touched = sum(1 for end in ends if end < at)
            lost = {touched, touched + 1} if at in ends else {touched}
            kept = [r.message for r in received]
            assert all(m in few for m in kept)
            assert [few[k] for k in range(4) if k not in lost] == [m for m in kept if m in few]
            assert counts.damaged in (1, 2)
            assert counts.missing == (0 if 3 in lost else len(lost & {0, 1, 2}))


def test_a_stream_cut_at_every_byte_keeps_all_whole_frames() -> None:
    few = [Twist(k) for k in range(3)]
    data = stream_of(few)
    ends = [k + 1 for k, byte in enumerate(data) if byte == 0]
    for cut in range(len(data)):
        received, counts = read(data[:cut])
        assert len(received) == sum(1 for end in ends if end <= cut)
        assert counts.damaged == (0 if cut in (0, *ends) else 1)
        assert not counts.ended


def test_noise_and_empty_frames_before_the_first_delimiter_cost_nothing() -> None:
    received, counts = read(b"\0\0" + stream_of([Twist(1)]) + b"\0")
    assert len(received) == 1
    assert counts.clean
    received, counts = read(b"noise\0" + stream_of([Twist(1)]))
    assert len(received) == 1
    assert counts.damaged == 1


def test_gaps_of_the_sequence_are_counted_over_its_end() -> None:
    sequence = [0, 1, 5, 65534, 2, 3]  # 3 missing; a step back; 65535, 0 and 1 missing
    data = b"".join(framing.encode(Twist(k), s) for k, s in enumerate(sequence))
    assert read(data)[1].missing == 3 + 0 + 3
    assert read(framing.encode(Twist(1), 4))[1].missing == 4  # 0 is expected first
    assert read(stream_of([Twist(1)] * 3) + framing.encode(Twist(2), 0))[1].missing == 0


def test_an_unknown_kind_is_skipped_and_counted_and_takes_part_in_the_sequence() -> None:
    data = framing.encode(Twist(1), 0) + framed(b"\x63\x01\x00abc") + framing.encode(Twist(2), 2)
    received, counts = read(data)
    assert len(received) == 2
    assert (counts.unknown, counts.missing, counts.damaged) == (1, 0, 0)


@pytest.mark.parametrize("message", MESSAGES, ids=lambda m: m.kind.name)
def test_a_longer_payload_is_a_later_version_and_a_shorter_one_is_malformed(
    message: Message,
) -> None:
    if isinstance(message, Stereo):  # what is behind the rows are their sigmas
        message = replace(message, sigmas=np.ones(len(message.ids), np.float32))
    head = bytes([message.kind, 0, 0])
    longer, counts = read(framed(head + message.pack() + b"later"))
    if not isinstance(message, Text):  # a TEXT goes to the end of its payload
        assert [r.message for r in longer] == [message]
        assert counts.clean
    shorter, counts = read(framed(head + message.pack()[:-1]))
    if not isinstance(message, Text):
        assert shorter == []
        assert (counts.malformed, counts.damaged) == (1, 0)


def test_a_header_of_format_1_1_tells_nothing_of_single_axes() -> None:
    noise = Noise(0.5, gyro_sigma_x_radps=0.1, gyro_sigma_z_radps=0.4)
    header = Header(Camera(1, 1, 1, 1, 1), noise=noise, name="old")
    assert Header.unpack(header.pack()) == header
    assert Header.unpack(header.pack()[: -48 - 49]) == replace(header, noise=Noise(0.5))


@pytest.mark.parametrize(("kind", "added"), [(Pose, 32), (Report, 2 + 10), (End, 25 + 8)])
def test_what_came_with_format_1_3_is_unknown_in_a_payload_of_1_2(
    kind: type[Message], added: int
) -> None:
    message = [m for m in MESSAGES if isinstance(m, kind)][-1]
    payload = message.pack()
    old = kind.unpack(payload[:-added])
    assert old.pack()[:-added] == payload[:-added]
    unknown = {"trace": -1, "notice": 0, "readings": 0, "differs": 0, "arrived": (0,) * 5}
    told = {name: value for name, value in unknown.items() if hasattr(old, name)}
    assert told == {name: getattr(old, name) for name in told} != {}
    if isinstance(old, Pose):
        assert (old.bias_variance == -1).all()
    for cut in set(range(1, added)) - {8 if kind is End else 10}:  # a payload of 1.3
        with pytest.raises(MalformedPayload):
            kind.unpack(payload[:-cut])


def test_what_came_with_format_1_4_is_absent_in_payloads_of_1_3() -> None:
    noise = Noise(0.5, gyro_sigma_x_radps=0.1, gyro_noise=1e-3, gravity=9.8)
    header = Header(Camera(1, 1, 1, 1, 1), noise=noise, name="old", process=Process.IMU)
    assert Header.unpack(header.pack()) == header
    older = replace(noise, gyro_noise=-1.0, gravity=-1.0)
    assert Header.unpack(header.pack()[:-49]) == replace(header, noise=older, process=Process.TWIST)
    start = Start(1, bias_mean=np.ones(6), velocity=np.ones(3), velocity_variance=np.ones(3))
    assert Start.unpack(start.pack()) == start
    assert Start.unpack(start.pack()[:-48]) == Start(1, bias_mean=np.ones(6))
    end = End(1, 2, 3, 4, 5, 6, 63, (7, 8, 9, 10, 11), 12, 13)
    assert End.unpack(end.pack()[:-8]) == replace(end, imus=0, imus_arrived=0)
    for message, added in ((header, 49), (start, 48), (end, 8)):
        for cut in range(1, added):
            with pytest.raises(MalformedPayload):
                type(message).unpack(message.pack()[:-cut])


def test_readings_of_an_imu_are_float32_rows_at_their_times() -> None:
    a, w = np.array([[0.1, 0.2, 9.81], [1.0, 1e300, 3.0]]), np.array([[4, 5, 6], [7, 8, 9.5]])
    with np.errstate(over="ignore"):
        rows = np.hstack([a, w]).astype("<f4")
    imu = Imu(1000, a, w, 2_500_000)
    assert imu.times_ns == [1000, 2_501_000]
    assert imu.pack() == struct.pack("<QIB", 1000, 2_500_000, 2) + rows.tobytes()
    back = Imu.unpack(imu.pack())
    assert np.array_equal(back.a_B_mps2, rows[:, :3])
    assert np.array_equal(back.w_B_radps, rows[:, 3:])
    assert (back.t_ns, back.period_ns) == (1000, 2_500_000)


@pytest.mark.parametrize("count", [0, 21])
def test_no_reading_of_an_imu_or_too_many_do_not_fit_a_frame(count: int) -> None:
    with pytest.raises(ValueError, match=f"{count} readings in one IMU frame, 1 to 20 fit"):
        Imu(1, np.zeros((count, 3)), np.zeros((count, 3))).pack()


def test_readings_of_an_imu_in_another_shape_are_refused() -> None:
    with pytest.raises(ValueError, match=r"shapes \(3,\) and \(3, 3\) where \(3, 3\) is expected"):
        Imu(1, np.zeros(3), np.zeros((3, 3))).pack()


def test_a_report_of_format_1_1_has_the_lower_reasons_alone() -> None:
    report = Report(8, 5, reasons=1 << 20 | 1 << 3, update_us=7)
    assert Report.unpack(report.pack()) == report
    assert Report.unpack(report.pack()[:52]) == replace(report, reasons=1 << 3)


WRONG_BYTES = [  # kind, offset in the payload, value: choices and counts that no page lists
    (Kind.HEADER, 0, 0),
    (Kind.HEADER, 2, 3),
    (Kind.HEADER, 3, 3),
    (Kind.HEADER, 4, 1),
    (Kind.HEADER, 5, 64),
    (Kind.CONFIG, 10, 65),
    (Kind.STEREO, 11, 0x11),
    (Kind.LANDMARK, 8, 3),
    (Kind.POSE, 8, 5),
    (Kind.REPORT, 9, 1),
    (Kind.REPORT, 10, 4),
    (Kind.TEXT, 0, 3),
    (Kind.HEADER, 259, 2),
    (Kind.IMU, 12, 0),
    (Kind.IMU, 12, 21),
]


@pytest.mark.parametrize(("kind", "at", "value"), WRONG_BYTES)
def test_a_choice_that_is_not_listed_is_malformed(kind: Kind, at: int, value: int) -> None:
    good = next(m for m in MESSAGES if m.kind == kind).pack()
    payload = bytearray(good + bytes(1000))  # long enough for any count
    payload[at] = value
    with pytest.raises(MalformedPayload):
        KINDS[kind].unpack(bytes(payload))


def test_a_later_major_version_ends_the_reading(tmp_path: Path) -> None:
    payload = b"\x02" + MESSAGES[0].pack()[1:]
    path = tmp_path / "future.plr"
    path.write_bytes(framed(b"\x01\0\0" + payload))
    with pytest.raises(VersionError, match=r"future\.plr: byte 0: .*version 2.*up to 1"):
        framing.read_file(path)
    assert read(framed(b"\x01\0\0\x01\x09" + payload[2:]))[1].clean  # a later minor one is fine


def test_a_frame_without_end_is_given_up_once_and_reading_goes_on() -> None:
    endless = b"\x7f" * (framing.STUFFED_BYTES_MAX * 3)
    for piece in (1 << 16, 1 << 24):
        received, counts = read(endless + b"\0" + stream_of([Twist(4)]), piece)
        assert [r.message for r in received] == [Twist(4)]
        assert counts.too_long == 1
        assert counts.damaged == 0


def test_the_writer_counts_and_closes_with_end() -> None:
    stream = io.BytesIO()
    writer = Writer(stream)
    header, landmark, imu = MESSAGES[0], MESSAGES[8], MESSAGES[-2]
    for message in (header, Twist(1), Twist(2), Truth(2), stereo(3), landmark, imu):
        writer.write(message)
    writer.end()
    received, counts = read(stream.getvalue())
    assert received[-1].message == End(twists=2, stereos=1, truths=1, landmarks=1, frames=7, imus=1)
    assert received[-1].sequence == 7
    assert counts.clean


def test_what_does_not_fit_a_frame_is_refused() -> None:
    with pytest.raises(ValueError, match="64 bytes"):
        Header(Camera(1, 1, 1, 1, 1), name="x" * 64).pack()
    with pytest.raises(ValueError, match="4097 observations"):
        stereo(4097).pack()
    with pytest.raises(ValueError, match="241 bytes"):
        Text("x" * 241).pack()
    with pytest.raises(ValueError, match="shape"):
        Twist(1, np.zeros(4)).pack()


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"", "empty"), (b"PK\3\4 foreign" * 50, "no .plr recording"), (b"\0" * 10, "no frame")],
)
def test_a_file_without_a_frame_says_so(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "x.plr"
    path.write_bytes(content)
    with pytest.raises(PelorusError, match=said):
        framing.read_file(path)
    with pytest.raises(PelorusError, match="cannot be read"):
        framing.read_file(tmp_path / "absent.plr")


def test_twenty_megabytes_take_seconds() -> None:
    frame = stereo(400)
    data = framing.encode(frame, 0)
    count = 20_000_000 // len(data)
    data = b"".join(framing.encode(frame, k) for k in range(count))
    began = time.process_time()
    received, counts = read(data, 1 << 16)
    assert time.process_time() - began < 10
    assert len(received) == count
    assert counts.clean


def picture(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (60, 80), dtype=np.uint8)


def test_pictures_come_back_from_their_bands() -> None:
    both = [
        *bands_of(5, Side.LEFT, picture(1)),
        *bands_of(6, Side.RIGHT, picture(2)),
        *bands_of(9, Side.RIGHT, picture(4)),
        *bands_of(9, Side.LEFT, picture(3)),
    ]
    received, counts = read(stream_of(both))
    assert counts.clean
    first, second = pairs_of(frame.message for frame in received)
    assert (first.t_ns, first.t_right_ns, second.t_ns) == (5, 6, 9)
    assert (first.left == picture(1)).all()
    assert (first.right == picture(2)).all()
    assert (second.left == picture(3)).all()


def test_a_picture_with_a_missing_or_a_disordered_band_is_left_out() -> None:
    bands = list(bands_of(5, Side.LEFT, picture(1)))
    whole = list(bands_of(5, Side.RIGHT, picture(2)))
    assert not list(pairs_of([*bands[:3], *bands[4:], *whole]))
    assert not list(pairs_of([bands[1], bands[0], *bands[2:], *whole]))
    again: list[TimedPair] = list(pairs_of([*bands[:3], *bands, *whole]))
    assert len(again) == 1
