# SPDX-License-Identifier: MIT
"""What pip calls this package: the name `pelorus` belongs to somebody else's, on the package index.

That one brings a module `pelorus` of its own, and `pelorus-cli` a command of that name: whichever
was installed last has overwritten the other.
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

NAME = "pelorus-slam"
OTHERS = ("pelorus", "pelorus-cli")


def pip_install(extra: str) -> str:
    """Returns the command that installs an extra."""
    return f"pip install '{NAME}[{extra}]'"


def mixed_up() -> str:
    """Returns what to do where one of OTHERS is installed, too; nothing where none is."""
    found = [f"{name} {given}" for name in OTHERS if (given := _version(name))]
    if not found:
        return ""
    return (
        f"pip has installed {' and '.join(found)} here, too. That is not this package ({NAME}), "
        "and writes to the same files. Keep one of them in an environment: "
        f"pip uninstall {' '.join(OTHERS)}; pip install --force-reinstall {NAME}"
    )


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""
