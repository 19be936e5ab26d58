# SPDX-License-Identifier: MIT
"""--save-state and --load-state: a drive in two parts has the bits of the whole one."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pelorus.wire.frames import Kind, Message, Report, Start, State, StateAction, Text, Truth
from replay_drive import (
    FRAMES,
    OK,
    OUTPUT,
    USAGE,
    Record,
    Result,
    drive,
    encode,
    header,
    later,
    log_of,
    poses_of,
    run,
    stereo,
    t_ns,
    truth,
    twist,
)

CUT = 17
FOREIGN, MODE = -16, -9  # plr_status


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    return tmp_path / "robot.state"


def part(first: int, last: int) -> list[Message]:
    """The drive's frames first to last - 1."""
    messages: list[Message] = [header()]
    for k in range(first, last):
        messages += [twist(k), truth(k), stereo(k, 0.5)]
    return messages


def bits(path: Path, first: int = 0) -> list[bytes]:
    """The payloads of its POSE frames from a time on."""
    return [pose.pack() for pose in poses_of(path) if pose.t_ns >= t_ns(first)]


def saved(record: Record, kept: Path, *options: str, program: str = "pelorus-replay") -> Result:
    """The first part of the drive, saved at its end."""
    return run(record(part(0, CUT)), "--save-state", kept, *options, program=program)


def statuses(path: Path) -> list[int]:
    """Returns the statuses of the answers to STATE in a log."""
    reports = [m for m in log_of(path) if isinstance(m, Report) and m.subject == Kind.STATE]
    return [report.status for report in reports]


# --- the same bits --------------------------------------------------------------------------------


@pytest.mark.parametrize("program", ["pelorus-replay", "pelorus-replay-f64"])
@pytest.mark.parametrize("bias", ["on", "off"])
def test_a_drive_in_two_parts_has_the_bits_of_the_whole_one(
    record: Record, kept: Path, tmp_path: Path, bias: str, program: str
) -> None:
    whole, rest = tmp_path / "whole.plr", tmp_path / "rest.plr"
    run(record(drive()), "--bias", bias, "--out", whole, program=program)
    first = saved(record, kept, "--bias", bias, program=program)
    assert "state saved: generation 1, " in first.stderr
    result = run(
        *(record(part(CUT, FRAMES)), "--bias", bias, "--load-state", kept, "--out", rest),
        program=program,
    )
    assert "state restored: generation 1, " in result.stderr
    assert bits(rest) == bits(whole, CUT)
    assert statuses(rest) == [0]


def test_neither_start_nor_truth_nor_the_lack_of_an_end_changes_that(
    record: Record, kept: Path, tmp_path: Path
) -> None:
    whole, rest = tmp_path / "whole.plr", tmp_path / "rest.plr"
    run(record(drive()), "--out", whole)
    far = np.array([500.0, 0, 0])
    run(record(encode(part(0, CUT), end=False)), "--save-state", kept)
    messages = part(CUT, FRAMES)
    messages[1:1] = [Start(t_ns(CUT), p_WB_m=far), Truth(t_ns(CUT), p_WB_m=far)]
    run(record(messages), "--load-state", kept, "--out", rest)
    assert bits(rest) == bits(whole, CUT)


def test_a_file_can_be_gone_on_from_and_saved_into_at_once(
    record: Record, kept: Path, tmp_path: Path
) -> None:
    whole, rest = tmp_path / "whole.plr", tmp_path / "rest.plr"
    run(record(drive()), "--out", whole)
    saved(record, kept)
    middle = run(record(part(CUT, 30)), "--load-state", kept, "--save-state", kept)
    assert "state saved: generation 2, " in middle.stderr
    run(record(part(30, FRAMES)), "--load-state", kept, "--out", rest)
    assert bits(rest) == bits(whole, 30)


def test_two_files_are_kept_apart(record: Record, kept: Path, tmp_path: Path) -> None:
    saved(record, kept)
    before = kept.read_bytes()
    other = tmp_path / "other.state"
    result = run(record(part(CUT, FRAMES)), "--load-state", kept, "--save-state", other)
    assert "state restored: generation 1" in result.stderr
    assert "state saved: generation 1" in result.stderr
    assert kept.read_bytes() == before


def test_on_another_clock_it_goes_on_where_it_stood(
    record: Record, kept: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.plr"
    messages = [header()] + [later(m, 3600) for m in part(CUT, FRAMES)[1:]]
    saved(record, kept)
    result = run(record(messages), "--load-state", kept, "--out", out, "--json")
    assert result.summary["messages_refused"] == 0
    x = poses_of(out)[-1].p_WB_m
    assert np.linalg.norm(x - truth(FRAMES - 1).p_WB_m) < 0.5


def test_the_file_keeps_the_last_two(record: Record, kept: Path) -> None:
    for generation in range(1, 5):
        result = saved(record, kept)
        assert f"state saved: generation {generation}, " in result.stderr


# --- what cannot be used --------------------------------------------------------------------------


def refused(result: Result, *words: str | Path) -> None:
    for word in words:
        assert str(word) in result.stderr


def test_a_state_of_other_settings_cameras_or_builds_is_refused(
    record: Record, kept: Path, tmp_path: Path
) -> None:
    saved(record, kept)
    out = tmp_path / "out.plr"
    rest = record(part(CUT, FRAMES))
    other = ("--load-state", kept, "--json", "--quiet", "--out", out)
    refused(
        run(rest, *other, "--pixel-sigma", "3", status=USAGE), kept, "one calibration and one set"
    )
    assert statuses(out) == [FOREIGN]
    assert not poses_of(out)
    refused(
        run(rest, *other, program="pelorus-replay-f64", status=USAGE),
        kept,
        "another version or build",
    )
    camera = replace(header(), t_CB_m=np.array([0.1, 0, 0]))
    result = run(record([camera, *part(CUT, FRAMES)[1:]]), *other, status=USAGE)
    refused(result, kept, "one calibration")
    assert result.stdout == ""


def test_a_damaged_file_is_refused(record: Record, kept: Path) -> None:
    saved(record, kept)
    content = bytearray(kept.read_bytes())
    content[200] ^= 1
    kept.write_bytes(content)
    refused(
        run(record(part(CUT, FRAMES)), "--load-state", kept, status=USAGE), kept, "fail their check"
    )


def test_after_a_cut_the_older_state_is_taken(record: Record, kept: Path) -> None:
    saved(record, kept)
    saved(record, kept)
    content = bytearray(kept.read_bytes())
    half = len(content) // 2
    content[half : half + 5000] = bytes(5000)
    kept.write_bytes(content)
    result = run(record(part(CUT, FRAMES)), "--load-state", kept)
    assert "state restored: generation 1" in result.stderr


def test_what_is_no_file_of_states_is_named_and_left_alone(
    record: Record, kept: Path, tmp_path: Path
) -> None:
    path = record(drive())
    missing = tmp_path / "missing.state"
    refused(
        run(path, "--load-state", missing, status=USAGE), missing, "No such file", "--save-state"
    )
    refused(run(path, "--load-state", tmp_path, status=USAGE), tmp_path, "no regular file")
    for content in (path.read_bytes(), b"", b"x", b"MZ" * 8192, bytes(8191)):
        kept.write_bytes(content)
        refused(run(path, "--load-state", kept, status=USAGE), kept, "no file of saved states")
        if content:
            refused(run(path, "--save-state", kept, status=OUTPUT), kept, "left as it is")
        assert kept.read_bytes() == content
    folder = tmp_path / "no" / "such" / "folder"
    refused(
        run(path, "--save-state", folder, status=OUTPUT), folder, "give a path that can be written"
    )
    refused(run(path, "--save-state", "/dev/null", status=OUTPUT), "/dev/null", "no regular file")


def test_a_file_with_zeros_where_a_slot_would_begin_is_left_alone(
    record: Record, kept: Path
) -> None:
    path = record(drive())
    half = 1 << 19
    pages = b"SQLite format 3\0".ljust(2 * half, b"x")
    zeros = [(0, 4), (half, half + 4), (half, 2 * half)]  # as in many a database or disk image
    for first, last in zeros:
        kept.write_bytes(pages[:first] + bytes(last - first) + pages[last:])
        before = kept.read_bytes()
        refused(run(path, "--save-state", kept, status=OUTPUT), kept, "left as it is")
        refused(run(path, "--load-state", kept, status=USAGE), kept, "no file of saved states")
        assert kept.read_bytes() == before


def test_states_with_something_behind_them_are_no_file_of_states(
    record: Record, kept: Path
) -> None:
    path = record(drive())
    saved(record, kept)
    size = kept.stat().st_size
    for longer in (size + 4096, (1 << 30) + 8192):
        os.truncate(kept, longer)
        refused(run(path, "--load-state", kept, status=USAGE), kept, "no file of saved states")
        refused(run(path, "--save-state", kept, status=OUTPUT), kept, "left as it is")
        assert kept.stat().st_size == longer


def test_a_cut_in_the_first_slot_leaves_the_second(record: Record, kept: Path) -> None:
    saved(record, kept)
    saved(record, kept)
    content = bytearray(kept.read_bytes())
    content[:5000] = b"\xff" * 5000
    kept.write_bytes(content)
    result = run(record(part(CUT, FRAMES)), "--load-state", kept)
    assert "state restored: generation 2" in result.stderr


def test_a_file_whose_first_save_was_cut_is_saved_into(record: Record, kept: Path) -> None:
    saved(record, kept)
    content = bytearray(kept.read_bytes())
    content[:4096] = b"\xff" * 4096  # erased, and of the state only what lies behind came to disk
    kept.write_bytes(content)
    refused(
        run(record(drive()), "--load-state", kept, status=USAGE), kept, "nothing was saved in it"
    )
    assert "state saved: generation 1, " in saved(record, kept).stderr


def test_a_drive_without_data_pushes_out_no_state(record: Record, kept: Path) -> None:
    saved(record, kept)
    before = kept.read_bytes()
    result = run(record([header(), truth(0)]), "--save-state", kept, status=None)
    assert result.status != OK
    assert f"{kept}: the state was not saved: no data was taken" in result.stderr
    assert kept.read_bytes() == before


def test_a_blank_file_holds_no_state(record: Record, kept: Path) -> None:
    kept.write_bytes(bytes(2 * 4096))
    refused(
        run(record(drive()), "--load-state", kept, status=USAGE), kept, "nothing was saved in it"
    )


def test_a_file_of_a_smaller_build_is_too_small(record: Record, kept: Path) -> None:
    kept.write_bytes(bytes(2 * 4096))
    result = run(record(drive()), "--save-state", kept, "--json", status=OUTPUT)
    refused(result, kept, "too small", "it has 8192 bytes, and ")
    assert result.summary["frames"] == FRAMES  # the rest of the run is told all the same


def test_a_start_of_its_own_contradicts_it(record: Record, kept: Path) -> None:
    saved(record, kept)
    result = run(record(drive()), "--load-state", kept, "--start", "identity", status=USAGE)
    refused(result, "--load-state and --start")


def test_the_settings_can_be_printed_without_the_file(record: Record, tmp_path: Path) -> None:
    absent = tmp_path / "absent.state"
    run(record(drive()), "--load-state", absent, "--save-state", absent, "--print-config")
    assert not absent.exists()


# --- STATE in a recording -------------------------------------------------------------------------


def logged() -> list[Message]:
    """What a board was told: go on from the state that it kept, and keep it again."""
    messages = part(CUT, FRAMES)
    messages[1:1] = [State(t_ns(CUT - 1), StateAction.RESTORE)]
    return [*messages, State(t_ns(FRAMES), StateAction.SAVE)]


def test_without_the_state_a_replay_does_not_pretend(record: Record, tmp_path: Path) -> None:
    out = tmp_path / "out.plr"
    result = run(record(logged()), "--out", out, "--json")
    assert result.summary["messages_refused"] == 2
    assert "state not restored: there is no storage here" in result.stderr
    assert result.stderr.count("STATE: refused: ") == 1  # a save that fails changes no bit
    assert "state not saved: there is no storage here" in result.stderr
    assert "--load-state" in result.stderr
    assert statuses(out) == [MODE, MODE]


def test_with_the_state_it_gives_the_same_bits(record: Record, kept: Path, tmp_path: Path) -> None:
    whole, rest = tmp_path / "whole.plr", tmp_path / "rest.plr"
    run(record(drive()), "--out", whole)
    saved(record, kept)
    run(record(logged()), "--load-state", kept, "--out", rest)
    assert bits(rest) == bits(whole, CUT)
    run(rest, "--load-state", kept, "--out", tmp_path / "again.plr")
    assert bits(tmp_path / "again.plr") == bits(whole, CUT)


def test_a_restore_that_was_said_twice_is_replayed_twice(
    record: Record, kept: Path, tmp_path: Path
) -> None:
    whole, rest = tmp_path / "whole.plr", tmp_path / "rest.plr"
    run(record(drive()), "--out", whole)
    saved(record, kept)
    messages = logged()
    messages[1:1] = [messages[1]]  # its answer was lost, say
    other = tmp_path / "other.state"
    result = run(record(messages), "--load-state", kept, "--save-state", other, "--out", rest)
    assert bits(rest) == bits(whole, CUT)
    assert statuses(rest) == [0, 0, 0, 0]  # restored twice, saved by STATE and at the end
    assert "state saved: generation 2" in result.stderr


def test_a_state_to_save_into_is_no_state_to_go_on_from(record: Record, kept: Path) -> None:
    saved(record, kept)
    result = run(record(logged()), "--save-state", kept)
    assert "state not restored: nothing was ever saved here" in result.stderr
    assert "state saved: generation 2" in result.stderr  # by the recording's STATE
    assert "state saved: generation 3" in result.stderr  # and at the end


def test_the_texts_are_no_warnings(record: Record, kept: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.plr"
    saved(record, kept, "--out", str(out))
    told = [m for m in log_of(out) if isinstance(m, Text) and "state" in m.text]
    assert [text.severity for text in told] == [0]
