# SPDX-License-Identifier: MIT
"""`--map-in`: a map of one drive in the next one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pelorus.wire.frames import BodyAxes, Camera, Kind, Landmark, Message, Role, Twist
from replay_drive import (
    OK,
    USAGE,
    Record,
    bits_of,
    drive,
    err0_m,
    header,
    judged,
    known,
    log_of,
    poses_of,
    run,
    stereo,
    truth,
    twist,
)

HALF = 320  # steps: once round the circle
SLOTS = ("--slots", "256")
LOCALIZE = (*SLOTS, "--mode", "localization")
ROUND = np.array([1.0, 0, 1, 0, 0, 1])  # 1 m^2 along each axis


def half(first: int) -> list[Message]:
    """One time round, with a gyro that is wrong by 0.01 rad/s."""
    messages: list[Message] = [header()]
    for k in range(first, first + HALF):
        reading = twist(k)
        wrong = Twist(reading.t_ns, reading.v_B_mps, reading.w_B_radps + 0.01)
        messages += [wrong, truth(k), stereo(k, 0.5)]
    return messages


@pytest.fixture
def map_of_the_first_half(record: Record, tmp_path: Path) -> Path:
    path = tmp_path / "map.plr"
    run(record(half(0)), *SLOTS, "--mode", "mapping", "--out", path)
    return path


def test_one_half_is_mapped_and_the_other_located_in_it(
    record: Record, map_of_the_first_half: Path, tmp_path: Path
) -> None:
    second = record(half(HALF))
    lost = judged(second, "--mode", "dead_reckoning")
    assert lost["err0_m"] > 1
    log = tmp_path / "log.plr"
    options = (*LOCALIZE, "--bias", "off", "--gyro-sigma", "0.03", "--json")
    found = run(second, *options, "--map-in", map_of_the_first_half, "--out", log)
    assert found.summary["used"] > 0.9 * found.summary["matched"] > 1000
    assert err0_m(log) < 0.05
    told = run(second, *options)
    assert "none was given" in told.stderr  # without the map there is nothing to locate in
    assert told.summary["used"] == 0


def test_the_flight_log_holds_the_map_and_replays_to_the_same_bits(
    record: Record, map_of_the_first_half: Path, tmp_path: Path
) -> None:
    log, again = tmp_path / "log.plr", tmp_path / "again.plr"
    run(record(half(HALF)), *LOCALIZE, "--map-in", map_of_the_first_half, "--out", log)
    run(log, "--out", again)
    assert bits_of(log) == bits_of(again)
    assert len(poses_of(log)) == HALF
    given = [m for m in log_of(log) if isinstance(m, Landmark) and m.role is Role.KNOWN]
    made = [m for m in log_of(map_of_the_first_half) if isinstance(m, Landmark)]
    assert {m.id for m in given} == {m.id for m in made}
    assert len(given) > 100


def test_slam_takes_it_where_known_map_is_on(record: Record, map_of_the_first_half: Path) -> None:
    second = record(half(HALF))
    both = (second, *SLOTS, "--map-in", map_of_the_first_half)
    assert "is not asked for" in run(*both).stderr
    assert run(*both, "--known-map", "on", "--json").stderr == ""
    assert judged(*both, "--known-map", "on")["err0_m"] < judged(*both)["err0_m"]


def test_what_made_the_map_is_no_part_of_it(record: Record, tmp_path: Path) -> None:
    """A log holds the known landmarks of its recording too, under the ids of the map's own."""
    path, log = tmp_path / "map.plr", tmp_path / "log.plr"
    knows = record([header(), *known(), *half(0)[1:]])
    run(knows, *SLOTS, "--mode", "mapping", "--out", path)
    run(record(half(HALF)), *LOCALIZE, "--map-in", path, "--out", log)
    made = {m.id: m for m in log_of(path) if isinstance(m, Landmark) and m.role is not Role.KNOWN}
    given = [m for m in log_of(log) if isinstance(m, Landmark) and m.role is Role.KNOWN]
    assert len(given) == len(made)
    assert all(np.array_equal(m.p_W_m, made[m.id].p_W_m) for m in given)


Change = Callable[[Landmark], list[Message]]


def spoiled(**changes: object) -> Change:
    return lambda landmark: [replace(landmark, **changes)]  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda landmark: [landmark, landmark], "landmark 0 stands twice"),
        (spoiled(covariance=np.zeros(6)), "landmark 0: it has no covariance"),
        (spoiled(covariance=np.array([1.0, 0, -1, 0, 0, 1])), "landmark 0: its covariance has a"),
        (spoiled(covariance=np.array([1.0, 2, 1, 0, 0, 1])), "a correlation is beyond 1"),
        (
            spoiled(covariance=np.array([1.0, 0.9, 1, 0.9, -0.9, 1])),
            "its determinant is negative",
        ),
        (lambda _: [], "holds no landmark"),
        (spoiled(covariance=2.0**40 * ROUND), "no landmark whose place is known"),
    ],
)
def test_a_map_that_cannot_be_is_refused(
    record: Record, tmp_path: Path, change: Change, words: str
) -> None:
    landmark = known()[0]
    assert isinstance(landmark, Landmark)
    bad, way = record([header(), *change(landmark)]), tmp_path / "way.tum"
    bad = bad.rename(tmp_path / "map.plr")
    result = run(record(drive(2)), *LOCALIZE, "--map-in", bad, "--trajectory", way, status=USAGE)
    assert words in result.stderr
    assert "map.plr" in result.stderr
    assert not way.exists()


def test_a_landmark_whose_place_is_not_known_is_left_out(record: Record, tmp_path: Path) -> None:
    """As one at max-range, whose inverse range may be zero: its sigma is thousands of km."""
    first = known()[0]
    assert isinstance(first, Landmark)
    far = replace(first, id=9999, p_W_m=np.array([1e5, 0, 0]), covariance=1e13 * ROUND)
    path = record([header(), *known(), far]).rename(tmp_path / "map.plr")
    plain = record([header(), *known()]).rename(tmp_path / "plain.plr")
    second = record(drive())
    result = run(second, *LOCALIZE, "--map-in", path, status=None)
    assert "whose place is not known" in result.stderr
    assert result.status == OK
    found, wanted = (judged(second, *LOCALIZE, "--map-in", known) for known in (path, plain))
    assert found["err0_m"] == wanted["err0_m"]
    assert found["used"] == wanted["used"] > 0


def test_a_file_that_is_no_map_is_refused(record: Record, tmp_path: Path) -> None:
    path, drive_path = tmp_path / "map.plr", record(drive(2))
    path.write_bytes(b"ply\nformat ascii 1.0\n")
    assert "is not a Pelorus file" in run(drive_path, "--map-in", path, status=USAGE).stderr
    assert "No such file" in run(drive_path, "--map-in", tmp_path / "none.plr", status=USAGE).stderr
    whole = record([header(), *known()])
    path.write_bytes(whole.read_bytes()[:-40])
    assert "was cut short" in run(record(drive(2)), "--map-in", path, status=USAGE).stderr


def test_a_map_in_another_frame_is_refused_and_of_another_camera_told(
    record: Record, tmp_path: Path
) -> None:
    turned = record([header(body_axes=BodyAxes.FORWARD_RIGHT_DOWN), *known()])
    turned = turned.rename(tmp_path / "turned.plr")
    result = run(record(drive(2)), *LOCALIZE, "--map-in", turned, status=USAGE)
    assert "is in another frame: its body axes are forward, right, down" in result.stderr
    other = record([header(camera=Camera(500, 500, 320, 240, 0.3)), *known()])
    other = other.rename(tmp_path / "other.plr")
    result = run(record(drive(2)), *LOCALIZE, "--map-in", other)
    assert "another camera" in result.stderr


def test_the_recordings_own_landmark_of_an_id_is_told_to_be_there_already(
    record: Record, map_of_the_first_half: Path
) -> None:
    first = next(m for m in log_of(map_of_the_first_half) if m.kind is Kind.LANDMARK)
    assert isinstance(first, Landmark)
    doubled = record([header(), replace(first, role=Role.KNOWN), *half(HALF)[1:]])
    result = run(doubled, *LOCALIZE, "--map-in", map_of_the_first_half)
    assert "was given before" in result.stderr
