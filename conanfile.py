# SPDX-License-Identifier: MIT
"""Conan's recipe: `conan create .`, then find_package(pelorus) and pelorus::pelorus."""

from conan import ConanFile  # type: ignore[import-not-found]
from conan.tools.cmake import CMake, CMakeToolchain, cmake_layout  # type: ignore[import-not-found]


class Pelorus(ConanFile):  # type: ignore[misc]
    """The library in both precisions."""

    name = "pelorus"
    version = "0.1.0"
    license = "MIT"
    description = "Stereo visual-inertial SLAM filter in plain C99, no heap"
    topics = ("slam", "vio", "kalman", "robotics")
    settings = ("os", "arch", "compiler", "build_type")
    options = {"landmarks": ["ANY"], "observations": ["ANY"], "calibration": ["ANY"], "portable": [True, False]}  # noqa: RUF012
    default_options = {"landmarks": 32, "observations": 128, "calibration": 5, "portable": False}  # noqa: RUF012
    exports_sources = ("CMakeLists.txt", "cmake/*", "src/*", "include/*", "LICENSE")

    def configure(self) -> None:
        """It is C."""
        self.settings.rm_safe("compiler.libcxx")
        self.settings.rm_safe("compiler.cppstd")

    def layout(self) -> None:
        """The usual folders."""
        cmake_layout(self)

    def generate(self) -> None:
        """The options are those of include/pelorus/config.h."""
        toolchain = CMakeToolchain(self)
        toolchain.cache_variables |= {
            "PLR_MAX_LANDMARKS": str(self.options.landmarks),
            "PLR_MAX_OBSERVATIONS": str(self.options.observations),
            "PLR_MAX_CALIBRATION": str(self.options.calibration),
            "PLR_PORTABLE": bool(self.options.portable),
            "PELORUS_BUILD_REPLAY": False,
            "PELORUS_BUILD_TESTS": False,
        }
        toolchain.generate()

    def build(self) -> None:
        """Both libraries."""
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self) -> None:
        """Libraries, headers, and CMake's own package files."""
        CMake(self).install()

    def package_info(self) -> None:
        """CMake's package files say all."""
        self.cpp_info.set_property("cmake_find_mode", "none")
        self.cpp_info.builddirs.append("lib/cmake/pelorus")
