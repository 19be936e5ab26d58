# SPDX-License-Identifier: MIT
"""What other build systems are told of the library: each list of sources and flags builds one that
a program links. ESP-IDF, Zephyr and PlatformIO are not here; what they do with their file is.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
from pathlib import Path

import pytest
from draws import draws

ROOT = Path(__file__).resolve().parents[2]
CC = shutil.which("gcc") or shutil.which("cc")
pytestmark = pytest.mark.skipif(
    CC is None or not shutil.which("cmake"), reason="no compiler, no CMake"
)

PROGRAM = """
#include <stdio.h>
#include "pelorus/pelorus.h"
static plr_filter filter;
int main(void) {
    plr_calibration camera = {400, 400, 320, 240, 0.1, {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}}};
    plr_config config;
    plr_config_default(&config);
    const plr_status status = plr_filter_init(&filter, &camera, &config, NULL);
    printf("%d %d\\n", status, PLR_MAX_LANDMARKS);
    return status != PLR_OK;
}
"""
# What a framework's functions do with their arguments, as far as they are used.
STANDS_FOR = {
    "esp_idf": """
set(ESP_PLATFORM 1)
set(PLR_MAX_LANDMARKS 24)
set(PLR_PORTABLE 1)
function(idf_component_register)
  cmake_parse_arguments(a "" "" "SRCS;INCLUDE_DIRS;PRIV_INCLUDE_DIRS" ${ARGN})
  add_library(component STATIC ${a_SRCS})
  target_include_directories(component PUBLIC ${a_INCLUDE_DIRS} PRIVATE ${a_PRIV_INCLUDE_DIRS})
  set(COMPONENT_LIB component PARENT_SCOPE)
endfunction()
add_subdirectory(%ROOT% pelorus)
""",
    "zephyr": """
set(CONFIG_PELORUS y)
set(CONFIG_PELORUS_PORTABLE y)
set(CONFIG_PELORUS_KNOWN_MAP y) # and the supervisor is left out
set(CONFIG_PELORUS_MAX_LANDMARKS 24)
set(CONFIG_PELORUS_MAX_OBSERVATIONS 64)
set(CONFIG_PELORUS_MAX_CALIBRATION 0)
macro(zephyr_library_named name)
  add_library(${name} STATIC)
  add_library(component ALIAS ${name})
endmacro()
macro(zephyr_library_sources)
  target_sources(pelorus PRIVATE ${ARGN})
endmacro()
macro(zephyr_library_include_directories)
  target_include_directories(pelorus PRIVATE ${ARGN})
endmacro()
macro(zephyr_library_compile_options)
  target_compile_options(pelorus PRIVATE ${ARGN})
endmacro()
macro(zephyr_include_directories)
  target_include_directories(pelorus PUBLIC ${ARGN})
endmacro()
macro(zephyr_compile_definitions)
  target_compile_definitions(pelorus PUBLIC ${ARGN})
endmacro()
add_subdirectory(%ROOT%/zephyr pelorus)
""",
}


def run(*command: str | Path, cwd: Path | None = None, **variables: str) -> str:
    done = subprocess.run(
        [str(word) for word in command],
        cwd=cwd, capture_output=True, text=True, check=False, env=os.environ | variables,
    )  # fmt: skip
    assert done.returncode == 0, f"{command}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
    return done.stdout


@pytest.mark.parametrize("framework", draws(STANDS_FOR))
def test_a_framework_builds_the_library_with_its_sizes(framework: str, tmp_path: Path) -> None:
    (tmp_path / "main.c").write_text(PROGRAM)
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\nproject(robot C)\n"
        + STANDS_FOR[framework].replace("%ROOT%", ROOT.as_posix())
        + "add_executable(robot main.c)\ntarget_link_libraries(robot PRIVATE component)\n"
    )
    run("cmake", "-S", tmp_path, "-B", tmp_path / "b", "-DCMAKE_C_FLAGS=-O0")
    run("cmake", "--build", tmp_path / "b")
    assert run(tmp_path / "b/robot") == "0 24\n"


def test_what_platformio_is_told_builds_the_library(tmp_path: Path) -> None:
    told = json.loads((ROOT / "library.json").read_text())["build"]
    assert told["srcFilter"] == ["+<*/*.c>", "-<absent/>"]
    sources = sorted((ROOT / told["srcDir"]).glob("*/*.c"))
    (tmp_path / "main.c").write_text(PROGRAM)
    flags = [word.replace("-I src", f"-I{ROOT / 'src'}") for word in told["flags"]]
    include = f"-I{ROOT / told['includeDir']}"
    taken = [path for path in sources if path.parent.name != "absent"]
    run(
        str(CC), *flags, include, "-O0", "-DPLR_PORTABLE=1", tmp_path / "main.c", *taken,
        "-o", tmp_path / "robot",
    )  # fmt: skip
    assert run(tmp_path / "robot") == "0 32\n"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("installed")
    options = [f"-D{part}=OFF" for part in ("PELORUS_BUILD_REPLAY", "PELORUS_BUILD_TESTS")]
    options += ["-DPLR_MAX_LANDMARKS=20", "-DCMAKE_BUILD_TYPE=None", "-DCMAKE_C_FLAGS=-O0"]
    run("cmake", "-S", ROOT, "-B", folder / "b", *options, f"-DCMAKE_INSTALL_PREFIX={folder / 'p'}")
    run("cmake", "--build", folder / "b")
    run("cmake", "--install", folder / "b")
    return folder / "p"


@pytest.mark.skipif(not shutil.which("pkg-config"), reason="no pkg-config")
def test_pkg_config_tells_all_that_a_compiler_needs(installed: Path, tmp_path: Path) -> None:
    (folder,) = installed.glob("lib*/**/pkgconfig")
    (tmp_path / "main.c").write_text(PROGRAM)
    words = run("pkg-config", "--cflags", "--libs", "pelorus", PKG_CONFIG_PATH=str(folder)).split()
    run(str(CC), "-std=c99", tmp_path / "main.c", *words, "-o", tmp_path / "robot")
    assert run(tmp_path / "robot") == "0 20\n"


def test_a_project_that_names_no_build_type_gets_an_optimised_library(tmp_path: Path) -> None:
    """And one that says how to optimise gets what it says."""
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\nproject(robot C)\n"
        "set(CMAKE_EXPORT_COMPILE_COMMANDS ON)\n"
        f"add_subdirectory({ROOT.as_posix()} pelorus)\n"
    )

    def levels(*options: str) -> set[str]:
        build = tmp_path / "b"
        shutil.rmtree(build, ignore_errors=True)
        run("cmake", "-S", tmp_path, "-B", build, *options)
        commands = json.loads((build / "compile_commands.json").read_text())
        assert len(commands) > 50
        return {
            [word for word in command["command"].split() if word.startswith("-O")][-1]
            for command in commands
        }

    assert levels() == {"-O3"}
    assert levels("-DCMAKE_C_FLAGS=-Os") == {"-Os"}
    assert levels("-DCMAKE_BUILD_TYPE=RelWithDebInfo") == {"-O2"}


def test_without_a_compiler_the_build_says_what_to_install(tmp_path: Path) -> None:
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("cmake", "make", "ninja", "uname", "sh"):
        if path := shutil.which(name):
            (tools / name).symlink_to(path)
    done = subprocess.run(
        ["cmake", "-S", str(ROOT), "-B", str(tmp_path / "b"), "-DPELORUS_PYTHON=ON"],
        capture_output=True, text=True, check=False,
        env={"PATH": str(tools), "HOME": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode != 0
    words = " ".join(done.stderr.split())
    assert "there is no C compiler here" in words
    assert "apt-get install gcc" in words
    assert "CMake Error: CMAKE_C_COMPILER not set" not in words


@pytest.mark.skipif(platform.machine() != "x86_64", reason="of x86")
def test_by_hand_without_the_instruction_the_compiler_names_the_remedy(tmp_path: Path) -> None:
    done = subprocess.run(
        [str(CC), "-std=c99", f"-I{ROOT / 'include'}", f"-I{ROOT / 'src'}", "-c",
         str(ROOT / "src/math/fma.c"), "-o", str(tmp_path / "fma.o")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode != 0
    assert "-march=x86-64-v3" in done.stderr
    assert "-DPLR_PORTABLE=1" in done.stderr
