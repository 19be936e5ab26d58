# SPDX-License-Identifier: MIT
"""Lists the settings that were changed, in words and as lines of a config."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pelorus.check.calibration import CAMERA_TURN
from pelorus.check.parameters import Tuned, of_process, starting
from pelorus.check.tracks_noise import DRIFT
from pelorus.wire.frames import Header

OTHER_SIGMA = 1.2  # ratio of sigmas from which a change is reported


def changes(given: Mapping[str, str], header: Header, tuned: Tuned, by_imu: bool) -> list[str]:
    """Returns changes of more than a fifth as sentences: `pixel-sigma 2 should be 1`."""
    return [
        f"{' '.join(filter(None, (name, was)))} should be {expected}"
        for name, was, expected in _changed(given, header, tuned, by_imu)
    ]


def lines(given: Mapping[str, str], header: Header, tuned: Tuned, by_imu: bool) -> list[str]:
    """Returns the same changes as lines of a config."""
    return [f"{name} = {expected}" for name, _, expected in _changed(given, header, tuned, by_imu)]


def _changed(
    given: Mapping[str, str], header: Header, tuned: Tuned, by_imu: bool
) -> Iterator[tuple[str, str, str]]:
    """Yields each setting's name, its old value if that is a number, and its new value."""
    parameters = of_process(by_imu)
    before = starting(header, given, parameters)
    for name, parameter in parameters.items():
        written = tuned.settings.get(parameter.setting, "")
        after = [float(part) for part in written.split(",") if part]
        was = [before[name]] if name in before else [before[f"{name}-{axis}"] for axis in "xyz"]
        count = max(len(was), len(after))
        pairs = zip(was * (count // len(was)), after * (count // max(len(after), 1)), strict=False)
        ratios = [max(x / y, y / x) for x, y in pairs if x > 0]
        if ratios and max(ratios) > OTHER_SIGMA:
            yield parameter.setting, ",".join(f"{x:.3g}" for x in was), written
    for setting in KEPT:
        value = tuned.settings.get(setting)
        if value is not None and value != given.get(setting, _usual(setting, header)):
            yield setting, "", value


KEPT = (
    "twist-timing",
    "imu-timing",
    "bias",
    "camera-offset",
    "baseline-sigma",
    CAMERA_TURN,
    DRIFT,
    "calibrate",
    "wheel-scale-sigma",
    "wheel-track-sigma",
)


def _usual(setting: str, header: Header) -> str:
    usual = {"twist-timing": header.twist_timing.name.lower(), "bias": "on", "imu-timing": "mid"}
    return usual.get(setting, "0")
