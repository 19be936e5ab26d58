# SPDX-License-Identifier: MIT
"""The image for the STM32H743 with its cameras, which no emulator has: what its bytes tell."""

from __future__ import annotations

import struct
import subprocess
from pathlib import Path

import pytest

FLASH = 0x08000000
DATA_TCM = range(0x20000000, 0x20020000)
AXI_SRAM = range(0x24000000, 0x24080000)
SRAM1_AND_2 = range(0x30000000, 0x30040000)
SRAM3 = range(0x30040000, 0x30048000)  # the MPU's region without cache
# Reference manual RM0433, table of vectors.
HANDLERS = {
    11: "camera_strip_isr",  # DMA1, stream 0
    12: "serial_telemetry_isr",  # DMA1, stream 1
    28: "moments_isr",  # TIM2
    30: "camera_trigger_isr",  # TIM4
    35: "imu_bus_isr",  # SPI1
    39: "serial_link_isr",  # USART3
}


@pytest.fixture
def image(robot: Path) -> Path:
    return robot / "images" / "eyes-stm32h743.elf"


def symbols(image: Path) -> dict[str, tuple[int, int]]:
    """Returns address and size of each."""
    listing = subprocess.run(
        ["arm-none-eabi-nm", "-S", str(image)], capture_output=True, text=True, check=True
    ).stdout
    rows = [line.split() for line in listing.splitlines()]
    return {row[-1]: (int(row[0], 16), int(row[1], 16)) for row in rows if len(row) == 4}


def assert_inside(place: tuple[int, int], memory: range) -> None:
    assert place[0] in memory
    assert place[0] + place[1] - 1 in memory


def test_everything_lies_in_the_memory_that_it_needs(image: Path) -> None:
    places = symbols(image)
    for name in ("strips", "blocks"):  # what a DMA writes or reads
        assert_inside(places[name], SRAM3)
        assert places[name][0] % 32 == 0
    for name in ("session", "eyes", "first_pair"):
        assert_inside(places[name], AXI_SRAM)
    assert_inside(places["second_pair"], SRAM1_AND_2)
    for name in ("record", "fault_stack", "queue", "pairs"):
        assert_inside(places[name], DATA_TCM)
    both = places["first_pair"][1] + places["second_pair"][1]
    assert both == 4 * 376 * 240


def test_interrupts_are_in_their_places_of_the_vector_table(image: Path, tmp_path: Path) -> None:
    places, raw = symbols(image), tmp_path / "image.bin"
    subprocess.run(["arm-none-eabi-objcopy", "-O", "binary", image, raw], check=True)
    start, size = places["board_vectors"]
    assert start == FLASH
    vectors = struct.unpack(f"<{size // 4}I", raw.read_bytes()[:size])
    assert len(vectors) == 16 + 150
    assert vectors[0] in DATA_TCM
    for number, name in HANDLERS.items():
        assert vectors[16 + number] == places[name][0] | 1, name
    assert sum(vector != 0 for vector in vectors[16:]) == len(HANDLERS)
