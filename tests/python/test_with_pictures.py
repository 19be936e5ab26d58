# SPDX-License-Identifier: MIT
"""Recordings with pictures: the replay's eyes see what `pelorus.Tracker` sees, to the bit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
from firmware import pictures
from pelorus import Tracker
from pelorus.converters import euroc, with_pictures
from pelorus.converters.streams import Asked
from pelorus.io import trajectory
from pelorus.math.se3 import Poses
from pelorus.rig.lens import Lens, LensModel
from pelorus.rig.rig import Rig
from pelorus.tracker import MODELS
from pelorus.wire import framing
from pelorus.wire.frames import (
    Config,
    Header,
    Imu,
    Kind,
    Message,
    Pose,
    Process,
    Report,
    Stereo,
    Twist,
)
from pelorus.wire.image import Image, RigMessage, TimedPair
from pelorus.wire.settings import IDS
from pictures_back import pairs_of
from replay_drive import run

STANDS = np.eye(3), np.zeros(3)


def standing(messages: list[Message]) -> Iterator[Message]:
    """The pictures of a recording, with twists that say that the body stands, and no bias.

    The motion that eyes expect is then none, which a test can tell the tracker, too.
    """
    header = next(m for m in messages if isinstance(m, Header))
    # the camera's axes are the body's: else rounding turns what stands by 1e-7
    yield replace(header, process=Process.TWIST, R_CB=np.eye(3), t_CB_m=np.zeros(3))
    yield from (m for m in messages if isinstance(m, RigMessage))
    yield Config({IDS["bias"]: 0.0})
    times: set[int] = set()
    for m in messages:
        if isinstance(m, Image):
            if m.t_ns not in times:
                yield Twist(m.t_ns)
            times.add(m.t_ns)
            yield m


def tracker_of(messages: list[Message]) -> Tracker:
    header = next(m for m in messages if isinstance(m, Header))
    rig = next(m for m in messages if isinstance(m, RigMessage))
    models = {number: model for model, number in MODELS.items()}

    def lens(side: str) -> Lens:
        four = (getattr(rig, f"{side}_{name}_px") for name in ("fx", "fy", "cx", "cy"))
        model = models[getattr(rig, f"{side}_model")]
        k = () if model is LensModel.NONE else tuple(getattr(rig, f"{side}_k").tolist())
        return Lens(model, tuple(four), k, rig.width_px, rig.height_px)

    given = Rig(Path(), lens("left"), lens("right"), Poses(rig.R_RL, rig.t_RL_m))
    return Tracker(given, tracks=rig.tracks or 400, camera=header.camera)


def assert_the_same(messages: list[Message], folder: Path) -> None:
    path, log = folder / "in.plr", folder / "log.plr"
    framing.write_file(path, messages, len(messages))
    run(path, "--out", log)
    logged = [m for m in framing.messages_of(log) if isinstance(m, Stereo)]
    pairs: list[TimedPair] = list(pairs_of(messages))
    tracker = tracker_of(messages)
    assert len(logged) == len(pairs) > 5
    for pair, stereo in zip(pairs, logged, strict=True):
        seen = tracker.track(
            pair.t_ns, pair.left, pair.right, motion=STANDS, t_right_ns=pair.t_right_ns
        )
        assert len(stereo.ids) > 10
        assert (seen.observations["id"] == stereo.ids).all()
        assert seen.pixels.tobytes() == stereo.pixels.tobytes()


def test_the_replay_sees_what_the_tracker_sees(tmp_path: Path) -> None:
    drive = pictures.recording(160, 120, 32, 32)
    assert_the_same(list(standing(list(drive.messages()))), tmp_path)


def test_a_log_of_pictures_replays_without_them_to_the_same_bits(tmp_path: Path) -> None:
    path, log, again = (tmp_path / name for name in ("in.plr", "log.plr", "again.plr"))
    pictures.recording(160, 120, 32, 32).write(path)
    run(path, "--out", log)
    run(log, "--out", again)
    assert log.stat().st_size < path.stat().st_size / 4
    first, second = (
        [m.pack() for m in framing.messages_of(name) if isinstance(m, Stereo | Pose)]
        for name in (log, again)
    )
    assert first == second


def test_pictures_through_real_lenses_are_kept_and_seen_alike(
    real: Callable[[str], Path], tmp_path: Path
) -> None:
    folder = real("images/euroc-v101-start/mav0/cam0/data.csv").parents[2]
    kept, _ = with_pictures.recording(euroc.read(folder, Asked()))
    assert kept.pictures is not None
    assert not len(kept.tracks)
    whole = kept.pictures
    few = replace(whole, t_ns=whole.t_ns[:7], read=lambda: islice(whole.read(), 7))
    assert_the_same(list(standing(list(replace(kept, pictures=few).messages()))), tmp_path)


def test_of_a_recording_with_pictures_and_truth_no_message_is_refused(
    real: Callable[[str], Path], tmp_path: Path
) -> None:
    folder = real("images/euroc-mh01-start/truth.tum").parent
    truth = trajectory.read_truth(folder / "truth.tum")
    kept, _ = with_pictures.recording(euroc.read(folder, Asked(truth=truth)))
    assert kept.pictures is not None
    last = kept.pictures.t_ns[2]
    few = [m for m in kept.messages() if not getattr(m, "t_ns", 0) > last]
    assert sum(isinstance(m, Imu) for m in few) > 10
    framing.write_file(tmp_path / "in.plr", few, len(few))
    run(tmp_path / "in.plr", "--out", tmp_path / "log.plr")
    answers = [m for m in framing.messages_of(tmp_path / "log.plr") if isinstance(m, Report)]
    assert len([m for m in answers if m.subject == Kind.STEREO]) == 3
    assert not [m for m in answers if m.status != 0]
