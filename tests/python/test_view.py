# SPDX-License-Identifier: MIT
"""`pelorus view` and `pelorus stream --view`: what they write is read back by Rerun's own reader
and by MCAP's, and compared with the log.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted import Run as Command
from fake_board import FakeBoard, TcpBoard
from pelorus.math.ellipsoids import POINT_M, SIGMAS, ellipsoids, of_landmarks
from pelorus.simulate.mishaps import Mishaps
from pelorus.simulate.settings import Span
from pelorus.simulate.simulate import Options, simulate
from pelorus.wire.evidence import Evidence
from pelorus.wire.frames import Landmark, Message, Pose, Report, Role, Stereo
from pelorus.wire.framing import messages_of, write_file
from pelorus.wire.layout import pack_symmetric, unpack_symmetric
from replay_drive import drive, encode, log_of, run
from scipy.spatial.transform import Rotation

EVIL = "</script><img src=x onerror=alert(1)>\n../../x"
S = 1_000_000_000


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns the log of a drive whose wheels slip, with a malicious name."""
    folder = tmp_path_factory.mktemp("view")
    mishaps = Mishaps(slip=0.5, slip_span=Span(12.0, 3.0))
    recording = simulate(Options(seed=4, duration_s=20.0, mishaps=mishaps)).recording
    recording.with_header(name=EVIL).write(folder / "in.plr")
    run(folder / "in.plr", "--quiet", "--out", folder / "log.plr", "--slots", "40")
    return folder / "log.plr"


def poses_of(messages: list[Message]) -> list[Pose]:
    return [m for m in messages if isinstance(m, Pose) and m.after_stereo]


def left_behind(messages: list[Message]) -> list[Landmark]:
    return [m for m in messages if isinstance(m, Landmark) and m.role != Role.KNOWN]


# --- shapes ---------------------------------------------------------------------------------------


def test_an_ellipsoid_is_the_covariance_again() -> None:
    chance = np.random.default_rng(3)
    roots = chance.normal(size=(50, 3, 3))
    P = roots @ roots.transpose(0, 2, 1)
    shape = ellipsoids(P)
    axes = Rotation.from_quat(shape.turn).as_matrix()
    back = np.einsum("nij,nj,nkj->nik", axes, (shape.half_m / SIGMAS) ** 2, axes)
    assert np.allclose(back, P)


def test_a_covariance_that_is_none_is_a_point() -> None:
    shape = ellipsoids(np.array([np.full((3, 3), np.nan), -np.eye(3)]))
    assert (shape.half_m == 0).all()
    assert np.isfinite(shape.turn).all()


def test_an_ellipsoid_as_long_as_the_way_to_it_is_a_point() -> None:
    near, far = np.array([1.0, 0.0, 0.0]), np.array([30.0, 0.0, 0.0])
    P = pack_symmetric(np.diag([4.0, 0.01, 0.01]))  # three sigma are six metres
    shape = of_landmarks([Landmark(1, near, P), Landmark(2, far, P)], np.zeros(3))
    assert np.allclose(shape.half_m.max(axis=1), [POINT_M, 6.0])


# --- Foxglove -------------------------------------------------------------------------------------


def read_mcap(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Time and message by topic, as MCAP's reader decodes them."""
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_protobuf.decoder")
    found: dict[str, list[Any]] = defaultdict(list)
    with path.open("rb") as stream:
        opened = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        for schema, channel, message in opened.iter_messages():
            if channel.message_encoding == "json":
                content = json.loads(message.data)
            else:
                content = decoder.DecoderFactory().decoder_for("protobuf", schema)(message.data)
                assert schema.name.startswith("foxglove.")
            found[channel.topic].append((message.log_time, content))
    return found


def test_a_layout_shows_what_the_file_holds(log: Path, tmp_path: Path, pelorus: Command) -> None:
    mcap, layout = tmp_path / "log.mcap", tmp_path / "layout.json"
    pelorus("view", log, "--mcap", mcap, "--layout", layout)
    held = read_mcap(mcap)
    panels = json.loads(layout.read_text())["configById"]
    topics = {topic for panel in panels.values() for topic in panel.get("topics", {})}
    assert topics - {"/pelorus/truth"} <= set(held)
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", ())]
    assert len(paths) > 6
    for topic, _, name in (value.removesuffix('"').partition('."') for value in paths):
        assert name in held[topic][-1][1], topic


def test_mcap_holds_the_log_with_foxglove_s_schemas(
    pelorus: Command, log: Path, tmp_path: Path
) -> None:
    pytest.importorskip("foxglove")
    out = tmp_path / "out.mcap"
    pelorus("view", log, "--mcap", out)
    messages, found = messages_of(log), read_mcap(out)
    poses = poses_of(messages)
    told = found["/pelorus/odometry"]
    assert [t for t, _ in told] == [pose.t_ns for pose in poses]
    for pose, (_, odometry) in list(zip(poses, told, strict=True))[::20]:
        there = odometry.pose.position
        assert np.allclose([there.x, there.y, there.z], pose.p_WB_m, atol=1e-12)
        R = np.asarray(pose.R_WB)
        P = unpack_symmetric(np.asarray(pose.covariance)[None], 6)[0]
        in_world = np.array(odometry.pose_covariance).reshape(6, 6)[:3, :3]
        assert np.allclose(in_world, R @ P[:3, :3] @ R.T, rtol=1e-6, atol=1e-15)
    reports = [m for m in messages if isinstance(m, Report) and m.nis_dof]
    nis = [x["NIS of a degree of freedom"] for _, x in found["/pelorus/curves/innovations"]]
    assert np.allclose(nis, [report.nis / report.nis_dof for report in reports])
    entities = Counter(e.id for _, update in found["/pelorus/scene"] for e in update.entities)
    assert {f"landmark {m.id}" for m in left_behind(messages)} <= entities.keys()
    assert {"tf", "calibration", "truth", "points"} <= {name.split("/")[2] for name in found}
    assert any("pictures contradict" in said.message for _, said in found["/pelorus/health"])


def test_points_that_were_rejected_are_red_in_mcap(
    pelorus: Command, log: Path, tmp_path: Path
) -> None:
    pytest.importorskip("foxglove")
    out = tmp_path / "out.mcap"
    pelorus("view", log, "--mcap", out)
    messages = messages_of(log)
    rejected = {m.t_ns: set(m.rejected["id"].tolist()) for m in messages if isinstance(m, Evidence)}
    frames = {m.t_ns: m for m in messages if isinstance(m, Stereo)}
    red = 0
    for t_ns, shown in read_mcap(out)["/pelorus/points"]:
        (points,) = shown.points
        due = [i in rejected.get(t_ns, ()) for i in frames[t_ns].ids.tolist()]
        assert [colour.r > colour.g for colour in points.outline_colors] == due
        red += sum(due)
    assert red > 0


def test_mcap_is_whole_and_its_schemas_are_foxglove_s(
    pelorus: Command, log: Path, tmp_path: Path
) -> None:
    """By MCAP's own reader, which checks each CRC, and the messages that Foxglove publishes."""
    published = pytest.importorskip("foxglove.messages")
    reader = pytest.importorskip("mcap.reader")
    out = tmp_path / "out.mcap"
    pelorus("view", log, "--mcap", out)
    with out.open("rb") as stream:
        opened = reader.make_reader(stream, validate_crcs=True)
        summary = opened.get_summary()
        counts = Counter(channel.id for _, channel, _ in opened.iter_messages())
    assert summary.statistics.channel_message_counts == counts
    for schema in summary.schemas.values():
        if schema.encoding == "jsonschema":
            assert json.loads(schema.data)["type"] == "object"
        else:
            assert schema.encoding == "protobuf"
            known = getattr(published, schema.name.removeprefix("foxglove.")).get_schema()
            assert (schema.name, schema.data) == (known.name, known.data)


def stamps_in(message: Any) -> list[int]:
    """What it says itself of its time, and its parts of theirs."""
    parts = [part for name in ("points", "entities") for part in getattr(message, name, ())]
    stamps = [
        part.timestamp
        for part in (message, *parts)
        if "timestamp" in part.DESCRIPTOR.fields_by_name and part.HasField("timestamp")
    ]
    return [stamp.seconds * S + stamp.nanos for stamp in stamps]


def test_times_and_frames_in_mcap_fit_together(pelorus: Command, log: Path, tmp_path: Path) -> None:
    """A viewer puts nothing in place whose frame is in no tree, or whose time is another's."""
    pytest.importorskip("foxglove")
    out = tmp_path / "out.mcap"
    pelorus("view", log, "--mcap", out)
    found = read_mcap(out)
    parents: dict[str, str] = {}
    for _, tf in found["/pelorus/tf"]:
        q, p = tf.rotation, tf.translation
        assert abs(np.linalg.norm([q.x, q.y, q.z, q.w]) - 1) < 1e-9
        assert np.isfinite([p.x, p.y, p.z]).all()
        assert parents.setdefault(tf.child_frame_id, tf.parent_frame_id) == tf.parent_frame_id
    roots = set(parents.values()) - parents.keys()
    assert len(roots) == 1
    for frame in parents:
        way = [frame]
        while way[-1] in parents:
            way.append(parents[way[-1]])
            assert len(way) <= len(parents) + 1, "the frames go in a circle"
        assert {way[-1]} == roots
    named = set()
    for topic, messages in found.items():
        assert [t for t, _ in messages] == sorted(t for t, _ in messages)
        for t_ns, message in messages:
            if topic.startswith("/pelorus/curves/"):
                continue
            stamps = stamps_in(message)
            assert stamps, f"{topic} says no time"
            assert set(stamps) == {t_ns}, topic
            named |= {e.frame_id for e in getattr(message, "entities", ())}
            named |= {getattr(message, name, "") for name in ("frame_id", "body_frame_id")}
    assert named - {""} <= parents.keys() | roots


# --- Rerun ----------------------------------------------------------------------------------------


def read_rrd(path: Path) -> dict[str, list[Any]]:
    """All rows of each entity's components, as Rerun's reader gives them."""
    chunk = pytest.importorskip("rerun.chunk")
    found: dict[str, list[Any]] = defaultdict(list)
    for piece in chunk.RrdReader(path).stream():
        batch = piece.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if ":" in name:
                rows = [row.as_py() for row in column]
                found[f"{piece.entity_path} {name}"] += [row for row in rows if row is not None]
    return found


def test_rrd_holds_the_log(pelorus: Command, log: Path, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    out = tmp_path / "out.rrd"
    pelorus("view", log, "--rrd", out)
    messages, found = messages_of(log), read_rrd(out)
    poses = poses_of(messages)
    moved = np.array([row[0] for row in found["/world/body Transform3D:translation"]])
    assert np.allclose(moved, [pose.p_WB_m for pose in poses], atol=1e-5)
    half = np.array([row[0] for row in found["/world/body/three-sigma Ellipsoids3D:half_sizes"]])
    P = unpack_symmetric(np.array([p.covariance for p in poses]), 6)[:, :3, :3]
    assert np.allclose(np.square(half).sum(axis=1), 9 * np.trace(P, axis1=1, axis2=2), rtol=1e-4)
    used = [row[0] for row in found["/curves/points/used Scalars:scalars"]]
    assert used == [m.used for m in messages if isinstance(m, Report) and m.observations]
    labels = {
        label
        for name, rows in found.items()
        if name.startswith("/world/map/") and name.endswith(":labels")
        for label in rows[-1]
    }
    assert labels == {str(m.id) for m in left_behind(messages)}
    words = [row[0] for row in found["/health TextLog:text"]]
    assert any("pictures contradict twists" in line for line in words)


def test_a_robot_is_shown_while_it_drives(pelorus: Command, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    recording, out = tmp_path / "drive.plr", tmp_path / "live.rrd"
    recording.write_bytes(encode(drive()))
    board = FakeBoard()
    with TcpBoard(board) as served:
        pelorus("stream", recording, "--to", served.target, "--view", out)
    moved = [row[0] for row in read_rrd(out)["/world/body Transform3D:translation"]]
    assert np.allclose(moved, [pose.p_WB_m for pose in board.poses], atol=1e-5)


# --- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("option", "module"), [("--rrd", "rerun"), ("--mcap", "foxglove")])
def test_a_missing_library_is_one_sentence(
    option: str, module: str, log: Path, tmp_path: Path
) -> None:
    code = (
        f"import sys; sys.modules[{module!r}] = None;"
        "from pelorus.commands.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    out = tmp_path / "out"
    command = [sys.executable, "-c", code, "view", str(log), option, str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    said = " ".join(done.stderr.split())
    assert said == f"error: this needs {module}, which is missing: pip install 'pelorus-slam[view]'"
    assert not list(tmp_path.iterdir())


def test_what_makes_no_sense_is_said(pelorus: Command, log: Path, tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    said = pelorus("view", log, status=2).err
    assert "--layout" in said
    assert "say where to show it" in " ".join(said.replace("│", " ").split())
    empty = tmp_path / "empty.plr"
    header = messages_of(log)[:1]
    write_file(empty, header, 1)
    out = tmp_path / "out.rrd"
    assert pelorus("view", empty, "--rrd", out, status=1).err.startswith("error: ")
    assert not out.exists()
    nowhere = tmp_path / "there" / "is" / "none.rrd"
    assert "none.rrd" in pelorus("view", log, "--rrd", nowhere, status=1).err
    said = pelorus("view", log, "--connect", "desk", status=1).err
    assert "is no viewer's address: rerun+http or rerun+https or rerun://HOST:9876" in said
    nobody = "rerun+http://127.0.0.1:9/proxy"
    assert "no viewer answers there" in pelorus("view", log, "--connect", nobody, status=1).err
    there = tmp_path / "there.rrd"
    there.touch()
    absent = tmp_path / "absent.plr"
    said = pelorus("view", absent, "--force", "--rrd", there, status=1).err
    assert "absent.plr: there is no such file" in said
    assert "is the log itself" in pelorus("view", log, "--force", "--rrd", log, status=1).err


def test_a_log_that_is_cut_or_bare_is_shown_as_far_as_it_goes(
    pelorus: Command, log: Path, tmp_path: Path
) -> None:
    pytest.importorskip("rerun")
    cut = tmp_path / "cut.plr"
    cut.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    pelorus("view", cut, "--rrd", tmp_path / "cut.rrd", "--mcap", tmp_path / "cut.mcap")
    half = len(read_rrd(tmp_path / "cut.rrd")["/world/body Transform3D:translation"])
    assert 0 < half < len(poses_of(messages_of(log)))
    bare = tmp_path / "bare.plr"
    kept = [m for m in log_of(log) if not isinstance(m, Evidence)]
    write_file(bare, kept, len(kept))
    pelorus("view", bare, "--rrd", tmp_path / "bare.rrd")
    broken = tmp_path / "broken.plr"
    nowhere = [replace(m, p_WB_m=np.full(3, np.nan)) if isinstance(m, Pose) else m for m in kept]
    write_file(broken, [*kept[: len(kept) // 2], *nowhere[len(kept) // 2 :]], len(kept))
    pelorus("view", broken, "--rrd", tmp_path / "b.rrd", "--mcap", tmp_path / "b.mcap")
    moved = read_rrd(tmp_path / "b.rrd")["/world/body Transform3D:translation"]
    assert 0 < len(moved) < len(poses_of(kept))
    pelorus("explain", broken, "--page", tmp_path / "b.html")
    silent = tmp_path / "silent.plr"
    write_file(silent, [m for m in kept if not isinstance(m, Report)], len(kept))
    words = pelorus("explain", silent, status=1).err
    assert words == f"error: {silent}: holds no REPORT of a frame: a whole log is expected\n"
    assert not any(name.startswith("/curves/doubt") for name in read_rrd(tmp_path / "bare.rrd"))
