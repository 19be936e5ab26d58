# SPDX-License-Identifier: MIT
"""Startup, UART, clock, stack and faults, on the image that holds no filter."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from pelorus.robot.emulator import Emulator
from pelorus.robot.link import Link
from pelorus.wire.frames import Text
from pelorus.wire.framing import Reader

HANG_S = 1800.0
WHOLE_NS = 0.5e9  # many turns of the counter
WITHOUT_WATCHDOG = {"stm32f405": "QEMU does not model the STM32's independent watchdog"}


class Console:
    """The bring-up image's lines."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._held = b""

    def read_until(self, end: bytes) -> bytes:
        deadline = time.monotonic() + HANG_S
        while end not in self._held:
            assert time.monotonic() < deadline, f"only {self._held!r} came"
            self._held += self._link.exchange(b"", 0.2)
        line, _, self._held = self._held.partition(end)
        return line

    def line(self) -> str:
        return self.read_until(b"\n").decode()

    def ask(self, words: str) -> str:
        self.send(words)
        return self.line()

    def send(self, words: str) -> None:
        self._held += self._link.exchange(words.encode() + b"\n")  # it answers while we send

    def fault_report(self) -> str:
        """The TEXT frame between two delimiters."""
        self.read_until(b"\0")
        frames = list(Reader().feed(self.read_until(b"\0") + b"\0"))
        assert len(frames) == 1
        message = frames[0].message
        assert isinstance(message, Text)
        assert message.severity == 2
        return message.text


@pytest.fixture
def console(board: str, robot: Path) -> Iterator[Console]:
    with Emulator(board, robot / "images" / f"bringup-{board}.elf") as emulator:
        link = emulator.connect()
        console = Console(link)
        assert console.line() == f"hello from {board}: power-on"
        yield console
        link.close()


def test_lines_come_back(console: Console) -> None:
    assert console.ask("anything else") == "echo anything else"


def test_a_burst_larger_than_both_rings_loses_nothing(console: Console) -> None:
    lines = [f"line {number:04} {'x' * 40}" for number in range(400)]
    console.send("\n".join(lines))
    for line in lines:
        assert console.line() == f"echo {line}"


def test_the_clock_ascends_and_does_not_wrap_with_its_counter(console: Console) -> None:
    times: list[int] = []
    while not times or times[-1] - times[0] < WHOLE_NS:
        times.append(int(console.ask("time").removeprefix("ns ")))
        assert times == sorted(times)
        time.sleep(0.05)


def test_the_stack_is_measured(console: Console) -> None:
    used, size = map(int, re.findall(r"\d+", console.ask("stack")))
    assert 100 < used < size


def test_fused_multiply_add_rounds_once(console: Console) -> None:
    assert console.ask("fused") == "fused yes"


def test_a_fault_is_reported_survives_the_reset_and_is_counted(
    console: Console, board: str
) -> None:
    for count in (1, 2):
        console.send("fault")
        assert console.fault_report().startswith("usage fault at pc 0x")
        hello = console.line()
        assert hello.startswith(f"hello from {board}: reset after usage fault at pc 0x")
        assert hello.endswith(f"fault {count} since power-on")


def test_a_stack_overflow_is_reported_as_one(console: Console, board: str) -> None:
    console.send("overflow")
    assert console.fault_report().startswith("stack overflow: ")
    assert console.line().startswith(f"hello from {board}: reset after ")


def test_the_watchdog_bites_a_hanging_program(console: Console, board: str) -> None:
    if board in WITHOUT_WATCHDOG:
        pytest.skip(WITHOUT_WATCHDOG[board])
    console.send("hang")
    assert console.fault_report().startswith("watchdog at pc 0x")
    assert console.line().startswith(f"hello from {board}: reset after watchdog")
