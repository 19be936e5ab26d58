# SPDX-License-Identifier: MIT
"""Everyday faults are named, and clean recordings are not called faulty."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from converted import Converted, Run
from draws import draws
from everyday import drawn
from everyday import drive as everyday_drive
from injected import ALIKE, OF_RECORDINGS, found_in, of_times, piece
from pelorus.check.contents import recording_of
from pelorus.faults.fault import UNTOLD
from pelorus.faults.handeye import SEEN_MOST, first_part
from pelorus.faults.identity import Jumps
from pelorus.faults.named import judged_of
from pelorus.io.recording import Recording
from pelorus.wire import framing
from pelorus.wire.frames import Header, Kind, Stereo, Twist
from pelorus_course import matlab
from replay_drive import BIN, drive

STEADY = ("--bias-velocity-sigma", "0", "--loss", "0.03", "--twist-rate", "50")


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    from pelorus.commands.cli import main  # noqa: PLC0415 - typer is slow to load

    path = tmp_path_factory.mktemp("named") / "drive.plr"
    assert main(["simulate", str(path), "--seed", "4", "--duration", "25", *STEADY]) == 0
    return recording_of(framing.messages_of(path))


def test_a_clean_recording_has_no_faults(simulated: Recording) -> None:
    assert found_in(simulated) == []


@pytest.mark.parametrize(
    ("name", "strength"),
    [(n, k) for n in OF_RECORDINGS for k in draws(range(1 if n in ALIKE else 3))],
)
def test_a_fault_is_named(simulated: Recording, name: str, strength: int) -> None:
    change, due = OF_RECORDINGS[name]
    said = found_in(change(simulated, strength))
    assert said, "nothing was named"
    assert said[0].name in due, said


@pytest.mark.parametrize("by", [3.6, 1 / 3.6])
def test_a_unit_is_named_whichever_way_it_was_mistaken(simulated: Recording, by: float) -> None:
    said = found_in(replace(simulated, v_B_mps=by * simulated.v_B_mps))
    assert [fault.name for fault in said] == ["unit-km/h"]


@pytest.fixture(scope="module")
def blinking(simulated: Recording) -> Recording:
    tracks = simulated.tracks
    keep = (tracks.frame + tracks.id) % 7 > 1
    return replace(simulated, tracks=type(tracks)(
        tracks.frame_count, tracks.frame[keep], tracks.id[keep], tracks.pixels[keep]))  # fmt: skip


def test_points_that_come_back_are_no_slots(blinking: Recording) -> None:
    assert found_in(blinking) == []


@pytest.mark.parametrize("name", ["inverted", "degrees", "mm/s"])
def test_points_that_come_back_are_no_slots_where_the_twists_are_wrong(
    blinking: Recording, name: str
) -> None:
    """Twists that are wrong put every point elsewhere: where it must be is what the images say."""
    change, due = OF_RECORDINGS[name]
    assert found_in(change(blinking, 0))[0].name in due


def test_a_clean_piece_of_a_real_recording_has_no_faults(of_03: Converted) -> None:
    assert found_in(piece(of_03.recording, 300)) == []


@pytest.mark.parametrize("name", ["axes", "pitch", "degrees", "km/h", "u-v", "ids-slots"])
def test_a_fault_in_a_real_recording_is_named(of_03: Converted, name: str) -> None:
    change, due = OF_RECORDINGS[name]
    assert found_in(change(piece(of_03.recording, 300), 1))[0].name in due


@pytest.mark.parametrize(
    ("name", "strength"), [("mirrored", 0), ("small-pitch", 0), ("ids-slots", 2)]
)
def test_a_fault_of_few_points_is_named(
    real: Callable[[str], Path], name: str, strength: int
) -> None:
    """Starry Night, 5 of 20 points in sight: a mirrored x was told as an extrinsic off by 21
    degrees, a pitch of 6 degrees (5.5 +- 1.0) and slots (4 of 5 points came back elsewhere) not.
    """
    whole = matlab.starry_night(real("starry-night/dataset3.mat"))
    change, due = OF_RECORDINGS[name]
    assert found_in(change(piece(whole, 0), strength))[0].name in due


def test_a_mirrored_axis_is_told_by_ways_and_turns_together() -> None:
    """Up and down of a car: neither its vertical velocity nor its roll and pitch tell it alone
    beside the noise of these twists.
    """
    car = everyday_drive(drawn(7003), 7003)
    assert found_in(car) == []
    change, due = OF_RECORDINGS["mirrored"]
    assert found_in(change(car, 2))[0].name in due


def test_a_scene_that_moves_is_told_before_no_fit() -> None:
    """Two fifths of what a drone sees: nothing else fits then, and this is why."""
    change, _ = OF_RECORDINGS["moving"]
    said = found_in(change(everyday_drive(drawn(9101), 9101), 2))
    assert [fault.name for fault in said] == ["moving"]
    assert said[0].stops
    assert "do not tell the same motion" in said[0].words


def test_what_moves_fast_is_no_slot() -> None:
    """On a rover 342 tracks seemed to continue with another point."""
    change, due = OF_RECORDINGS["moving"]
    assert found_in(change(everyday_drive(drawn(9702), 9702), 2))[0].name in due


def test_of_few_points_a_long_drive_is_looked_at() -> None:
    """As many observations tell as much: a thousand frames of five are a sixth of the time."""
    recording = everyday_drive(drawn(9101), 9101)
    few = recording.tracks.id % 12 == 0
    tracks = recording.tracks
    thin = type(tracks)(301, tracks.frame[few], tracks.id[few], tracks.pixels[few])
    assert first_part(replace(recording, tracks=thin)).tracks.frame_count == 301
    many = np.repeat(np.arange(len(tracks)), 8)
    numbers = np.tile(np.arange(8), len(tracks))
    thick = type(tracks).from_rows(
        301, tracks.frame[many], 8 * tracks.id[many] + numbers, tracks.pixels[many]
    )
    part = first_part(replace(recording, tracks=thick)).tracks
    assert SEEN_MOST - 8 * 100 < len(part) <= SEEN_MOST
    assert part.frame_count == part.frame.max() + 1 < 301


def test_degrees_that_go_round_between_two_frames_are_degrees() -> None:
    """A drone with 46 rad/s: a lever made the degrees a scale of the velocities, and km/h."""
    change, _ = OF_RECORDINGS["degrees"]
    said = found_in(change(everyday_drive(drawn(7004), 7004), 0))
    assert [fault.name for fault in said] == ["unit-degrees"]


@pytest.mark.parametrize("seed", [0, 9618], ids=["clock", "scale"])
def test_velocities_that_do_not_vary_have_no_clock_and_no_scale_of_their_own(seed: int) -> None:
    """What chance made of them was followed step by step, to 168 +- 14 ms; a speed that is
    constant but for noise and a bias was 0.04 +- 0.04 times what the images show, and "no fit".
    """
    assert found_in(everyday_drive(drawn(seed), seed)) == []


@pytest.mark.parametrize(
    ("again", "elsewhere", "slots"), [(5, 4, True), (3, 3, False), (3, 0, False), (30, 15, False)]
)
def test_points_that_come_back_elsewhere_are_slots_beyond_chance(
    again: int, elsewhere: int, slots: bool
) -> None:
    assert Jumps(1, 75, again, elsewhere).are_slots == slots


@pytest.mark.parametrize("strength", draws(range(3)))
@pytest.mark.parametrize("name", ["time-unit", "time-order", "time-gap"])
def test_a_fault_of_the_clock_is_named(name: str, strength: int) -> None:
    messages = of_times(drive(60), strength, name)
    found = judged_of(messages, recording_of(messages)).faults
    assert name in [fault.name for fault in found], found


def test_the_same_drive_by_a_right_clock_has_no_faults() -> None:
    assert judged_of(drive(60), recording_of(drive(60))).faults == []


def test_what_no_known_fault_explains_is_not_guessed_at(simulated: Recording) -> None:
    chance = np.random.default_rng(1)
    noise = replace(simulated, v_B_mps=chance.normal(0, 3, simulated.v_B_mps.shape))
    said = found_in(noise)
    assert said
    assert not {"axes", "inverted"} & {fault.name for fault in said} or said[0].name == "no-fit"


def test_check_names_the_fault_and_writes_no_settings(tmp_path: Path, pelorus: Run) -> None:
    path, conf = tmp_path / "x.plr", tmp_path / "t.conf"
    swapped = [
        replace(m, pixels=m.pixels[:, [2, 3, 0, 1]]) if isinstance(m, Stereo) else m
        for m in drive(60)
    ]
    framing.write_file(path, swapped)
    said = pelorus("check", path, "--out", conf, "--bin", BIN, status=1)
    assert said.out.startswith("do not trust this")
    assert "left and right are swapped" in said.out
    assert not conf.exists()


def test_messages_without_ids_in_common_say_so() -> None:
    messages = [m for m in drive(30) if isinstance(m, Header | Twist | Stereo)]
    anew = [
        replace(m, ids=(m.ids + 1000 * k).astype(np.uint32)) if isinstance(m, Stereo) else m
        for k, m in enumerate(messages)
    ]
    found = judged_of(anew, recording_of(anew)).faults
    assert [fault.name for fault in found] == ["ids-new"]
    assert Kind.STEREO in {m.kind for m in anew}


def test_too_few_points_are_no_fault_and_not_called_good(simulated: Recording) -> None:
    tracks = simulated.tracks
    few = tracks.id % 20 == 0
    thin = type(tracks)(tracks.frame_count, tracks.frame[few], tracks.id[few], tracks.pixels[few])
    said = found_in(replace(simulated, tracks=thin))
    assert [fault.name for fault in said] == [UNTOLD]
    assert "cannot be judged" in said[0].words
