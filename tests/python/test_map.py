# SPDX-License-Identifier: MIT
"""`pelorus map`: what is free, what is occupied, and what a reader of the files makes of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from converted import Run as Command
from pelorus.errors import PelorusError
from pelorus.grid import files
from pelorus.grid.occupancy import Band, Grid, Wish, occupancy
from pelorus.grid.sightings import Sightings, sightings
from pelorus.wire.frames import BodyAxes, Header, Landmark, Message, Pose, Role, Stereo
from pelorus.wire.framing import messages_of
from pelorus.wire.layout import pack_symmetric
from PIL import Image
from replay_drive import BIN, drive, encode, header, known
from replay_drive import run as run_replay

CELL = 0.5
CERTAIN = 1e-6 * np.eye(3)
AHEAD = np.array([10.25, 3.25, 0.25])  # in the middle of a cell


def car() -> Header:
    return header(body_axes=BodyAxes.FORWARD_LEFT_UP, name="car")


def pose(k: int, p: Sequence[float], variance: float = 1e-8) -> Pose:
    P = pack_symmetric(variance * np.eye(6))
    return Pose(k, p_WB_m=np.array(p, float), covariance=P, after_stereo=True)


def frame(k: int, ids: Sequence[int]) -> Stereo:
    return Stereo(k, np.array(ids, np.uint32), np.zeros((len(ids), 4), np.float32))


def landmark(id: int, p: Any, t_ns: int, covariance: Any = CERTAIN, seen: int = 9) -> Landmark:
    packed = pack_symmetric(np.asarray(covariance))
    return Landmark(id, np.asarray(p, float), packed, Role.EVICTED, t_ns, seen)


def result(landmarks: Sequence[Landmark], steps: int = 9) -> list[Message]:
    """A car that creeps forward past y = 0.2, one cell a frame, and sees all of them each time."""
    messages: list[Message] = [car()]
    for k in range(steps):
        messages += [frame(k, [m.id for m in landmarks]), pose(k, (0.25 + CELL * k, 0.2, 0))]
    return messages + list(landmarks)


def seen_in(messages: list[Message]) -> Sightings:
    return sightings(Path("car.plr"), messages)


def drawn(messages: list[Message], **wish: Any) -> Grid:
    return occupancy(seen_in(messages), Wish(**({"resolution_m": CELL} | wish)))


def moved(*by: float) -> Any:
    """Metres along x, y and z."""
    return np.array(by)


class Read(NamedTuple):
    """A map as its reader holds it: -1, 0 or 100, row 0 the lowest."""

    cells: Any
    resolution: float
    origin: tuple[float, float, float]

    def at(self, x: float, y: float) -> int:
        column, row = np.floor((np.array([x, y]) - self.origin[:2]) / self.resolution).astype(int)
        return int(self.cells[row, column])


def read_as_nav2_does(path: Path) -> Read:
    """The rules of nav2's map_server: the image lies beside the YAML; its first row is the upper
    one; p = 1 - brightness (or brightness if negated); trinary.
    """
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    entries = {key.strip(): value.strip() for key, value in (line.split(":") for line in lines)}
    assert entries["mode"] == "trinary"
    x, y, yaw = (float(number) for number in entries["origin"].strip("[]").split(","))
    with Image.open(path.parent / entries["image"]) as picture:
        assert picture.format == "PPM"  # Pillow's name for the whole family
        assert picture.mode == "L"
        shade = np.asarray(picture, float) / 255
    p = shade if int(entries["negate"]) else 1 - shade
    occupied, free = float(entries["occupied_thresh"]), float(entries["free_thresh"])
    cells = np.where(p > occupied, 100, np.where(p < free, 0, -1))
    return Read(cells[::-1], float(entries["resolution"]), (x, y, yaw))


@pytest.fixture
def write(tmp_path: Path) -> Callable[[list[Message]], Path]:
    def to_file(messages: list[Message]) -> Path:
        path = tmp_path / "result.plr"
        path.write_bytes(encode(messages))
        return path

    return to_file


Write = Callable[[list[Message]], Path]


# --- the files ------------------------------------------------------------------------------------


def test_a_reader_of_the_files_finds_the_landmark_and_the_way_to_it(
    pelorus: Command, write: Write, tmp_path: Path
) -> None:
    path, folder = write(result([landmark(7, AHEAD, 8)])), tmp_path / "out" / "map"
    said = pelorus("map", path, "--out", folder, "--resolution", CELL)
    found = read_as_nav2_does(folder / "map.yaml")
    assert found.origin[2] == 0
    assert found.at(*AHEAD[:2]) == 100
    assert np.sum(found.cells == 100) == 1
    for share in (0.5, 0.8):  # on the way from the last place of the camera
        x, y = (1 - share) * np.array([4.25, 0.2]) + share * AHEAD[:2]
        assert found.at(x, y) == 0
    assert found.at(AHEAD[0], -AHEAD[1] + 0.4) == -1  # neither mirrored ...
    assert found.at(AHEAD[0] + 1, AHEAD[1]) == -1  # ... nor known behind it
    assert {p.name for p in folder.iterdir()} == {"map.pgm", "map.yaml", "map.png"}
    assert "1 occupied" in said.out


def test_a_reader_makes_of_each_cell_what_the_picture_shows(
    pelorus: Command, write: Write, tmp_path: Path
) -> None:
    points = [landmark(k, AHEAD + moved(k % 3, k - 3, 0), 8) for k in range(7)]
    messages = result(points)
    pelorus("map", write(messages), "--out", tmp_path, "--resolution", CELL)
    found, grid = read_as_nav2_does(tmp_path / "map.yaml"), drawn(messages)
    assert np.array_equal(found.cells, files.cells(grid))
    assert found.origin[:2] == pytest.approx(grid.origin_m)
    assert (files.brightness(grid)[grid.log_odds == 0] == 128).all()  # nothing known: the middle


def test_a_body_with_z_down_is_seen_from_above() -> None:
    messages = result([landmark(7, AHEAD * [1, 1, -1], 8)])
    down = [header(body_axes=BodyAxes.FORWARD_RIGHT_DOWN), *messages[1:]]
    grid = drawn(down)
    assert (grid.plane.right.label, grid.plane.up.label) == ("x (m)", "-y (m)")
    row, column = np.argwhere(files.cells(grid) == files.OCCUPIED)[0]
    middle = np.array(grid.origin_m) + CELL * (np.array([column, row]) + 0.5)
    assert middle == pytest.approx([AHEAD[0], -AHEAD[1]], abs=CELL)
    assert "y is -y" in files.text(grid)


# --- what a cell says -----------------------------------------------------------------------------


def log_odds_at(grid: Grid, x: float, y: float) -> float:
    column, row = np.floor((np.array([x, y]) - grid.origin_m) / CELL).astype(int)
    return float(grid.log_odds[row, column])


def test_a_landmark_of_doubtful_place_marks_nothing_and_frees_less() -> None:
    anchor = landmark(1, AHEAD + moved(0, -6, 0), 8)  # so that something stands in both maps
    doubtful = np.diag([3.0, 3.0, 1e-6])
    sure = drawn(result([anchor, landmark(7, AHEAD, 8)]))
    vague = drawn(result([anchor, landmark(7, AHEAD, 8, doubtful)]))
    assert np.sum(files.cells(sure) == files.OCCUPIED) == 2
    assert np.sum(files.cells(vague) == files.OCCUPIED) == 1
    assert np.sum(files.cells(vague) == files.FREE) < np.sum(files.cells(sure) == files.FREE)
    assert log_odds_at(sure, *AHEAD[:2]) > 5
    assert log_odds_at(vague, *AHEAD[:2]) < 0.5


def test_rays_that_pass_over_a_landmark_do_not_take_it_away() -> None:
    behind = [landmark(k, AHEAD * [2.5, 2.5, 1] + [0.5 * k, 0, 0], 8) for k in range(20)]
    grid = drawn(result([*behind, landmark(99, AHEAD, 8)]))
    assert log_odds_at(grid, *AHEAD[:2]) > 5
    assert log_odds_at(grid, *(AHEAD[:2] * 1.5)) < -1


def test_only_the_band_of_heights_counts_for_landmarks_and_for_rays() -> None:
    high = landmark(7, [20.25, 3.25, 8.0], 8)
    low = landmark(8, AHEAD + moved(0, -6, 0), 8)
    grid = drawn(result([high, low]), band=Band(-0.5, 1.0))
    assert grid.landmarks == 1
    # The ray to the high one leaves the band an eighth of the way on.
    assert log_odds_at(grid, 5.25, 0.4) < 0
    assert log_odds_at(grid, 9.75, 1.2) == 0
    assert drawn(result([high, low]), band=Band(-1, 10)).landmarks == 2


def test_heights_are_reckoned_from_the_body_where_it_was() -> None:
    """A drive uphill: the landmark is as high above the world's zero as the hill is."""
    climb = [
        replace(m, p_WB_m=np.array(m.p_WB_m) + moved(0, 0, 50)) if isinstance(m, Pose) else m
        for m in result([landmark(7, AHEAD + moved(0, 0, 50), 8)])
    ]
    assert drawn(climb).landmarks == 1


def test_where_the_camera_is_lost_in_the_world_the_map_around_it_is_sharp() -> None:
    """The covariance in the world is the pose's, seen through the lever of ten metres."""
    messages = result([landmark(7, AHEAD, 8)])
    s = AHEAD - [4.25, 0.2, 0]
    J = np.hstack((np.eye(3), -np.array([[0, -s[2], s[1]], [s[2], 0, -s[0]], [-s[1], s[0], 0]])))
    vague = pack_symmetric(0.25 * J @ J.T + CERTAIN)
    lost = [
        pose(m.t_ns, m.p_WB_m, 0.25)  # type: ignore[arg-type]
        if isinstance(m, Pose)
        else replace(m, covariance=vague)
        if isinstance(m, Landmark)
        else m
        for m in messages
    ]
    assert np.allclose(drawn(lost).log_odds, drawn(messages).log_odds, atol=0.05)


def test_a_landmark_seen_twice_is_not_believed() -> None:
    points = [landmark(7, AHEAD, 8), landmark(8, AHEAD + moved(0, 2, 0), 8, seen=2)]
    assert drawn(result(points)).landmarks == 1


def test_to_stand_and_stare_tells_nothing_new() -> None:
    still = [
        replace(m, p_WB_m=np.array([0.25, 0.2, 0])) if isinstance(m, Pose) else m
        for m in result([landmark(7, AHEAD, 99)], steps=100)
    ]
    once = [m for m in still if not isinstance(m, Stereo)] + [frame(99, [7])]
    assert np.array_equal(drawn(still).log_odds, drawn(once).log_odds)


def test_a_sighting_belongs_to_the_life_of_the_id_in_which_it_falls() -> None:
    first, second = landmark(7, AHEAD, 2), landmark(7, AHEAD + moved(0, 5, 0), 8)
    found = seen_in([*result([first]), second])  # nine frames saw id 7
    owners = found.landmarks_W[found.landmark][:, 1] - AHEAD[1]
    assert found.frame.tolist() == list(range(9))
    assert owners.tolist() == [0, 0, 0, 5, 5, 5, 5, 5, 5]


def test_cells_are_as_fine_as_the_landmarks_are_certain() -> None:
    for sigma, step in ((0.001, 0.05), (0.15, 0.2), (0.8, 1.0), (3.0, 1.0)):
        vague = sigma**2 * np.eye(3)
        points = [landmark(7, AHEAD * [3, 1, 1], 8, vague), landmark(8, AHEAD, 8, vague)]
        assert occupancy(seen_in(result(points)), Wish()).resolution_m == step


# --- whole drives ---------------------------------------------------------------------------------


def test_a_recording_is_replayed_first_and_gives_the_map_of_its_result(
    pelorus: Command, tmp_path: Path
) -> None:
    recording, log = tmp_path / "drive.plr", tmp_path / "log.plr"
    recording.write_bytes(encode(drive()))
    run_replay(recording, "--out", log, "--pixel-sigma", "0.5", "--quiet")
    common = ("--resolution", 0.2, "--out")
    pelorus("map", log, *common, tmp_path / "a")
    pelorus(
        "map",
        recording,
        "--bin",
        BIN,
        "--set",
        "pixel-sigma=0.5",
        *common,
        tmp_path / "b",
    )
    for name in ("map.pgm", "map.yaml"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_occupied_cells_stand_where_the_landmarks_truly_are(
    pelorus: Command, tmp_path: Path
) -> None:
    recording, truth = tmp_path / "drive.plr", np.array([m.p_W_m for m in known()])  # type: ignore[attr-defined]
    recording.write_bytes(encode(drive(sigma_px=0.1)))
    pelorus("map", recording, "--bin", BIN, "--set", "pixel-sigma=0.1", "--out", tmp_path)
    found = read_as_nav2_does(tmp_path / "map.yaml")
    row, column = np.nonzero(found.cells == 100)
    assert len(row) > 20
    middle = np.array(found.origin[:2]) + found.resolution * (np.stack((column, row), 1) + 0.5)
    # The replay starts at the identity, which is the drive's true start.
    nearest = np.linalg.norm(middle[:, None] - truth[None, :, :2], axis=2).min(axis=1)
    assert np.median(nearest) < 0.2


# --- what is refused ------------------------------------------------------------------------------


def refused(said: Any, folder: Path) -> str:
    """The message; and nothing stands in the folder."""
    assert not folder.exists() or not list(folder.iterdir())
    return str(said.err)


def test_a_grid_of_absurd_size_is_refused_with_a_size_that_would_do(
    pelorus: Command, write: Write, tmp_path: Path
) -> None:
    path, folder = write(result([landmark(7, AHEAD, 8)])), tmp_path / "map"
    said = refused(pelorus("map", path, "--out", folder, "--resolution", 1e-4, status=1), folder)
    assert "cells of 0.0001 m" in said
    coarser = float(said.split("--resolution ")[1].split()[0])
    grid = occupancy(sightings(path, messages_of(path)), Wish(coarser))
    assert grid.log_odds.size > 1e6  # and not needlessly coarse


def test_a_long_drive_gets_coarser_cells_rather_than_a_refusal() -> None:
    """Landmarks certain to a millimetre ask for 5 cm: over 600 m squared that is too much."""
    far = AHEAD + moved(600, 600, 0)
    messages = result([landmark(7, AHEAD, 8)])
    messages += [frame(9, [8]), pose(9, far - moved(10, 3, 0)), landmark(8, far, 9)]
    grid = drawn(messages, resolution_m=None)
    assert drawn(result([landmark(7, AHEAD, 8)]), resolution_m=None).resolution_m == 0.05
    assert grid.resolution_m == 0.2
    assert grid.landmarks == 2


def test_a_result_without_landmarks_is_refused(
    pelorus: Command, write: Write, tmp_path: Path
) -> None:
    folder = tmp_path / "map"
    said = refused(pelorus("map", write(result([])), "--out", folder, status=1), folder)
    assert "holds no landmark of a filter" in said
    path = tmp_path / "drive.plr"
    path.write_bytes(encode(drive(3)))
    dead = ("--bin", BIN, "--set", "mode=dead_reckoning")
    said = refused(pelorus("map", path, "--out", folder, *dead, status=1), folder)
    assert "dead reckoning" in said


def test_landmarks_outside_of_the_band_are_named_as_the_reason(
    pelorus: Command, write: Write, tmp_path: Path
) -> None:
    path, folder = write(result([landmark(7, AHEAD, 8)])), tmp_path / "map"
    said = refused(pelorus("map", path, "--out", folder, "--height", 30, 40, status=1), folder)
    assert "outside 30 to 40 m" in said


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--resolution", -1), "no side of a cell"),
        (("--resolution", "nan"), "no side of a cell"),
        (("--range", 0), "no distance"),
        (("--height", 3, -1), "no band"),
    ],
)
def test_senseless_options_are_refused(
    pelorus: Command, write: Write, tmp_path: Path, options: tuple[Any, ...], word: str
) -> None:
    folder = tmp_path / "map"
    path = write(result([landmark(7, AHEAD, 8)]))
    said = pelorus("map", path, "--out", folder, *options, status=2)
    assert word in " ".join(said.err.split())
    assert not folder.exists()


def test_settings_for_a_result_are_refused(pelorus: Command, write: Write, tmp_path: Path) -> None:
    path, folder = write(result([landmark(7, AHEAD, 8)])), tmp_path / "map"
    said = refused(pelorus("map", path, "--out", folder, "--set", "bias=on", status=1), folder)
    assert "a filter's result already" in said


def test_a_folder_that_cannot_be_is_told_and_a_failed_picture_leaves_nothing(
    pelorus: Command, write: Write, tmp_path: Path
) -> None:
    path = write(result([landmark(7, AHEAD, 8)]))
    blocked = tmp_path / "file"
    blocked.write_text("")
    said = pelorus("map", path, "--out", blocked, status=1)
    assert "cannot be written" in said.err

    def fails(path: Path) -> None:
        raise PelorusError(f"{path}: disk full")

    folder = tmp_path / "map"
    with pytest.raises(PelorusError, match="disk full"):
        files.write(folder, drawn(messages_of(path)), fails)
    assert not list(folder.iterdir())


# --- real drives ----------------------------------------------------------------------------------


def test_all_landmarks_of_Starry_Night_stand_in_its_map_and_nothing_else(
    pelorus: Command, real: Callable[[str], Path], tmp_path: Path
) -> None:
    recording = tmp_path / "starry.plr"
    source = real("starry-night/dataset3.mat")
    pelorus("convert", "starry-night", source, recording)
    config = Path(__file__).parents[2] / "tools" / "config" / "starry-night.conf"
    options = ("--config", config, "--set", "pixel-sigma=5")  # at 2 px two of them begin anew
    pelorus("map", recording, *options, "--bin", BIN, "--out", tmp_path / "map")
    found = read_as_nav2_does(tmp_path / "map" / "map.yaml")
    true = [m for m in messages_of(recording) if isinstance(m, Landmark)]
    assert np.sum(found.cells == 100) == len(true) == 20
    row, column = np.nonzero(found.cells == 100)
    middle = np.array(found.origin[:2]) + found.resolution * (np.stack((column, row), 1) + 0.5)
    for point in true:  # seen from above: the landmarks lie on the floor
        assert np.linalg.norm(middle - point.p_W_m[:2], axis=1).min() < 0.25
