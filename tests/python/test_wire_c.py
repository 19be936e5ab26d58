# SPDX-License-Identifier: MIT
"""The frame format in C against the one in Python, both ways.

tests/support/wire_echo.c reads a stream with the C reader and writes what it read with the C
writer. It is compiled here, so that these tests need no build folder.
"""

from __future__ import annotations

import io
import os
import shlex
import struct
import subprocess
import zlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from pelorus.wire import cobs, frames, framing
from pelorus.wire.frames import Kind, Message
from wire_messages import MAKERS, messages_of

ROOT = Path(__file__).resolve().parents[2]
WARNINGS = ["-Wall", "-Wextra", "-pedantic", "-Werror"]
FUTURE = 3  # exit status of the echo


class Echo(NamedTuple):
    """What the C side made of a stream."""

    status: int
    stream: bytes
    counts: dict[str, int]


EchoFunction = Callable[[bytes], Echo]


@pytest.fixture(scope="session")
def echo(tmp_path_factory: pytest.TempPathFactory) -> EchoFunction:
    program = tmp_path_factory.mktemp("wire") / "wire_echo"
    sources = [*sorted((ROOT / "src/record").glob("*.c")), ROOT / "tests/support/wire_echo.c"]
    compiler = shlex.split(os.environ.get("CC", "cc"))
    includes = [f"-I{ROOT / 'include'}", f"-I{ROOT / 'src'}"]
    subprocess.run(
        [*compiler, "-std=c99", "-O2", *WARNINGS, *includes, *map(str, sources), "-o", program],
        check=True,
    )

    def run(stream: bytes) -> Echo:
        done = subprocess.run(
            [program], input=stream, capture_output=True, check=False, timeout=1800
        )
        words = done.stderr.decode().split()
        counts = {name: int(value) for name, value in (word.split("=") for word in words)}
        return Echo(done.returncode, done.stdout, counts)

    return run


# --- streams ------------------------------------------------------------------------------------


def written(messages: Iterable[Message]) -> bytes:
    """The stream of a Python writer, closed by END."""
    stream = io.BytesIO()
    writer = framing.Writer(stream)
    for message in messages:
        writer.write(message)
    writer.end()
    return stream.getvalue()


def framed(kind: int, sequence: int, payload: bytes) -> bytes:
    """A sound frame of anything."""
    body = struct.pack("<BH", kind, sequence % 65536) + payload
    return cobs.encode(body + struct.pack("<I", zlib.crc32(body))) + b"\0"


def read(stream: bytes) -> tuple[list[framing.Received], framing.Counts]:
    reader = framing.Reader()
    received = list(reader.feed(stream))
    return received, reader.counts


def payloads(received: Sequence[framing.Received]) -> list[tuple[Kind, bytes]]:
    """All but END, whose counts are the writer's own."""
    messages = [item.message for item in received]
    return [(m.kind, m.pack()) for m in messages if m.kind is not Kind.END]


def assert_read_alike(echoed: Echo, stream: bytes) -> framing.Counts:
    """Both readers gave the same messages and counted the same."""
    received, counts = read(stream)
    assert echoed.status == 0
    assert payloads(read(echoed.stream)[0]) == payloads(received)
    expected = {
        "bytes": len(stream),
        "frames": counts.good,
        "damaged": counts.damaged,
        "unknown": counts.unknown,
        "malformed": counts.malformed,
        "too_long": counts.too_long,
        "missing": counts.missing,
        "mid_frame": int(not stream.endswith(b"\0") and bool(stream)),
    }
    assert echoed.counts == expected
    return counts


# --- undamaged ---------------------------------------------------------------------------------


@pytest.mark.parametrize("maker", MAKERS)
def test_a_message_written_in_python_comes_back_from_c_byte_by_byte(
    echo: EchoFunction, maker: Callable[[np.random.Generator], Message]
) -> None:
    random = np.random.default_rng(1)
    stream = written([maker(random) for _ in range(50)])
    echoed = echo(stream)
    assert echoed.status == 0
    assert echoed.stream == stream
    assert echoed.counts["frames"] == 51


def test_a_long_stream_of_every_kind_comes_back_byte_by_byte(echo: EchoFunction) -> None:
    stream = written(messages_of(seed=2, rounds=60))
    echoed = echo(stream)
    assert echoed.stream == stream
    assert_read_alike(echoed, stream)


def test_what_c_wrote_python_reads_as_the_same_messages(echo: EchoFunction) -> None:
    messages = messages_of(seed=3, rounds=10)
    received, counts = read(echo(written(messages)).stream)
    assert [item.message for item in received[:-1]] == messages
    assert [item.sequence for item in received] == list(range(len(messages) + 1))
    assert counts.clean
    assert counts.ended


def test_the_sequence_wraps_alike(echo: EchoFunction) -> None:
    stream = written([frames.Text("")] * 70000)
    echoed = echo(stream)
    assert echoed.stream == stream
    assert echoed.counts["missing"] == 0


def test_the_longest_frame_comes_back(echo: EchoFunction) -> None:
    count = frames.OBSERVATIONS_MAX
    pixels = np.random.default_rng(4).normal(size=(count, 4)).astype(np.float32)
    stream = written([frames.Stereo(7, np.arange(count, dtype=np.uint32), pixels)])
    assert echo(stream).stream == stream


def test_blocks_of_every_length_are_stuffed_alike(echo: EchoFunction) -> None:
    """Bodies with few zeros. A HEADER's last ones are those of R_CB's first number, so that a name
    of 9 bytes makes what follows one full block that ends the frame.
    """
    x = float(np.frombuffer(b"AAAAAAAA")[0])
    R_CB = np.full((3, 3), x)
    R_CB[0, 0] = 0.0
    messages: list[Message] = [frames.Text("x" * n) for n in range(frames.TEXT_BYTES_MAX + 1)]
    for n in range(frames.NAME_BYTES_MAX + 1):
        header = frames.Header(
            camera=frames.Camera(x, x, x, x, x),
            R_CB=R_CB,
            t_CB_m=np.full(3, x),
            image_width_px=0x4141,
            image_height_px=0x4141,
            noise=frames.Noise(*[x] * 19),
            name="x" * n,
            process=frames.Process.IMU,
        )
        messages.append(header)
    stream = written(messages)
    assert any(len(stuffed) >= 255 and stuffed[-255] == 255 for stuffed in stream.split(b"\0"))
    assert echo(stream).stream == stream


# --- damaged, unknown, malformed ---------------------------------------------------------------


def damaged(stream: bytes, random: np.random.Generator) -> bytes:
    """5 to 19 bytes replaced, lost or put in, a few of them zeros."""
    hurt = bytearray(stream)
    for _ in range(int(random.integers(5, 20))):
        at = int(random.integers(len(hurt)))
        byte = int(random.choice([0, 1, 255, int(random.integers(256))]))
        match int(random.integers(3)):
            case 0:
                hurt[at] = byte
            case 1:
                del hurt[at]
            case _:
                hurt.insert(at, byte)
    return bytes(hurt)


@pytest.mark.parametrize("seed", range(40))
def test_a_damaged_stream_is_read_alike(echo: EchoFunction, seed: int) -> None:
    random = np.random.default_rng(seed)
    stream = damaged(written(messages_of(seed, rounds=4)), random)
    counts = assert_read_alike(echo(stream), stream)
    assert counts.damaged > 0


def test_a_truncated_stream_is_read_alike(echo: EchoFunction) -> None:
    stream = written(messages_of(seed=5, rounds=1))
    for n in range(0, len(stream), 37):
        assert_read_alike(echo(stream[:n]), stream[:n])


def test_noise_is_read_alike(echo: EchoFunction) -> None:
    noise = np.random.default_rng(6).integers(0, 256, 1_000_000, dtype=np.uint8).tobytes()
    counts = assert_read_alike(echo(noise), noise)
    assert counts.good == 0


def test_unknown_kinds_gaps_and_steps_back_are_counted_alike(echo: EchoFunction) -> None:
    sequences = [3, 4, 4, 9, 0, 1, 40000, 40001, 65535, 0, 32767]
    stream = b"\0" + b"\0".join(
        framed(kind, sequence, b"\1" * 20)
        for sequence, kind in zip(
            sequences, [max(Kind) + 1, 10, 0, 10, 255, 10, 11, 200, 10, 10, 10], strict=True
        )
    )
    counts = assert_read_alike(echo(stream), stream)
    assert counts.unknown == 4
    assert counts.missing > 0


# What Python keeps otherwise than C, or C otherwise than Python, where it may: a text that is not
# UTF-8, a setting that stands there twice, a minor version.
LOOSE = {Kind.HEADER, Kind.CONFIG, Kind.TEXT}


@pytest.mark.parametrize("seed", range(30))
def test_sound_frames_of_altered_payloads_are_judged_alike(echo: EchoFunction, seed: int) -> None:
    """One byte of each payload replaced, cut or lengthened, inside a frame whose CRC is right."""
    random = np.random.default_rng(seed)
    stream = bytearray()
    for sequence, message in enumerate(messages_of(seed, rounds=5)):
        payload = bytearray(message.pack())
        match int(random.integers(4)):
            case 0:
                payload = payload[: int(random.integers(len(payload)))]
            case 1:
                payload += b"\7" * int(random.integers(1, 30)) if message.kind != Kind.TEXT else b""
            case _:
                at = int(random.integers(min(len(payload), 16)))
                payload[at] = int(random.integers(256))
        if message.kind is Kind.HEADER:
            payload[:1] = b"\1"
        stream += framed(message.kind, sequence, bytes(payload))
    echoed = echo(bytes(stream))
    received, counts = read(bytes(stream))
    assert echoed.counts["frames"] == counts.good
    assert echoed.counts["malformed"] == counts.malformed > 0
    assert echoed.counts["unknown"] == echoed.counts["damaged"] == counts.missing == 0
    again = payloads(read(echoed.stream)[0])
    for (kind, payload_c), (_, payload_python) in zip(again, payloads(received), strict=True):
        assert kind in LOOSE or payload_c == payload_python


def test_both_refuse_a_later_major_version(echo: EchoFunction) -> None:
    payload = b"\2" + frames.Header(frames.Camera(1, 1, 1, 1, 1)).pack()[1:]
    stream = framed(Kind.HEADER, 0, payload) + framed(Kind.TEXT, 1, b"\0hello")
    echoed = echo(stream)
    assert echoed.status == FUTURE
    assert echoed.stream == b""
    with pytest.raises(framing.VersionError):
        read(stream)


def test_a_later_minor_version_is_read_by_both(echo: EchoFunction) -> None:
    header = frames.Header(frames.Camera(1, 2, 3, 4, 5), name="newer")
    payload = bytearray(header.pack() + b"what a later version knows")
    payload[1] = 77
    stream = framed(Kind.HEADER, 0, bytes(payload))
    echoed = echo(stream)
    assert echoed.stream == framed(Kind.HEADER, 0, header.pack())
    assert read(stream)[1].good == 1
