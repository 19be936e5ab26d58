# SPDX-License-Identifier: MIT
"""The replay programs: where they are, and one run of them."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.markup import escape

from pelorus.errors import PelorusError, write_text, writing
from pelorus.native import binding
from pelorus.program.console import err, waiting
from pelorus.wire import packed_file
from pelorus.wire.frames import Kind, Message, Pose, Report
from pelorus.wire.framing import Writer, counted_messages_of, messages_of, stuffed_of

SETTINGS_MAX_DEPTH = "max-depth"


@dataclass(frozen=True)
class Programs:
    """The two precisions of the filter."""

    float32: Path
    float64: Path


def find_programs(folder: Path | None) -> Programs:
    """Returns the programs in the folder given, else in $PELORUS_BIN, the package or build/bin."""
    candidates = binding.folders(folder)
    for candidate in candidates:
        programs = Programs(
            candidate / f"pelorus-replay{binding.EXE}",
            candidate / f"pelorus-replay-f64{binding.EXE}",
        )
        if programs.float32.is_file() and programs.float64.is_file():
            return programs
    raise PelorusError(
        f"{', '.join(map(str, candidates))}: holds no pelorus-replay and pelorus-replay-f64: this "
        "package was installed without them, or for another system; install one that has them, "
        "or build them and name their folder with --bin or PELORUS_BIN"
    )


def threads() -> int:
    """Returns how many replays may run side by side: as many as there are processors.

    $PELORUS_THREADS gives another number: of a fleet's workers each has one.
    """
    return int(os.environ.get("PELORUS_THREADS") or os.cpu_count() or 1)


@dataclass(frozen=True)
class Outputs:
    """What one run writes: runs/NAME.tum, .plr, .json."""

    trajectory: Path
    log: Path
    summary: Path

    @classmethod
    def named(cls, folder: Path, name: str) -> Outputs:
        return cls(*(folder / f"{name}.{end}" for end in ("tum", "plr", "json")))


def replay(
    program: Path, recording: Path, options: Sequence[str], outputs: Outputs
) -> tuple[dict[str, Any], list[str]]:
    """Runs the filter; returns its summary and its remarks."""
    wanted = [
        *("--trajectory", str(outputs.trajectory), "--out", str(outputs.log), "--force", "--json"),
    ]
    stdout, stderr = run_program(program, recording, [*options, *wanted])
    try:
        summary = json.loads(stdout)
    except json.JSONDecodeError as error:
        raise PelorusError(f"{program}: its summary is no JSON: {error}") from error
    write_text(outputs.summary, stdout)
    return summary, [line for line in stderr.splitlines() if line.strip()]


class NothingUsefulError(PelorusError):
    """Nothing useful could be done with the recording (the program's exit status 1)."""


def stuffed_answers(program: Path, recording: Path, options: Sequence[str]) -> list[bytes]:
    """Returns the frames of the filter's poses and reports on a recording, not yet decoded."""
    with tempfile.TemporaryDirectory(prefix="pelorus-", dir=recording.parent) as folder:
        answers = Path(folder) / "answers.plr"
        wanted = ["--quiet", "--answers", "--out", str(answers)]
        run_program(program, recording, [*options, *wanted])
        return stuffed_of(answers)


def replayed(program: Path, inputs: Iterable[Message], options: Sequence[str]) -> list[Message]:
    """Returns these messages with the filter's answers."""
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        recording, answers = Path(folder) / "inputs.plr", Path(folder) / "answers.plr"
        with writing(recording), recording.open("wb") as stream:
            writer = Writer(stream)
            for message in inputs:
                if message.kind != Kind.END:
                    writer.write(message)
            writer.end()
        try:
            run_program(program, recording, ["--quiet", *options, "--out", str(answers)])
        except PelorusError as error:
            words = str(error).replace(str(recording), "the inputs of the log")
            raise PelorusError(words) from error
        return messages_of(answers)


def result_of(source: Path, options: Sequence[str], programs: Path | None) -> list[Message]:
    """Returns a result's messages as they are, or those of a recording's replay in float32."""
    messages, counts = counted_messages_of(source)
    lost = counts.damaged + counts.malformed + counts.too_long
    if lost:
        frames = f"{lost} frames are" if lost > 1 else "one frame is"
        err.print(f"[bold yellow]warning:[/] {escape(str(source))}: {frames} damaged and left out")
    if any(isinstance(m, Pose) and m.after_stereo for m in messages):
        if options:
            raise PelorusError(
                f"{source}: holds a filter's result already: --config and --set are for recordings"
            )
        return messages
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        outputs = Outputs.named(Path(folder), "result")
        _, said = replay(find_programs(programs).float32, source, options, outputs)
        for line in said:
            err.print(escape(line))
        return messages_of(outputs.log)


def whole_log_of(source: Path, options: Sequence[str], programs: Path | None) -> list[Message]:
    """Returns a result that has reports of its frames, too."""
    messages = result_of(source, options, programs)
    if not any(isinstance(m, Report) and m.subject == Kind.STEREO for m in messages):
        raise PelorusError(f"{source}: holds no REPORT of a frame: a whole log is expected")
    return messages


def depth_limit_m(program: Path, recording: Path, options: Sequence[str]) -> float:
    """Returns the max-depth in force, 0 for none; the program reads its own config files."""
    stdout, _ = run_program(program, recording, [*options, "--print-config"])
    for line in stdout.splitlines():
        name, _, value = line.partition("=")
        if name.strip() == SETTINGS_MAX_DEPTH:
            return float(value.partition("#")[0])
    raise PelorusError(f"{program}: --print-config names no {SETTINGS_MAX_DEPTH}")


def run_program(program: Path, recording: Path, options: Sequence[str]) -> tuple[str, str]:
    """Returns what it printed on both streams.

    Raises PelorusError with its words if it fails.
    """
    name, unpacked = packed_file.for_program(recording)
    command = [str(program), name, *options]
    try:
        with waiting(f"replaying {recording.name}"):
            done = subprocess.run(command, input=unpacked, capture_output=True, check=False)
    except OSError as error:
        raise PelorusError(f"{program}: cannot be run: {error.strerror}") from error
    stdout, stderr = (said.decode("utf-8", "replace") for said in (done.stdout, done.stderr))
    if done.returncode != 0:
        how = f"status {done.returncode}" if done.returncode > 0 else f"signal {-done.returncode}"
        said = stderr.replace(f"{program.name}: ", "").strip() or "it said nothing"
        raised = NothingUsefulError if done.returncode == 1 else PelorusError
        raise raised(f"{recording}: {program.name} ended with {how}:\n{said}")
    return stdout, stderr
