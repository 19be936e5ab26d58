# SPDX-License-Identifier: MIT
"""The filter from Python: the replay's bits, its errors, and what it makes of anything at all."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from pelorus import Calibration, Filter, FilterError, KnownLandmark, PelorusError, Reason
from pelorus import observations as frame_of
from pelorus.commands.cli import main
from pelorus.native import binding
from pelorus.native.binding import Precision
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.frames import Camera, Config, Header, Message, Noise, Pose, Stereo, Truth, Twist
from pelorus.wire.framing import messages_of, write_file
from pelorus.wire.layout import Floats
from pelorus.wire.schema import DEFAULTS, REASON_NAMES, REASONS, SETTINGS
from pelorus.wire.settings import IDS
from replay_drive import BIN

ROOT = Path(__file__).resolve().parents[2]
DRIVE = ROOT / "tests/golden/drive.plr"
CAMERA = Calibration(410.0, 405.0, 330.0, 236.0, 0.17)
NO_IDS, NO_PIXELS = np.zeros(0, np.uint32), np.zeros((0, 4), np.float32)
PRECISIONS: tuple[Precision, ...] = ("float32", "float64")
BUSY = settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
pytestmark = pytest.mark.usefixtures("built")


def bits(R: Floats, p: Floats, triangle: Floats, precision: Precision) -> bytes:
    """A pose and its covariance as a log has them, the position in float64."""
    return R.astype(precision).tobytes() + p.tobytes() + triangle.astype(precision).tobytes()


def driven(filter: Filter, messages: Sequence[Message], seconds: float = np.inf) -> list[bytes]:
    """The poses and covariances after each frame, as bytes."""
    found = []
    begin = next(m.t_ns for m in messages if isinstance(m, Twist))
    for message in messages:
        if isinstance(message, Truth) and message.t_ns == begin:  # where the session starts
            filter.set_pose(message.t_ns, message.R_WB, message.p_WB_m)
        elif isinstance(message, (Twist, Stereo)) and message.t_ns - begin > seconds * 1e9:
            break
        elif isinstance(message, Twist):
            filter.predict(message.t_ns, message.v_B_mps, message.w_B_radps)
        elif isinstance(message, Stereo):
            filter.update(message.t_ns, frame_of(message.ids, message.pixels))
            pose = filter.pose()
            triangle = filter.pose_covariance()[np.tril_indices(6)]
            found.append(bits(pose.R, pose.p, triangle, filter.precision))
    return found


def replayed(recording: Path, precision: Precision, *options: str) -> list[Message]:
    """The log of it."""
    log = recording.with_name("log.plr")
    program = BIN / ("pelorus-replay" if precision == "float32" else "pelorus-replay-f64")
    command = [str(program), str(recording), *options, "--force", "--out", str(log)]
    subprocess.run(command, check=False, capture_output=True)  # its log says what it did
    return messages_of(log)


def poses_in(log: Sequence[Message], precision: Precision) -> list[bytes]:
    """After each frame."""
    return [
        bits(m.R_WB, m.p_WB_m, m.covariance, precision)
        for m in log
        if isinstance(m, Pose) and m.after_stereo
    ]


@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_recordings_filter_has_the_bits_of_its_replay(
    precision: Precision, tmp_path: Path
) -> None:
    """With the noises of its HEADER, its CONFIG, and settings of one's own above both."""
    recording = tmp_path / "d.plr"
    assert main(["simulate", "--seed", "29", "--duration", "12", str(recording)]) == 0
    options = ["--slots=40", "--scene=may-move", "--velocity-sigma=0.4"]
    log = replayed(recording, precision, *options)
    own: dict[str, Any] = {"slots": 40, "scene": "may-move", "velocity-sigma": 0.4}
    messages = messages_of(recording)
    assert any(isinstance(m, Config) for m in messages)
    filter = Filter.of_recording(messages, own, precision=precision)
    assert filter.setting("pixel-sigma") != DEFAULTS["pixel-sigma"]
    assert {name: filter.setting(name) for name in IDS} == in_force(log)
    found = driven(filter, messages)
    assert len(found) > 100
    assert found == poses_in(log, precision)


def in_force(log: Sequence[Message]) -> dict[str, float]:
    """The settings of a replay, by name."""
    config = next(m for m in log if isinstance(m, Config) and m.build_fingerprint)
    return {SETTINGS[id].name: value for id, value in config.settings.items()}


SUGGESTED: tuple[tuple[dict[str, Any], list[str], dict[str, Any]], ...] = (
    ({"velocity_sigma_y_mps": 0.3, "gyro_sigma_radps": 0.02}, [], {}),
    ({"velocity_sigma_mps": 0.3}, ["--noise=step"], {"noise": "step"}),  # no sigmas of a reading
    ({"gravity": 9.79, "accel_noise": 0.002}, ["--process=imu"], {"process": "imu"}),
    ({"bias_velocity_sigma_mps": 0.0, "bias_gyro_sigma_radps": 0.0}, [], {}),  # so it has none
    ({"pixel_sigma_px": 1e9}, ["--calibrate=focal,turn"], {"calibrate": "focal,turn"}),
    ({"velocity_sigma_x_mps": 0.2}, ["--gyro-sigma-y=0.1"], {"gyro-sigma": (0.01, 0.1, 0.01)}),
)


@pytest.mark.parametrize(("noise", "options", "own"), SUGGESTED)
def test_settings_of_a_header_are_those_of_the_replay(
    noise: dict[str, float], options: list[str], own: dict[str, Any], tmp_path: Path
) -> None:
    recording = tmp_path / "d.plr"
    header = Header(Camera(410.0, 405.0, 330.0, 236.0, 0.17), noise=Noise(**noise))
    asked = [Config({IDS["slots"]: 30.0}), Config({IDS["pixel-sigma"]: -1.0, 200: 1.0})]
    still = [Twist(t) for t in range(0, 10**9, 10**8)]
    write_file(recording, [header, *asked, *still, Stereo(10**9, NO_IDS, NO_PIXELS)], 0)
    log = replayed(recording, "float32", *options)
    filter = Filter.of_recording(messages_of(recording), own)
    assert {name: filter.setting(name) for name in IDS} == in_force(log)


def test_messages_without_a_header_make_no_filter() -> None:
    with pytest.raises(PelorusError, match="no HEADER comes before the data"):
        Filter.of_recording([Twist(0), Header(Camera(410.0, 405.0, 330.0, 236.0, 0.17))])


@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_restored_filter_goes_on_with_the_same_bits(precision: Precision) -> None:
    messages = messages_of(DRIVE)
    header = Calibration.of_header(next(m for m in messages if isinstance(m, Header)))
    one = Filter(header, {"slots": 20}, precision=precision)
    driven(one, messages, 1.0)
    saved, begin = one.save(), one.time_ns
    later = [m for m in messages if isinstance(m, (Twist, Stereo)) and m.t_ns > begin]
    straight = driven(one, later)
    assert len(straight) > 10
    other = Filter(header, {"slots": 20}, precision=precision)
    other.restore(saved)
    assert driven(other, later) == straight
    with pytest.raises(FilterError, match="another version or build"):
        Filter(header, {"slots": 21}, precision=precision).restore(saved)
    with pytest.raises(FilterError):
        other.restore(saved[:-7])


def test_the_structs_are_those_of_the_headers(tmp_path: Path) -> None:
    """Each field's offset, as a C compiler has it."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    binding.library()
    members = {"linear": "v_B_mps", "angular": "w_B_radps"}
    lines = []
    expected = []
    for struct in binding.STRUCTS:
        plain = type("Plain", (ctypes.Structure,), {"_fields_": struct._fields_})
        for field in struct._fields_:
            member = members.get(field[0], field[0]) if struct is binding.Twist else field[0]
            lines.append(f'printf("%zu\\n", offsetof({struct.c_name}, {member}));')
            expected.append(getattr(plain, field[0]).offset)
    source = tmp_path / "offsets.c"
    source.write_text(
        '#include <stddef.h>\n#include <stdio.h>\n#include "pelorus/pelorus.h"\n'
        f"int main(void) {{ {' '.join(lines)} return 0; }}\n"
    )
    command = [compiler, "-std=c99", f"-I{ROOT / 'include'}", str(source)]
    subprocess.run([*command, "-o", str(tmp_path / "offsets")], check=True)
    said = subprocess.run([tmp_path / "offsets"], check=True, capture_output=True, text=True)
    assert [int(word) for word in said.stdout.split()] == expected


ZEROS = (0.0, 0.0, 0.0)
EYE = np.eye(3)
MANY = frame_of(range(1025), np.ones((1025, 4)))
REFUSED: tuple[tuple[str, Callable[[Filter], Any]], ...] = (
    (r"v_B_mps: int64 of shape \(2,\); numbers .*\(3,\)", lambda f: f.predict(7, [1, 2], ZEROS)),
    (r"w_B_radps: <U1 of shape \(3,\)", lambda f: f.predict(7, [1, 2, 3], list("abc"))),
    (r"w_B_radps: .*inhomogeneous", lambda f: f.predict(7, [1, 2, 3], [[1], [2, 3]])),
    (r"t_ns: 1.5 is no whole number", lambda f: f.predict(cast(int, 1.5), ZEROS, ZEROS)),
    (r"saved: str; the bytes", lambda f: f.restore(cast(bytes, "state"))),
    (r"t_ns: -3; 0 to ", lambda f: f.predict(-3, [1, 2, 3], [0, 0, 0])),
    (r"predict: .*NaN", lambda f: f.predict(7, [1, np.nan, 3], [0, 0, 0])),
    (r"predict: .*infinite", lambda f: f.predict(7, [1, np.inf, 3], [0, 0, 0])),
    (r"observations: an array as pelorus.obs", lambda f: f.update(7, cast(Any, np.zeros((3, 5))))),
    (r"observations: shape \(1025,\); \(n,\) .* 1024", lambda f: f.update(7, MANY)),
    (r"pixels: .* \(2, 3\); numbers .* \(2, 4\)", lambda _: frame_of([1, 2], np.ones((2, 3)))),
    (r"ids: -1 to 4; 0 to 4294967295", lambda _: frame_of([4, -1], np.ones((2, 4)))),
    (r"ids: float64 of shape", lambda _: frame_of([4.5, 1.0], np.ones((2, 4)))),
    (r"ids: float64 of shape", lambda _: frame_of([4.0, np.nan], np.ones((2, 4)))),
    (r"ids: <U1 of shape", lambda _: frame_of(["4", "5"], np.ones((2, 4)))),
    (r"sensor 'sonar': one of wheel", lambda f: f.measure(7, "sonar", [0, 0, 0], [1, 1, 1])),
    (r"set_pose: ", lambda f: f.set_pose(7, 2 * np.eye(3), [0, 0, 0])),
    (r"covariance: .*\(3, 3\); numbers .* \(6, 6\)", lambda f: f.set_pose(7, EYE, ZEROS, EYE)),
    (r'inertial: .*"twist"}: give readings to predict$', lambda f: f.inertial(7, ZEROS, ZEROS)),
    (r"supervision: ", lambda f: f.supervision()),
)  # fmt: skip


@pytest.mark.parametrize(("words", "call"), REFUSED, ids=[words for words, _ in REFUSED])
def test_a_wrong_argument_is_named_and_changes_nothing(
    words: str, call: Callable[[Filter], Any]
) -> None:
    filter = Filter(CAMERA)
    before = filter.pose(), filter.landmarks().tobytes()
    with pytest.raises(PelorusError, match=words):
        call(filter)
    after = filter.pose(), filter.landmarks().tobytes()
    assert np.array_equal(before[0].p, after[0].p)
    assert before[1] == after[1]


CONFIGS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("no setting pixel-sigmas: is pixel-sigma .*meant.; there are .*slots", {"pixel-sigmas": 2}),
    ("no setting gyro_noise: is gyro-noise .*meant.;", {"gyro_noise": 2}),
    ("no setting colour; there are", {"colour": 2}),
    ("pixel-sigma 0: 0.001 to 1000 px are possible", {"pixel-sigma": 0}),
    ("slots 257: 1 to 256 are possible", {"slots": 257}),
    ("scene 'stays': one of stands, may-move", {"scene": "stays"}),
    ("gate-d2 'wide': a number", {"gate-d2": "wide"}),
    ("calibrate 'focal,tilt': off, or some of focal,baseline", {"calibrate": "focal,tilt"}),
    ("scene 'stands,may-move': one of", {"scene": "stands,may-move"}),
    ("pixel-sigma is one number, not three", {"pixel-sigma": (1, 2, 3)}),
    ("velocity-sigma: .* of shape .2,.; numbers of shape .3,.", {"velocity-sigma": (1, 2)}),
    ("process: imu needs model = body and bias = on", {"process": "imu", "bias": False}),
)


@pytest.mark.parametrize(("words", "config"), CONFIGS, ids=[words for words, _ in CONFIGS])
def test_a_wrong_setting_is_named(words: str, config: dict[str, Any]) -> None:
    with pytest.raises(PelorusError, match=words):
        Filter(CAMERA, config)


def test_settings_take_words_numbers_and_three_axes() -> None:
    filter = Filter(
        CAMERA, {"scene": "may-move", "bias": False, "velocity-sigma": np.array([0.3, 0.2, 0.1])}
    )
    assert filter.setting("scene") == 1
    assert filter.setting("bias") == 0
    axes = [filter.setting(f"velocity-sigma{end}") for end in ("", "-y", "-z")]
    assert axes == [0.3, 0.2, 0.1]
    listed = Filter(CAMERA, {"calibrate": "turn,focal"})
    assert listed.setting("calibrate") == 0b101
    assert Filter(CAMERA, {"calibrate": "off"}).setting("calibrate") == 0


def test_a_calibration_that_cannot_be_is_refused() -> None:
    with pytest.raises(FilterError, match=r"init: .*baseline") as refused:
        Filter(Calibration(400, 400, 320, 240, -0.1))
    assert refused.value.status < 0
    for wrong in ("wide", None, (400, 405)):
        with pytest.raises(PelorusError, match=r"calibration: fx_px: .* is no number"):
            Filter(Calibration(cast(float, wrong), 400, 320, 240, 0.1))


def test_a_package_without_its_library_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    binding.library.cache_clear()
    try:
        monkeypatch.setenv("PELORUS_BIN", str(tmp_path))
        with pytest.raises(PelorusError, match=r"is in none of .*installed without it"):
            Filter(CAMERA)
        name = f"pelorus-filter{binding.SUFFIXES.get('', '.so')}"
        (tmp_path / name).write_bytes(b"\x7fELF of another machine")
        with pytest.raises(PelorusError, match=re.escape(name) + ": cannot be loaded"):
            Filter(CAMERA)
        with pytest.raises(PelorusError, match="precision 'float16': one of float32, float64"):
            Filter(CAMERA, precision="float16")  # type: ignore[arg-type]
    finally:
        binding.library.cache_clear()


def test_a_library_of_other_structs_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    path = binding.library()._library._name
    monkeypatch.setattr(binding.Report, "c_name", "plr_frame")
    with pytest.raises(PelorusError, match=r"with another plr_frame.*build it anew"):
        binding.Library(Path(path))


def test_ids_of_a_table_of_floats_are_taken() -> None:
    frame = frame_of(np.array([3.0, 2.0**32 - 1]), np.ones((2, 4)))
    assert frame["id"].tolist() == [3, 2**32 - 1]


def test_a_twist_for_a_filter_with_an_imu_is_sent_to_inertial() -> None:
    filter = Filter(CAMERA, {"process": "imu"})
    with pytest.raises(FilterError, match=r'"process": "imu"}: give readings to inertial$'):
        filter.predict(7, ZEROS, ZEROS)


def test_reasons_are_flags_with_names() -> None:
    filter = Filter(CAMERA)
    filter.predict(0, ZEROS, ZEROS)
    report = filter.update(1, frame_of([7, 7], np.ones((2, 4))))
    assert Reason.REFUSED_INPUT in report.reasons
    assert Reason.FROZEN_IMAGE not in report.reasons
    assert report.reasons & 128
    assert "observations were malformed, or an id stood twice" in report.reasons.words
    assert (Reason.NO_FRAMES | Reason.BUDGET).words == tuple(
        REASONS[bit] for bit in (Reason.BUDGET, Reason.NO_FRAMES)
    )
    assert {reason.name: reason.value for reason in Reason} == {
        name: bit for bit, name in REASON_NAMES.items()
    }
    assert (str(Reason(0)), str(Reason.NO_FRAMES)) == ("none", "NO_FRAMES")
    assert str(Reason.NO_FRAMES | Reason.BUDGET) == "BUDGET|NO_FRAMES"
    later = Reason(1 << 30 | 1)  # of a library of another version
    assert Reason.FEW_OBSERVATIONS in later
    assert later.words == (REASONS[1],)


def test_report_health_and_filter_show_what_they_hold() -> None:
    filter = Filter(CAMERA, {"slots": 20})
    shown = "<pelorus.Filter float32, slam, 0 landmarks in 20 slots, at 0 ns, "
    assert repr(filter).startswith(shown)
    filter.predict(0, ZEROS, ZEROS)
    told = repr(filter.update(10**8, frame_of([7, 7], np.ones((2, 4)))))
    assert told.startswith("Report(t_ns=100000000, status=0, health=")
    assert "REFUSED_INPUT" in told
    assert ", observations=2, " in told
    assert re.search(r"Health\(health=\w+, reasons=[\w|]+, seconds_without", repr(filter.health()))
    assert repr(binding.Report()).startswith("Report(t_ns=0, status=0, health=good, reasons=none, ")
    assert "nu=[0.0, 0.0" in repr(binding.Supervision())
    assert repr(binding.Setting()).startswith("Setting(id=0, name=None")


def seen(points_C: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Pixels (n, 4) of points in the camera."""
    x, y, z = points_C.T
    u, v = CAMERA.fx_px * x / z + CAMERA.cx_px, CAMERA.fy_px * y / z + CAMERA.cy_px
    return np.stack([u, v, u - CAMERA.fx_px * CAMERA.baseline_m / z, v], axis=1)


def test_landmarks_known_and_evicted_pass_through_the_map() -> None:
    rng = np.random.default_rng(5)
    points = rng.uniform([-3, -2, 4], [3, 2, 9], (30, 3))
    known = {i: KnownLandmark(p, 1e-4 * np.eye(3)) for i, p in enumerate(points)}
    filter = Filter(CAMERA, {"mode": "localization", "start-sigma": 0.1}, known=known)
    filter.predict(0, [0, 0, 0], [0, 0, 0])
    for step in range(1, 6):
        report = filter.update(step * 10**8, frame_of(range(30), seen(points - [0.05, 0, 0])))
    assert report.used > 20
    np.testing.assert_allclose(filter.pose().p, [0.05, 0, 0], atol=0.02)
    mapper = Filter(CAMERA)
    mapper.predict(0, [0, 0, 0], [0, 0, 0])
    mapper.update(1, frame_of(range(30), seen(points)))
    landmarks = mapper.landmarks()
    assert set(landmarks["id"]) == set(range(30))
    np.testing.assert_allclose(landmarks["p_W_m"], points[landmarks["id"]], rtol=1e-4)
    mapper.flush_map()
    assert len(mapper.landmarks()) == 0
    assert set(mapper.evicted) == set(range(30))
    np.testing.assert_allclose(np.asarray(mapper.evicted[7].p_W_m), points[7], rtol=1e-4)


NUMBERS = st.floats(width=64) | st.sampled_from([0.0, -0.0, 1e-310, 1e300, np.inf, -np.inf, np.nan])
THREE = arrays.arrays(np.float64, 3, elements=NUMBERS)
PIXEL = st.floats(-2000, 4000, width=32) | st.sampled_from([0.0, 1e30, np.inf, np.nan])
FRAMES = st.integers(0, 40).flatmap(
    lambda n: st.tuples(
        arrays.arrays(np.uint32, n, elements=st.integers(0, 60)),
        arrays.arrays(np.float32, (n, 4), elements=PIXEL.map(np.float32)),
    )
)
STEPS = st.lists(
    st.tuples(st.just("predict"), st.integers(0, 2 * 10**9), THREE, THREE)
    | st.tuples(st.just("update"), st.integers(0, 2 * 10**9), FRAMES, st.integers(0, 65535))
    | st.tuples(st.just("measure"), st.integers(0, 2 * 10**9), THREE, THREE)
    | st.tuples(st.just("save"), st.just(0), st.just(None), st.just(None)),
    max_size=25,
)


@pytest.mark.parametrize("precision", PRECISIONS)
@BUSY
@given(steps=STEPS)
def test_whatever_comes_the_state_stays_finite_and_its_covariance_positive(
    precision: Precision, steps: list[tuple[str, int, Any, Any]]
) -> None:
    """A call is carried out or refused by name; what it leaves is an estimate."""
    filter = Filter(CAMERA, {"slots": 15}, precision=precision)
    now, refused = 0, []
    for what, ahead, one, other in steps:
        now += ahead
        try:
            if what == "predict":
                filter.predict(now, one, other)
            elif what == "update":
                filter.update(now, frame_of(*one), budget=other)
            elif what == "measure":
                filter.measure(now, "position", one, np.abs(other))
            else:
                filter.restore(filter.save())
        except FilterError as error:
            refused.append(error.status)
        pose, P = filter.pose(), filter.pose_covariance()
        assert np.isfinite(pose.R).all()
        assert np.isfinite(pose.p).all()
        np.testing.assert_allclose(pose.R @ pose.R.T, np.eye(3), atol=1e-5)
        assert (P == P.T).all()
        assert (np.linalg.eigvalsh(P) > 0).all()
    assert all(status < 0 for status in refused)


def test_a_standstill_is_measured() -> None:
    recording = simulate(Options(duration_s=1.0)).recording
    filter = Filter.of_recording(list(recording.messages()))
    filter.set_pose(0, np.eye(3), np.zeros(3))
    filter.predict(7, [0, 0, 0], [0, 0, 0])
    assert filter.measure(7, "standstill", [0, 0, 0], [0.01, 0.01, 0]).used
