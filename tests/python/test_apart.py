# SPDX-License-Identifier: MIT
"""Halves of the points: they agree where the noise is new in every frame, and show what is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray
from pelorus.check import halves_alike
from pelorus.check.apart import HalvesApart, Inflated, Parts, compare, halves, of_points, windows
from pelorus.check.contents import recording_of
from pelorus.check.options import Settings, options_of
from pelorus.check.outcome import NOTHING, Bench
from pelorus.check.parameters import Tuned, larger
from pelorus.check.tracks_noise import TrackNoise
from pelorus.evaluate.evaluation import judge
from pelorus.io.trajectory import Trajectory
from pelorus.math import se3
from pelorus.native.replay import replayed
from pelorus.wire import framing
from pelorus.wire.frames import Header, Kind, Message, Start, Stereo, Twist
from replay_drive import EXACT_CAMERA, drive, header
from report_runs import built_programs

SIGMA_PX = 0.3
TWISTS = {"velocity-sigma": "0.3", "gyro-sigma": "0.03", "bias": "off"}
Pixels = NDArray[np.float64]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> list[Message]:
    """Twenty seconds of a drive whose twists are poor and whose pixels are good."""
    built_programs()
    from pelorus.commands.cli import main  # noqa: PLC0415 - typer is slow to load

    path = tmp_path_factory.mktemp("apart") / "drive.plr"
    twists = ("--velocity-sigma", "0.3", "--gyro-sigma", "0.03", "--twist-rate", "10")
    biases = ("--bias-velocity-sigma", "0", "--bias-gyro-sigma", "0", "--outliers", "0")
    drive = ("--seed", "3", "--duration", "20", "--baseline", "0.4", "--speed", "5")
    pixels = ("--pixel-sigma", str(SIGMA_PX), "--loss", "0.03")
    assert main(["simulate", str(path), *drive, *twists, *biases, *pixels]) == 0
    return [m for m in framing.messages_of(path) if m.kind != Kind.END]


def moved(messages: list[Message], by: Callable[[Stereo], Pixels]) -> list[Message]:
    """With other pixels."""
    out: list[Message] = []
    for message in messages:
        if isinstance(message, Stereo):
            pixels = (message.pixels + by(message)).astype(np.float32)
            message = replace(message, pixels=pixels)  # noqa: PLW2901
        out.append(message)
    return out


def bent(message: Stereo) -> Pixels:
    """The right picture is off by up to a pixel, more so in the corners, and in u alone."""
    off = np.zeros(message.pixels.shape)
    x, y = ((message.pixels[:, :2] - (320, 240)) / (320, 240)).T
    off[:, 2] = 1.5 * x * y + 0.5 * x
    return off


def walking(sigma_px: float) -> Callable[[Stereo], Pixels]:
    """Each track wanders off on its own."""
    chance = np.random.default_rng(2)
    off: dict[int, Pixels] = {}

    def step(message: Stereo) -> Pixels:
        for id in message.ids.tolist():
            off[id] = off.get(id, np.zeros(4)) + sigma_px * chance.normal(size=4)
        return np.array([off[id] for id in message.ids.tolist()]).reshape(-1, 4)

    return step


def noises(true: float = 1.0) -> Callable[[float], Settings]:
    """The true ones, all so many times as large."""
    told = {**TWISTS, "pixel-sigma": str(SIGMA_PX)}
    return lambda times: larger(header(), told, False, true * times)


def judged(messages: list[Message], settings: Settings) -> dict[str, Any]:
    """The whole drive against truth."""
    program = built_programs().float32
    return dict(judge(replayed(program, messages, [*options_of(settings), *EXACT_CAMERA])))


def untrue(messages: list[Message]) -> list[Message]:
    return [m for m in messages if m.kind != Kind.TRUTH]


def test_white_noise_moves_halves_as_far_as_their_covariances_say(
    simulated: list[Message], tmp_path: Path
) -> None:
    parts = Parts(built_programs().float32, untrue(simulated), tmp_path)
    found = halves_alike.inflate(parts, noises())
    assert not found.is_larger
    assert found.before.windows == 3
    assert min(found.before.by_way.values()) > 0.5
    assert found.before.ratio < found.before.by_chance
    small = halves_alike.inflate(parts, noises(0.25))  # sigmas that are all too small
    # 4 is due; the gate cuts what it sees, and on six such drives 4.6 to 5.6 were found.
    assert 3.5 < small.times < 6.5


def test_errors_that_points_keep_widen_the_covariance_and_leave_the_estimate(
    simulated: list[Message], tmp_path: Path
) -> None:
    off = moved(simulated, bent)
    parts = Parts(built_programs().float32, untrue(off), tmp_path)
    found = halves_alike.inflate(parts, noises())
    assert found.before.ratio > 2 * found.before.by_chance
    assert found.after.ratio <= found.after.by_chance
    before, after = (judged(off, noises()(times)) for times in (1.0, found.times))
    assert before["nees_per_dof"] > 5
    assert after["nees_per_dof"] < 3
    assert after["ate_m"] == pytest.approx(before["ate_m"], rel=0.1)


def test_no_noises_are_written_where_the_factor_that_is_due_does_not_do(
    simulated: list[Message], tmp_path: Path
) -> None:
    """Errors of tracks that wander grow with their age: what stands for them is track-drift."""
    off = moved(simulated, walking(0.25))
    parts = Parts(built_programs().float32, untrue(off), tmp_path)
    found = halves_alike.inflate(parts, noises())
    assert found.before.ratio > 2 * found.before.by_chance
    assert not found.is_larger


def test_halves_of_a_drive_by_an_imu_are_compared_over_the_whole_of_it(tmp_path: Path) -> None:
    from pelorus.commands.cli import main  # noqa: PLC0415 - typer is slow to load

    path = tmp_path / "flown.plr"
    rates = ("--seed", "300", "--duration", "25", "--lap", "8", "--imu-rate", "200")
    noise = ("--pixel-sigma", "1", "--gyro-noise", "0.002", "--accel-noise", "0.03")
    assert main(["simulate", str(path), *rates, *noise, "--observations", "30"]) == 0
    flown = [m for m in framing.messages_of(path) if m.kind != Kind.END]
    program = built_programs().float32
    header_of = framing.header_of_messages(flown)

    def of(times: float) -> Settings:
        return larger(header_of, {}, True, times)

    white = halves_alike.inflate(Parts(program, untrue(flown), tmp_path), of)
    assert white.before.windows == 1
    assert not white.is_larger
    kept = moved(flown, lambda frame: 3 * bent(frame))
    found = halves_alike.inflate(Parts(program, untrue(kept), tmp_path), of)
    assert found.is_larger
    logs = (replayed(program, kept, options_of(of(times))) for times in (1.0, found.times))
    before, after = (cast(float, judge(log)["nees_per_dof"]) for log in logs)
    assert before > 4
    assert after < 2
    bench = Bench(program, path, tmp_path)
    tuned = Tuned({"pixel-sigma": "1"}, NOTHING, NOTHING, TrackNoise({}, float("nan")))
    assert halves_alike.with_halves_alike(bench, tuned).halves is not None


def test_no_noises_are_taken_that_bring_halves_no_nearer() -> None:
    class Asked:
        """Halves that are as far apart with any noises."""

        def apart(self, settings: dict[str, str]) -> HalvesApart:
            return HalvesApart({"near and far": 9.0 + 0 * len(settings)}, 4)

    found = halves_alike.inflate(cast(Parts, Asked()), noises())
    assert not found.is_larger
    assert found.after.ratio == 9


def test_no_noises_are_taken_that_make_the_filter_surer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They hide that pictures and twists contradict each other."""
    recording = tmp_path / "drive.plr"
    framing.write_file(recording, drive(20))
    bench = Bench(built_programs().float32, recording, tmp_path)
    apart, alike = (HalvesApart({"near and far": ratio}, 4) for ratio in (9.0, 1.0))
    monkeypatch.setattr(halves_alike, "inflate", lambda *_: Inflated(3.0, apart, alike))
    settings = {"pixel-sigma": "0.5"}
    sure = Tuned(settings, NOTHING, bench.run(settings), TrackNoise({}, float("nan")))
    taken = halves_alike.with_halves_alike(bench, sure)
    assert taken.settings["pixel-sigma"] == "1.5"
    assert taken.after.pose_log_det > sure.after.pose_log_det
    unsure = replace(sure, after=replace(sure.after, pose_log_det=1e3))
    kept = halves_alike.with_halves_alike(bench, unsure)
    assert kept.settings == settings
    assert kept.halves is not None
    assert not kept.halves.is_larger


def test_halves_are_not_compared_on_a_known_map(tmp_path: Path) -> None:
    recording = tmp_path / "drive.plr"
    framing.write_file(recording, drive(20))
    bench = Bench(built_programs().float32, recording, tmp_path)
    noise = TrackNoise({}, float("nan"))
    calm = Tuned({"pixel-sigma": "0.5"}, NOTHING, NOTHING, noise)
    assert halves_alike.with_halves_alike(bench, calm).halves is not None
    mapped = replace(calm, settings={**calm.settings, "mode": "localization"})
    assert halves_alike.with_halves_alike(bench, mapped).halves is None


def test_windows_are_whole_drives_with_the_twists_of_their_first_frame() -> None:
    messages = [header(), Start(0), *drive(150)[1:]]
    found = list(windows(messages))
    assert [sum(isinstance(m, Stereo) for m in w) for w in found] == [75, 75]
    for window in found:
        assert isinstance(window[0], Header)
        assert not any(isinstance(m, Start) for m in window)
        first = next(m for m in window if isinstance(m, Stereo))
        assert any(isinstance(m, Twist) and m.t_ns == first.t_ns for m in window)
    times = [m.t_ns for w in found for m in w if isinstance(m, Stereo)]
    assert times == [m.t_ns for m in messages if isinstance(m, Stereo)]


def test_halves_share_no_point_and_have_as_many_observations() -> None:
    messages = drive(40)
    tracks = recording_of(messages).tracks
    ids, masks = halves(tracks)
    assert set(masks) == {
        "left and right",
        "upper and lower",
        "near and far",
        "any two halves",
    }
    for first in masks.values():
        share = np.isin(tracks.id, ids[first]).mean()
        assert 0.3 < share <= 0.5
    left = masks["left and right"]
    u = [tracks.pixels[np.isin(tracks.id, ids[some]), 0].mean() for some in (left, ~left)]
    assert u[0] < u[1]
    part = of_points(messages, ids[left])
    seen = [m.ids for m in part if isinstance(m, Stereo)]
    assert set(np.concatenate(seen).tolist()) == set(ids[left].tolist())


def test_what_a_half_may_differ_by_is_what_it_knows_less() -> None:
    """Directions in which it knows as much are not compared."""
    chance = np.random.default_rng(4)
    n, known = 2000, np.diag([1.0, 2.0, 1.0, 1.0, 1.0, 1.0]) * 1e-4
    less = np.diag([2.0, 2.0, 0.5, 0.05, 1.0, 1.0]) * 1e-4
    less[3, 3] = 0.05e-4  # a twentieth: too little to be told
    d = chance.normal(size=(n, 6)) * np.sqrt(np.diag(less))
    t_ns = np.arange(n, dtype=np.int64)
    stands = se3.Poses(np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3)))
    whole = Trajectory(t_ns, stands), np.tile(known, (n, 1, 1))
    part = (
        Trajectory(t_ns, se3.exp(d[:, :3], d[:, 3:])),
        np.tile(known + less, (n, 1, 1)),
    )
    d2, count = compare(whole, part)
    assert count == 5 * (n - 3)
    assert d2 / count == pytest.approx(1, abs=0.05)
    unknown = part[0], np.full((n, 6, 6), np.nan)
    assert compare(whole, cast(Any, unknown)) == (0.0, 0)


def test_a_window_in_which_odometry_pauses_is_left_out() -> None:
    """`check` of a robot whose twists are published only while it moves ended there: no twists."""
    messages = [header(), *drive(150)[1:]]
    edge = [m.t_ns for m in messages if isinstance(m, Stereo)][74]
    paused = [m for m in messages if not (isinstance(m, Twist) and m.t_ns > edge)]
    assert len(list(windows(messages))) == 2
    [kept] = windows(paused)
    assert len(recording_of(kept).tracks) > 0
