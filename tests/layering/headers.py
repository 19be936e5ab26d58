#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compiles every public header alone, as C99 and as C++17, by every compiler at hand, and links a
C++ program that includes it before all others with a library that a C compiler made.

usage: headers.py PROJECT_ROOT
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

C_COMPILERS = ("gcc", "clang", "clang-14")
CXX_COMPILERS = ("g++", "clang++", "clang++-14")
WARNINGS = ["-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Wshadow", "-Werror"]
C_FLAGS = ["-std=c99", *WARNINGS, "-Wdouble-promotion", "-Wvla", "-Wmissing-prototypes"]
CXX_FLAGS = ["-std=c++17", *WARNINGS]
# A call into each header that declares functions.
CXX_PROGRAM = """#include "pelorus/pelorus.h"
#include "pelorus/session.h"
#include "pelorus/state_store.h"

static plr_filter filter;
static plr_session session;

int main() {
    plr_calibration camera = plr_calibration();
    plr_config config;
    plr_port port = plr_port();
    plr_session_options options;
    plr_config_default(&config);
    plr_session_options_default(&options);
    const bool refused =
        plr_filter_init(&filter, &camera, &config, 0) == PLR_E_CALIBRATION &&
        plr_filter_landmark_count(&filter) == 0 &&
        plr_session_init(&session, &port, &options) == PLR_E_ARGUMENT &&
        plr_state_store_init(0, 0) == PLR_E_ARGUMENT &&
        plr_writer_init(0, 0, 0) == PLR_E_ARGUMENT && plr_setting_count() > 0;
    return refused ? 0 : 1;
}
"""


def compile_alone(compiler: str, flags: list[str], language: str, root: Path, header: Path) -> bool:
    """True if a file that holds nothing but the include compiles without a warning."""
    name = header.relative_to(root / "include")
    result = subprocess.run(
        [compiler, *flags, f"-I{root / 'include'}", "-x", language, "-fsyntax-only", "-"],
        input=f'#include "{name}"\n',
        capture_output=True,
        text=True,
        check=False,
    )
    if result.returncode != 0:
        print(f"{name} does not compile alone by {compiler} {flags[0]}:\n{result.stderr}")
    return result.returncode == 0


def objects_of(root: Path, folder: Path) -> list[Path]:
    """The library, compiled as C; portable, for any processor."""
    flags = ["-std=c99", "-O0", "-DPLR_PORTABLE=1", "-ffp-contract=off", "-fno-math-errno"]
    sources = sorted((root / "src").glob("*/*.c"))
    includes = [f"-I{root / 'include'}", f"-I{root / 'src'}"]
    subprocess.run(["cc", *flags, *includes, "-c", *sources], cwd=folder, check=True)
    return sorted(folder.glob("*.o"))


def link_from_cxx(compiler: str, objects: list[Path], root: Path, header: Path) -> bool:
    """True if a C++ program that includes this header first finds what it calls."""
    first = f'#include "{header.relative_to(root / "include")}"\n'
    with tempfile.TemporaryDirectory(prefix="pelorus-headers-") as name:
        source, program = Path(name) / "main.cpp", Path(name) / "main"
        source.write_text(first + CXX_PROGRAM, encoding="utf-8")
        result = subprocess.run(
            [compiler, *CXX_FLAGS, "-DPLR_PORTABLE=1", f"-I{root / 'include'}"]
            + [str(path) for path in (source, *objects)]
            + ["-o", str(program)],
            capture_output=True,
            text=True,
            check=False,
        )
        works = result.returncode == 0 and subprocess.run([program], check=False).returncode == 0
    if not works:
        print(f"a C++ program that includes {header.name} first does not link or run by {compiler}")
        print(result.stderr)
    return works


def link_all(root: Path, headers: list[Path]) -> tuple[int, int]:
    """How many headers may stand first in a C++ program, and how many may not."""
    compiler = next((name for name in CXX_COMPILERS if shutil.which(name)), None)
    if compiler is None:
        return 0, 0
    with tempfile.TemporaryDirectory(prefix="pelorus-objects-") as name:
        objects = objects_of(root, Path(name))
        linked = [link_from_cxx(compiler, objects, root, header) for header in headers]
    return sum(linked), len(linked) - sum(linked)


def main() -> int:
    """Compiles them all; the exit status."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    root = Path(sys.argv[1]).resolve()
    headers = sorted((root / "include/pelorus").glob("*.h"))
    passed = failed = 0
    for compilers, flags, language in (
        (C_COMPILERS, C_FLAGS, "c"),
        (CXX_COMPILERS, CXX_FLAGS, "c++"),
    ):
        present = [compiler for compiler in compilers if shutil.which(compiler)]
        if not present:
            print(f"no compiler for {language} here: not checked ({', '.join(compilers)})")
        for compiler in present:
            for real in (32, 64):
                for header in headers:
                    ok = compile_alone(
                        compiler, [*flags, f"-DPLR_REAL={real}"], language, root, header
                    )
                    passed, failed = passed + ok, failed + (not ok)
    linked, not_linked = link_all(root, headers)
    failed += not_linked
    print(f"{passed} compiled, {linked} linked, {failed} did not")
    return 1 if failed or passed == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
