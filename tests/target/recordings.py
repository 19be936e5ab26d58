# SPDX-License-Identifier: MIT
"""Makes the recordings that the emulated boards are given.

usage: recordings.py FOLDER [--long]

The simulated ones always, of which those in FOLDER/light cost a board little; Starry Night, 0027
and 03 where $PELORUS_DATA has them: 100 steps, 30 and 30 frames of them, with --long the whole of
all three. What is there already is kept.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from pelorus.wire.frames import Config, End, Header, Kind, Message
from pelorus.wire.framing import Writer, messages_of, read_file, write_file
from pelorus.wire.settings import IDS

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("PELORUS_DATA", ROOT.parent / "shared" / "data"))
SIMULATION: tuple[str, ...] = ("simulate", "{out}", "--seed", "7", "--duration", "4")
# What costs an emulated board most is a byte on its UART: few observations, few twists.
LIGHT: dict[str, tuple[str, ...]] = {
    "drive": (*SIMULATION, "--observations", "6", "--speed", "1", "--twist-rate", "20"),
    # So long that it is under way whenever a busy machine comes to interrupting it.
    "endless": (
        *("simulate", "{out}", "--duration", "1200", "--twist-rate", "10"),
        *("--observations", "5", "--landmarks", "200"),
    ),
}
# By an IMU that finds its tilt while the body stands, and then drives off.
INERTIAL: tuple[str, ...] = (
    *("simulate", "{out}", "--seed", "7", "--duration", "4", "--observations", "20"),
    *("--imu-rate", "200", "--rest", "2", "--start", "pose", "--outliers", "0"),
)
# The same, and the settings by which focal length, baseline and turn are estimated.
CALIBRATED = {
    **{"calibrate": 7.0, "focal-sigma": 0.02, "baseline-sigma": 0.02},
    "camera-turn-sigma": 0.02,
}
AS_IT_IS = ("convert", "ece276a", "{in}", "{out}", "--fix", "none", "--twist-timing", "end")
REAL: dict[str, tuple[tuple[str, ...], str, int]] = {
    "starry-night": (
        ("convert", "starry-night", "{in}", "{out}"),
        "starry-night/dataset3.mat",
        100,
    ),
    "0027": (AS_IT_IS, "ece276a/0027.npz", 30),
    "03": (AS_IT_IS, "ece276a/03.npz", 30),
}


def pelorus(words: tuple[str, ...], source: Path, target: Path) -> None:
    """Run the command `pelorus`."""
    arguments = [word.format(**{"in": source, "out": target}) for word in words]
    subprocess.run([sys.executable, "-m", "pelorus", *arguments], check=True, stdout=sys.stderr)


def cut(whole: Path, part: Path, frames: int) -> None:
    """Keep what comes up to and with the n-th stereo frame."""
    messages = [frame.message for frame in read_file(whole)[0]]
    with part.open("wb") as stream:
        writer = Writer(stream)
        for message in first_frames(messages, frames):
            writer.write(message)
        writer.end()


def with_settings(source: Path, target: Path, settings: dict[str, float]) -> None:
    """The recording, which asks for these settings too."""
    asked = {IDS[name]: value for name, value in settings.items()}
    messages = [m for m in messages_of(source) if not isinstance(m, End)]
    before = [m for m in messages if isinstance(m, (Header, Config))]
    others = [m for m in messages if not isinstance(m, (Header, Config))]
    write_file(target, [*before, Config(asked), *others], len(messages) + 1)


def first_frames(messages: list[Message], frames: int) -> list[Message]:
    """The messages up to and with the n-th stereo frame, without END."""
    stereos = [at for at, message in enumerate(messages) if message.kind == Kind.STEREO]
    last = stereos[min(frames, len(stereos)) - 1]
    return [message for message in messages[: last + 1] if message.kind != Kind.END]


def main() -> None:
    """See the module's text."""
    folder = Path(sys.argv[1])
    (folder / "whole").mkdir(parents=True, exist_ok=True)
    (folder / "light").mkdir(exist_ok=True)
    made = {folder / "simulated.plr": SIMULATION, folder / "imu.plr": INERTIAL}
    made.update({folder / "light" / f"{name}.plr": words for name, words in LIGHT.items()})
    for simulated, words in made.items():
        if not simulated.exists():
            pelorus(words, simulated, simulated)
    if not (calibrated := folder / "calibrated.plr").exists():
        with_settings(folder / "imu.plr", calibrated, CALIBRATED)
    for name, (words, path, frames) in REAL.items():
        source, whole, part = DATA / path, folder / "whole" / f"{name}.plr", folder / f"{name}.plr"
        if not source.exists():
            print(f"SKIPPED {source}: not there, so the boards are not given {name}")
            continue
        if not whole.exists():
            pelorus(words, source, whole)
        if not part.exists():
            cut(whole, part, frames)
        if "--long" in sys.argv[2:] and not (folder / f"{name}-whole.plr").exists():
            (folder / f"{name}-whole.plr").symlink_to(whole.resolve())


if __name__ == "__main__":
    main()
