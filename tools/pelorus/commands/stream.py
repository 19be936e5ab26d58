# SPDX-License-Identifier: MIT
"""`pelorus stream IN.plr --to TARGET`."""

from __future__ import annotations

import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

import typer
from rich.progress import BarColumn, Progress, TaskProgressColumn, TimeRemainingColumn

from pelorus.commands.choices import PROGRAMS, VIEW, watching
from pelorus.commands.compare import compare_log
from pelorus.errors import PelorusError, writing
from pelorus.flight.judge import BitsVerdict
from pelorus.program.console import err, one_line, tell_lines
from pelorus.robot.emulator import BAUD, FORMS, MACHINES, open_target
from pelorus.robot.stream import ANSWER_S, Streamer, StreamResult, refusal, restored, saved
from pelorus.wire import packed_file
from pelorus.wire.frames import Kind, Message, Pose
from pelorus.wire.framing import header_of, read_file

TEXTS_SHOWN = 200
BOARDS = ", ".join(MACHINES)

app = typer.Typer()


@app.command(epilog="Example:  pelorus stream drive.plr --to qemu:stm32f405 --compare")
def stream(
    source: Path = typer.Argument(..., metavar="IN.plr", help="The recording to send."),
    to: str = typer.Option(
        ...,
        metavar="TARGET",
        help=f"Where to: {FORMS}. {BAUD} baud if not said; the boards of QEMU are {BOARDS}.",
    ),
    record: Path | None = typer.Option(
        None,
        metavar="OUT.plr",
        help="Keep what both sides said, as a recording: replayed, it gives the robot's bits. Cut "
        "short, it is whole up to there; as OUT.plr.zst up to the last 32 KB.",
    ),
    view: str | None = VIEW,
    compare: bool = typer.Option(
        False,
        "--compare",
        help="Replay it on this machine too, and compare every bit: pelorus compare.",
    ),
    image: Path | None = typer.Option(
        None, metavar="ELF", help="Firmware for qemu:BOARD; else that of build/robot."
    ),
    programs: Path | None = PROGRAMS,
    frames: int | None = typer.Option(
        None, min=1, metavar="N", help="Stop after so many stereo frames."
    ),
    answer: float | None = typer.Option(
        None,
        min=0.01,
        metavar="S",
        show_default=f"{ANSWER_S:g}",
        help="How long to wait for the answer to a frame.",
    ),
    save_state: bool = typer.Option(
        False,
        "--save-state",
        help="Have the board keep its state at the end, over a power cut. Under qemu:BOARD it is "
        "gone with the emulator, so at the end of this command.",
    ),
    restore_state: bool = typer.Option(
        False,
        "--restore-state",
        help="Have it go on from the state that it kept; no START is sent.",
    ),
    moved: tuple[float, float] = typer.Option(
        (0.0, 0.0),
        metavar="M RAD",
        help="With --restore-state: how far it may have moved meanwhile, one sigma.",
    ),
) -> None:
    """Send a recording to a robot controller, real or emulated, as its sensors would."""
    if compare and restore_state:
        raise PelorusError("--compare knows no state that a board kept: leave --restore-state out")
    if any(moved) and not restore_state:
        raise PelorusError("--moved is of the time between two drives: it needs --restore-state")
    if record is not None and record.exists() and source.exists() and record.samefile(source):
        raise PelorusError(f"{record}: is the recording to send; --record needs another file")
    messages = _to_send(source, frames, moved if restore_state else None, save_state)
    streamer: Streamer | None = None
    verdict = BitsVerdict.SAME
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        log_path = record or (Path(folder) / "flight.plr" if compare else None)
        try:
            with (
                _ended_in_order(),
                open_target(to, image) as link,
                _log_file(log_path) as log,
                watching(view) as watch,
                _display(messages) as show,
            ):
                streamer = Streamer(link, log, show, answer, watch)
                outcome = streamer.run(messages)
        except (PelorusError, KeyboardInterrupt) as error:
            if streamer is not None:
                _tell(streamer.outcome, record)
            if streamer is None or isinstance(error, KeyboardInterrupt):
                raise
            raise PelorusError(f"{error} ({_how_far(streamer.outcome, messages)})") from error
        _tell(outcome, record)
        if compare and log_path is not None:
            verdict = compare_log(log_path, programs)
    if save_state and outcome.state_trouble:
        raise PelorusError(f"{to}: {outcome.state_trouble}")
    if not outcome.poses:
        raise PelorusError(f"{to}: took {outcome.frames} frames and gave no pose")
    if verdict is not BitsVerdict.SAME:
        raise typer.Exit(verdict)


def _to_send(
    source: Path, frames: int | None, moved: tuple[float, float] | None, save_state: bool
) -> list[Message]:
    """Returns the recording's messages, with `moved` from a kept state on, not from a START."""
    received, _ = read_file(source)
    header_of(received, source)
    messages = _first_frames([frame.message for frame in received], frames)
    if moved is not None:
        messages = restored(messages, moved)
    return saved(messages) if save_state else messages


def _first_frames(messages: list[Message], frames: int | None) -> list[Message]:
    """Returns the recording up to and with its n-th stereo frame."""
    stereos = [at for at, message in enumerate(messages) if message.kind == Kind.STEREO]
    if frames is None or frames >= len(stereos):
        return messages
    return messages[: stereos[frames - 1] + 1]


def _stereos(messages: list[Message]) -> int:
    return sum(message.kind == Kind.STEREO for message in messages)


def _how_far(outcome: StreamResult, messages: list[Message]) -> str:
    return f"after {outcome.frames} of {_stereos(messages)} frames"


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Ends the drive at a request to terminate as at Ctrl-C, which also ends the emulator."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _log_file(path: Path | None) -> Iterator[BinaryIO | None]:
    if path is None:
        yield None
        return
    with writing(path):
        stream = packed_file.create(path, packed_file.is_packed(path), live=True)
    try:
        yield stream
    finally:
        with suppress(OSError):  # what could not be written has been told
            stream.close()


@contextmanager
def _display(messages: list[Message]) -> Iterator[Callable[[Pose], None]]:
    """Yields what shows a pose: a bar with the latest position, on a terminal."""
    columns = ("{task.description}", BarColumn(bar_width=20), TaskProgressColumn())
    more = (TimeRemainingColumn(), "{task.fields[where]}")
    start_ns: int | None = None  # a clock may count from 1970
    quiet = not err.is_terminal
    with Progress(*columns, *more, console=err, transient=True, disable=quiet) as progress:
        total = _stereos(messages)
        task = progress.add_task("streaming", total=total, where="waiting for the board")

        def show(pose: Pose) -> None:
            nonlocal start_ns
            start_ns = pose.t_ns if start_ns is None else start_ns
            x, y, z = pose.p_WB_m
            seconds = (pose.t_ns - start_ns) * 1e-9
            where = f"{seconds:.2f} s   x {x:.2f}  y {y:.2f}  z {z:.2f} m"
            progress.update(task, advance=1, where=where)

        yield show


def _tell(outcome: StreamResult, record: Path | None) -> None:
    tell_lines(_summary(outcome, record))


def _summary(outcome: StreamResult, record: Path | None) -> Iterator[tuple[str, str]]:
    for remark in outcome.texts[:TEXTS_SHOWN]:
        yield "board", one_line(remark.text)
    if len(outcome.texts) > TEXTS_SHOWN:
        yield "board", f"and {len(outcome.texts) - TEXTS_SHOWN} remarks more"
    if outcome.config is not None:
        build = outcome.config
        yield (
            "build",
            f"{build.build_fingerprint:#010x}: {build.max_landmarks} landmarks, "
            f"{build.max_observations} observations, float{8 * build.real_bytes}",
        )
    yield "frames", f"{outcome.frames} sent, {len(outcome.poses)} answered with a pose"
    lost = outcome.unanswered
    yield "lost", f"{lost} without an answer; {outcome.restarts} restarts of the board"
    frames = {(Kind.STEREO, status): n for status, n in outcome.reports.items() if status != 0}
    for (subject, status), count in sorted((frames | outcome.refused).items()):
        yield "refused", refusal(subject, status, count)
    if outcome.worst_update_us:
        clock = "by the board's clock (an emulator's is not the chip's: docs/SIZES.md)"
        yield "slowest", f"{outcome.worst_update_us} us for a frame, {clock}"
    if record is not None:
        yield "recorded", str(record)
