# SPDX-License-Identifier: MIT
"""A board in QEMU: its machine, its image, and the sockets that are its UARTs."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

from pelorus.errors import PelorusError
from pelorus.robot import link
from pelorus.robot.link import Link, LinkClosed

MACHINES = {
    "mps2_an386": "mps2-an386",
    "mps2_an500": "mps2-an500",
    "mps3_an547": "mps3-an547",
    "stm32f405": "netduinoplus2",
}
IMAGES = Path("build/robot/images")
SOURCE_ROOT = Path(__file__).resolve().parents[3]
STOP_S = 5.0
ELF = b"\x7fELF"


def image_of(board: str) -> Path:
    """Returns the firmware of tools/robot-demo.sh: below this folder, or in the source tree."""
    if board not in MACHINES:
        raise PelorusError(f"there is no board {board}; QEMU can be {', '.join(MACHINES)}")
    name = IMAGES / f"pelorus-{board}-n32.elf"
    for image in (name, SOURCE_ROOT / name):
        if image.exists():
            return image
    raise PelorusError(
        f"{name}: no such image; tools/robot-demo.sh {board} builds it; or give --image"
    )


class Emulator:
    """Runs an image; a context manager that ends the emulator with the block."""

    def __init__(self, board: str, image: Path, options: tuple[str, ...] = ()) -> None:
        if board not in MACHINES:
            raise PelorusError(f"there is no board {board}; QEMU can be {', '.join(MACHINES)}")
        if not image.is_file():
            raise PelorusError(f"{image}: no such image")
        with image.open("rb") as stream:
            if stream.read(len(ELF)) != ELF:
                raise PelorusError(f"{image}: is no firmware image; give the .elf of a board")
        self.board = board
        self._image = image
        self._options = options

    def __enter__(self) -> Emulator:
        program = shutil.which("qemu-system-arm")
        if program is None:
            raise PelorusError("qemu-system-arm is not installed (Debian: qemu-system-arm)")
        self._folder = tempfile.TemporaryDirectory(prefix="pelorus-")
        self._uart = Path(self._folder.name) / "uart"
        self._telemetry = Path(self._folder.name) / "telemetry"
        self._control = Path(self._folder.name) / "control"
        self._log = (Path(self._folder.name) / "log").open("w+")
        command = [program, "-M", MACHINES[self.board], "-kernel", str(self._image)]
        command += ["-display", "none", "-monitor", "none", *self._options]
        command += ["-chardev", f"socket,id=second,path={self._telemetry},server=on,wait=off"]
        command += ["-chardev", f"socket,id=link,path={self._uart},server=on,wait=on"]
        command += ["-serial", "chardev:link", "-serial", "chardev:second"]
        command += ["-qmp", f"unix:{self._control},server=on,wait=off"]
        self._process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=self._log, stderr=self._log
        )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.terminate()
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._log.close()
        self._folder.cleanup()

    def connect(self) -> Link:
        """Connects to the board's UART; the board starts with the first connection."""
        return self._connect(self._uart)

    def connect_telemetry(self) -> Link:
        """Connects to its second UART, which must come first if nothing is to be missed."""
        return self._connect(self._telemetry)

    def _connect(self, path: Path) -> Link:
        try:
            return link.unix(path)
        except PelorusError as error:
            raise PelorusError(f"{self.board}: {self.trouble() or error}") from error

    def trouble(self, patience_s: float = 0.0) -> str:
        """Returns the emulator's words if it has stopped, or stops within that time; else empty."""
        try:
            self._process.wait(patience_s)
        except subprocess.TimeoutExpired:
            return ""
        self._log.seek(0)
        return f"QEMU stopped with status {self._process.returncode}: {self._log.read().strip()}"

    def reset(self) -> None:
        """Presses the board's reset button."""
        with socket.socket(socket.AF_UNIX) as control:
            control.settimeout(STOP_S)
            control.connect(str(self._control))
            stream = control.makefile("rw")
            stream.readline()  # the greeting
            for command in ("qmp_capabilities", "system_reset"):
                stream.write(json.dumps({"execute": command}) + "\n")
                stream.flush()
                while "return" not in json.loads(stream.readline()):
                    pass  # an event


# --- where to -------------------------------------------------------------------------------------


BAUD = 921600
LAST_WORDS_S = 2.0  # from an emulator's closing of its sockets to its end
FORMS = "qemu:BOARD, tcp:HOST:PORT or serial:DEVICE[:BAUD]"


@contextmanager
def open_target(target: str, image: Path | None) -> Iterator[Link]:
    """Connects to a target for the duration of the block; `image` is the emulator's firmware."""
    scheme, _, rest = target.partition(":")
    if scheme == "qemu" and rest:
        with Emulator(rest, image or image_of(rest)) as emulator:
            try:
                yield from _closing(emulator.connect())
            except LinkClosed as error:
                trouble = emulator.trouble(LAST_WORDS_S) or error
                raise LinkClosed(f"{target}: {trouble}") from error
        return
    if image is not None:
        raise PelorusError(f"{target}: --image is for qemu:BOARD alone")
    yield from _closing(_open(target, scheme, rest))


def _closing(opened: Link) -> Iterator[Link]:
    try:
        yield opened
    finally:
        opened.close()


def _open(target: str, scheme: str, rest: str) -> Link:
    if scheme == "tcp":
        host, _, port = rest.rpartition(":")
        if host and port.isdecimal() and 0 < int(port) < 65536:
            return link.tcp(host, int(port))
    if scheme == "serial" and rest:
        from pelorus.robot.serial import open_serial  # noqa: PLC0415 - Windows has no termios

        device, _, baud = rest.rpartition(":")
        if device and baud.isdecimal():
            return open_serial(Path(device), int(baud))
        return open_serial(Path(rest), BAUD)
    raise PelorusError(f"--to {target!r}: no such target; it may be {FORMS}")
