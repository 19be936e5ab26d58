#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Uses the library as a stranger would: the README's C example, built in three ways and run.

usage: consumer.py PROJECT_ROOT BUILD_FOLDER CMAKE CC

The ways: installed and found by find_package(pelorus); as add_subdirectory(pelorus); and by one
compiler command over all sources. Exit status 77 (skipped) as long as there is no README.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

SKIPPED = 77
C_BLOCK = re.compile(r"^```c\n(.*?)^```", re.DOTALL | re.MULTILINE)

CMAKE_LISTS = """cmake_minimum_required(VERSION 3.22)
project(consumer LANGUAGES C)
{get_pelorus}
add_executable(example example.c)
target_link_libraries(example PRIVATE pelorus::pelorus)
"""


def run(*command: str | Path) -> str:
    """The command's output; what it printed and SystemExit if it failed."""
    result = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, check=False
    )
    if result.returncode != 0:
        print("$", *command)
        print(result.stdout, result.stderr, sep="\n")
        raise SystemExit(1)
    return result.stdout


def build_with_cmake(folder: Path, example: str, cmake: str, cc: str, get_pelorus: str) -> Path:
    """The program, from a CMake project that gets the library by the line `get_pelorus`."""
    folder.mkdir()
    (folder / "example.c").write_text(example, encoding="utf-8")
    (folder / "CMakeLists.txt").write_text(
        CMAKE_LISTS.format(get_pelorus=get_pelorus), encoding="utf-8"
    )
    options = (f"-DCMAKE_C_COMPILER={cc}", "-DCMAKE_C_FLAGS=-O0")
    run(cmake, "-S", folder, "-B", folder / "build", *options)
    run(cmake, "--build", folder / "build", "-j2", "--target", "example")
    return folder / "build/example"


def build_with_one_command(folder: Path, example: str, root: Path, cc: str) -> Path:
    """The program, from one call of the compiler, and without libm."""
    folder.mkdir()
    (folder / "example.c").write_text(example, encoding="utf-8")
    sources = sorted((root / "src").glob("*/*.c"))
    run(
        cc, "-std=c99", "-O0", "-DPLR_PORTABLE=1", "-ffp-contract=off", "-fno-math-errno",
        f"-I{root / 'include'}", f"-I{root / 'src'}",
        folder / "example.c", *sources, "-o", folder / "example",
    )  # fmt: skip
    return folder / "example"


def check_sizes(folder: Path, example: str, prefix: Path, cc: str) -> None:
    """By hand, the installed library is that of the headers' defaults; other sizes are refused."""
    folder.mkdir()
    (folder / "example.c").write_text(example, encoding="utf-8")
    (library,) = prefix.glob("lib*/**/libpelorus.a")
    command: list[str | Path] = [
        cc,
        "-std=c99",
        f"-I{prefix / 'include'}",
        folder / "example.c",
        library,
        "-o",
    ]
    run(*command, folder / "same")
    run(folder / "same")
    run(*command, folder / "other", "-DPLR_MAX_LANDMARKS=16")
    refused = subprocess.run([folder / "other"], capture_output=True, text=True, check=False)
    if refused.returncode == 0 or "other sizes" not in refused.stdout + refused.stderr:
        print("compiled for 16 landmarks, the example runs with a library for 32:")
        print(refused.stdout, refused.stderr, sep="\n")
        raise SystemExit(1)


def readme_example(root: Path) -> str:
    """The first C block of the README."""
    readme = root / "README.md"
    if not readme.is_file():
        print("skipped: no README.md yet")
        raise SystemExit(SKIPPED)
    block = C_BLOCK.search(readme.read_text(encoding="utf-8"))
    if block is None:
        print("README.md holds no ```c block")
        raise SystemExit(1)
    return block.group(1)


def main() -> int:
    """Builds and runs the example in three ways; the exit status."""
    if len(sys.argv) != 5:
        print(__doc__, file=sys.stderr)
        return 2
    root, build, cmake, cc = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], sys.argv[4]
    example = readme_example(root)
    with tempfile.TemporaryDirectory(prefix="pelorus-consumer-") as name:
        here = Path(name)
        prefix = here / "prefix"
        run(cmake, "--install", build, "--prefix", prefix)
        programs = [
            build_with_cmake(
                here / "installed",
                example,
                cmake,
                cc,
                f'find_package(pelorus REQUIRED PATHS "{prefix}" NO_DEFAULT_PATH)',
            ),
            build_with_cmake(
                here / "inside", example, cmake, cc, f'add_subdirectory("{root}" pelorus)'
            ),
            build_with_one_command(here / "bare", example, root, cc),
        ]
        outputs = [run(program) for program in programs]
        check_sizes(here / "sizes", example, prefix, cc)
    print(outputs[0], end="")
    if len(set(outputs)) != 1:
        print("the three builds print different things:", *outputs, sep="\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
