# SPDX-License-Identifier: MIT
"""A scale that stereo and odometry disagree in is told from biases and from a clock."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from converted import Run
from draws import draws, long_run
from everyday import drawn
from everyday import drive as everyday_drive
from pelorus.check import calibration, clock, search, tuning, verdict
from pelorus.check.contents import scaled, shifted
from pelorus.check.known import known_of
from pelorus.check.options import Settings
from pelorus.check.outcome import NOTHING, OFFSET, SCALE, Bench
from pelorus.wire import framing
from pelorus.wire.frames import Kind, Twist, TwistTiming
from replay_drive import BIN, drive, header
from report_runs import built_programs

AS_GIVEN = header().twist_timing.name.lower()
TRUE = {"pixel-sigma": "0.5", "velocity-sigma": "0.05", "gyro-sigma": "0.005"}


def simulated(folder: Path, *options: str) -> Path:
    from pelorus.commands.cli import main  # noqa: PLC0415 - typer is slow to load

    noise = [word for name, value in TRUE.items() for word in (f"--{name}", value)]
    path = folder / "drive.plr"
    rates = ("--duration", "30", "--lap", "8", "--twist-rate", "50", "--observations", "25")
    assert main(["simulate", str(path), "--seed", "5", *noise, *rates, *options]) == 0
    return path


@pytest.mark.parametrize(
    ("options", "off"),
    [
        (("--baseline-error", "4"), -0.04),
        (("--baseline-error", "-4"), 0.04),
        (("--bias-velocity-sigma", "0.03"), 0.0),
        (("--bias-velocity-sigma", "0"), 0.0),
    ],
    ids=["4 %", "-4 %", "bias", "clean"],
)
def test_a_baseline_that_is_off_is_told_and_a_bias_of_the_velocity_is_none(
    tmp_path: Path, options: tuple[str, ...], off: float
) -> None:
    known = known_of(framing.messages_of(simulated(tmp_path, *options)))
    assert calibration.scale_off_by(known.judged.agreed) == pytest.approx(
        off, abs=0.015 if off else 0
    )


def test_what_a_scale_explains_is_no_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    def of_twists(_: Bench, settings: Settings, _about_s: float | None) -> clock.Offset:
        """A scale that is off moves the best offset, too."""
        wrong = abs(float(settings[SCALE]) - 0.98) > 0.005
        return clock.Offset(-0.03 if wrong else 0.001, 0.002)

    monkeypatch.setattr(clock, "of_twists", of_twists)
    monkeypatch.setattr(clock, "seconds", lambda _: 0.02)
    monkeypatch.setattr(
        tuning, "search_noises", lambda *_: search.BestFound({"pixel": 0.5}, NOTHING)
    )
    examined = SimpleNamespace(twist_t_ns=[])
    bench = cast(Any, SimpleNamespace(header=header(), examined=examined))
    invented, _, _ = tuning.clocked(bench, {}, {"pixel": 0.5}, {})
    assert float(invented["@offset"]) == -0.03
    kept, _, words = tuning.clocked(bench, {}, {"pixel": 0.5}, {}, -0.02)
    assert float(kept["@offset"]) == 0
    assert "no offset of the camera's clock is likelier than yours (known to 4 ms)" in words


FOUND = search.BestFound({"pixel": 0.5, "velocity": 0.1, "gyro": 0.01}, NOTHING)


@pytest.fixture
def still_bench(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Returns a bench for the twists' search, of which nothing but the clock is left."""
    monkeypatch.setattr(clock, "seconds", lambda _: 0.02)
    monkeypatch.setattr(clock, "is_finer", lambda _: True)
    monkeypatch.setattr(tuning, "search_noises", lambda *_: FOUND)
    monkeypatch.setattr(tuning, "track_noise", lambda _: SimpleNamespace(drifts=False))
    monkeypatch.setattr(tuning, "difference_of_a_reading", lambda *_: None)
    monkeypatch.setattr(tuning, "biases_by_halves", lambda _, fixed, __: (fixed, "no bias"))
    monkeypatch.setattr(tuning, "_axes", lambda *_: (FOUND, "one sigma for all axes"))
    return SimpleNamespace(
        by_imu=False,
        header=header(),
        examined=SimpleNamespace(twist_t_ns=[]),
        run=lambda _: NOTHING,
    )


@pytest.mark.parametrize("one_clock", [True, False])
def test_two_clocks_are_no_timing(
    monkeypatch: pytest.MonkeyPatch, still_bench: Any, one_clock: bool
) -> None:
    """Starry Night's gyro is late beside its velocities; `end` is likelier, and the worse."""
    monkeypatch.setattr(clock, "of_twists", lambda *_: clock.Offset(0.06, 0.001))
    given = {"camera-offset": "0.01"}
    tuned = tuning.tune(still_bench, given, None, one_clock)
    assert float(tuned.settings["camera-offset"]) == (0.06 if one_clock else 0.01)
    assert any("two clocks" in words for words in tuned.said) != one_clock


@pytest.mark.parametrize(
    ("fit_s", "sigma_s", "given_s", "begins"),
    [
        (0.06, 0.003, 0.0, 0.06),
        (0.0, 0.003, 0.05, 0.0),  # a setting that is wrong
        (0.01, 0.003, 0.0, 0.0),  # chance
        (0.06, 0.02, 0.0, None),  # too rough: all offsets are tried
        (0.3, 0.001, 0.0, None),  # so large that none near it is tried
        (float("nan"), float("inf"), 0.0, None),
    ],
    ids=["late", "given wrong", "chance", "rough", "large", "untold"],
)
def test_the_search_for_the_clock_begins_where_the_fit_finds_it(
    monkeypatch: pytest.MonkeyPatch,
    still_bench: Any,
    fit_s: float,
    sigma_s: float,
    given_s: float,
    begins: float | None,
) -> None:
    asked: list[float | None] = []
    rough: list[float] = []

    def of_twists(_: Bench, _settings: Settings, about_s: float | None = None) -> clock.Offset:
        asked.append(about_s)
        return clock.Offset(0.06, 0.001)

    def biases(_: Bench, fixed: Settings, __: Any) -> tuple[Settings, str]:
        rough.append(float(fixed[OFFSET]))
        return fixed, "no bias"

    monkeypatch.setattr(clock, "of_twists", of_twists)
    monkeypatch.setattr(tuning, "biases_by_halves", biases)
    agreed = cast(
        Any, SimpleNamespace(is_known=True, offset_s=fit_s, offset_sigma_s=sigma_s, scale=1.0,
                             scale_sigma=0.01),
    )  # fmt: skip
    tuning.tune(still_bench, {"camera-offset": str(given_s)}, agreed)
    if begins is None:
        assert asked == [None, 0.06]  # the whole range, and then about the best
    else:
        assert asked == [fit_s]
        assert rough == [begins]


def test_the_fit_tells_no_clock_where_it_reads_the_twists_otherwise_than_replays(
    monkeypatch: pytest.MonkeyPatch, still_bench: Any
) -> None:
    """With one twist a frame, or another timing than the HEADER's, the offset is a timing's."""
    asked: list[float | None] = []

    def of_twists(_: Bench, _settings: Settings, about_s: float | None = None) -> clock.Offset:
        asked.append(about_s)
        return clock.UNTOLD

    monkeypatch.setattr(clock, "of_twists", of_twists)
    still_bench.run_all = lambda many, _: [NOTHING for _ in many]
    agreed = cast(
        Any, SimpleNamespace(is_known=True, offset_s=0.06, offset_sigma_s=0.001, scale=1.0,
                             scale_sigma=0.01),
    )  # fmt: skip
    timing = next(name for name in ("start", "end") if name != AS_GIVEN)
    tuning.tune(still_bench, {"twist-timing": timing}, agreed)
    monkeypatch.setattr(clock, "is_finer", lambda _: False)
    tuning.tune(still_bench, {}, agreed)
    assert asked == [None] * 4


@pytest.mark.parametrize("given", ["start", "end"])
def test_a_wrong_timing_of_one_twist_a_frame_is_found(tmp_path: Path, given: str) -> None:
    path = simulated(tmp_path, "--twist-rate", "10")
    messages = framing.messages_of(path)
    told = replace(framing.header_of_messages(messages), twist_timing=TwistTiming[given.upper()])
    framing.write_file(path, [told, *messages[1:]])
    bench = Bench(built_programs().float32, path, tmp_path)
    agreed = known_of(framing.messages_of(path)).judged.agreed
    tuned = tuning.tune(bench, TRUE, agreed)
    assert tuned.settings.get("twist-timing", given) == "start", tuned.said


def test_a_clock_beyond_what_is_tried_ends_no_check(tmp_path: Path) -> None:
    path = simulated(tmp_path)
    messages = [m for m in framing.messages_of(path) if m.kind not in (Kind.END, Kind.TRUTH)]
    framing.write_file(path, shifted(messages, 300_000_000))
    known = known_of(framing.messages_of(path))
    assert "clock" in [fault.name for fault in known.faults]
    bench = Bench(built_programs().float32, path, tmp_path)
    assert tuning.tune(bench, TRUE, known.judged.agreed).settings


def test_velocities_of_another_scale_keep_their_noise_and_their_turns() -> None:
    chance = np.random.default_rng(4)
    steady = drive(200)
    noise = [chance.normal(0, 0.2, 3) for m in steady if isinstance(m, Twist)]
    left = iter(noise)
    noisy = [
        replace(m, v_B_mps=m.v_B_mps + next(left)) if isinstance(m, Twist) else m for m in steady
    ]
    before = [m for m in noisy if isinstance(m, Twist)]
    after = [m for m in scaled(noisy, 1.1) if isinstance(m, Twist)]
    assert all(list(a.w_B_radps) == list(b.w_B_radps) for a, b in zip(after, before, strict=True))
    added = np.array([a.v_B_mps - b.v_B_mps for a, b in zip(after, before, strict=True)])
    assert np.mean(added[:, 0]) == pytest.approx(0.1 * np.mean([m.v_B_mps[0] for m in before]), 0.1)
    assert np.std(added, axis=0).max() < 0.1 * 0.2 / 3  # a mean of some twenty readings


WALK = replace(
    drawn(3000), speed_mps=3.0, pixel_px=1.0, velocity_mps=0.05, gyro_radps=0.01, bias_mps=0.05,
    bias_radps=0.0, pitch_deg=0.0, twist_hz=50, timing="start", points=40, duration_s=20.0, told=1,
)  # fmt: skip


@long_run
@pytest.mark.parametrize(
    ("speed_varies", "bias_mps", "error", "grade", "words"),
    draws(
        [
            (0.0, 0.05, 0.02, "care", "cannot tell the scale of the stereo pair from a bias"),
            (0.3, 0.0, 0.02, "care", "baseline, focal length or wheels' radius"),
            (0.3, 0.0, 0.0, "good", ""),
        ]
    ),
    ids=draws(["hidden by a bias", "told", "right"]),
)
def test_a_verdict_is_no_better_than_what_the_drive_tells_of_the_scale(
    speed_varies: float,
    bias_mps: float,
    error: float,
    grade: str,
    words: str,
    tmp_path: Path,
    pelorus: Run,
) -> None:
    """At constant speed a bias took all of a baseline that was off by 2 %: NEES/6 was 87, and the
    verdict "this can be trusted".
    """
    settings = replace(WALK, speed_varies=speed_varies, bias_mps=bias_mps, baseline_error=error)
    path = tmp_path / "drive.plr"
    everyday_drive(settings, 3000).write(path)
    said = pelorus("check", path, "--out", tmp_path / "t.conf", "--bin", BIN, "--json")
    found = json.loads(said.out)
    assert found["grade"] == grade, found["remarks"]
    texts = [remark["text"] for remark in found["remarks"] if remark["grade"] == "care"]
    assert any(words in text for text in texts) or not words, texts
    parts = found["verdict"].split(", to ")
    share = float(parts[1].removesuffix("% of the way")) / 100 if len(parts) > 1 else 0.0
    assert share < max(3 * error, 0.01), found["verdict"]
    assert share > 0.7 * error or not error  # which the covariances may contain already
    told = found["settings"].get("baseline-sigma")
    assert told == (f"{share:.2g}" if error else None), "the covariances contain it"
    assert float(found["figures"]["NEES/6"]["after"]) < 3


def test_what_a_drive_does_not_tell_is_no_figure_of_the_camera() -> None:
    """Six seconds of a circle at an even speed: positions were off "by 81 % of the way"."""
    doubt = calibration.Doubt(0.9, 0.3, 0.05, 0.2, adds=100.0)
    assert not doubt.setting
    assert doubt.beyond == 0
    (remark,) = verdict.of_scale(doubt)
    assert remark.grade is verdict.Grade.CARE
    assert "too short or too even" in remark.text
    told = replace(doubt, sigma=0.05)
    assert told.setting == {"baseline-sigma": "0.1"}
    assert "too short" not in next(verdict.of_scale(told)).text
