# SPDX-License-Identifier: MIT
"""Places on the earth become local metres: held against the ellipsoid's own formulas."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bags import NS, Recorder
from converted import SHORT, Run, messages_of
from drives import clean
from numpy.typing import NDArray
from pelorus.converters import earth_start
from pelorus.converters.columns import Columns
from pelorus.converters.csv import truth_of
from pelorus.converters.geodetic import Ground
from pelorus.errors import PelorusError
from pelorus.io.recording import Recording
from pelorus.math.se3 import Poses
from pelorus.wire.frames import BodyAxes, Reading
from replay_drive import run
from scipy.spatial.transform import Rotation
from test_convert_csv import csv_files
from test_convert_ros import written
from test_ros_frames import NAMES, links
from test_ros_world import odometry, of_cameras, on_body, with_tracks

Floats = NDArray[np.float64]
A, F = 6378137.0, 1 / 298.257223563  # WGS 84
E2 = F * (2 - F)


def centred(lat: Floats, lon: Floats, h: Floats) -> Floats:
    """Geocentric, m, of degrees."""
    f, g = np.radians(lat), np.radians(lon)
    n = A / np.sqrt(1 - E2 * np.sin(f) ** 2)
    across = (n + h) * np.cos(f)
    up = (n * (1 - E2) + h) * np.sin(f)
    return np.stack((across * np.cos(g), across * np.sin(g), up), axis=-1)


def east_north_up(lat: Floats, lon: Floats, h: Floats) -> Floats:
    """Returns metres east, north and up of the first place."""
    f, g = np.radians(lat[0]), np.radians(lon[0])
    axes = [
        [-np.sin(g), np.cos(g), 0],
        [-np.sin(f) * np.cos(g), -np.sin(f) * np.sin(g), np.cos(f)],
        [np.cos(f) * np.cos(g), np.cos(f) * np.sin(g), np.sin(f)],
    ]
    x = centred(lat, lon, h)
    return np.asarray((x - x[0]) @ np.array(axes).T)


def meridian_m(lat: float) -> float:
    """Returns the distance from the equator, by Simpson's rule."""
    f = np.linspace(0, np.radians(lat), 20001)
    own = A * (1 - E2) / (1 - E2 * np.sin(f) ** 2) ** 1.5
    weights = np.ones(len(f))
    weights[1:-1:2], weights[2:-1:2] = 4, 2
    return float((weights * own).sum() * (f[1] - f[0]) / 3)


@pytest.mark.parametrize("at", [(48.137, 11.575, 520.0), (-33.9, 151.2, 12.0), (0.01, -78.5, 2850)])
def test_degrees_become_metres_east_north_and_up(at: tuple[float, float, float]) -> None:
    chance = np.random.default_rng(1)
    lat, lon = at[0] + chance.uniform(-5e-3, 5e-3, 50), at[1] + chance.uniform(-5e-3, 5e-3, 50)
    h, remarks = at[2] + chance.uniform(-30, 30, 50), list[str]()
    found = Ground().local(Path("x"), np.column_stack((lon, lat, h)), remarks)
    assert np.abs(found - east_north_up(lat, lon, h)).max() < 1e-3
    assert "places in WGS 84 become metres east, north and up of the first one" in remarks[0]


def test_utm_is_turned_into_true_north_and_true_metres() -> None:
    """On the middle meridian of zone 32, 9 degrees east: its northing is 0.9996 of the arc."""
    lat = np.linspace(48.0, 48.05, 20)
    grid = np.column_stack(
        (np.full(20, 500_000.0), [0.9996 * meridian_m(f) for f in lat], np.full(20, 400.0))
    )
    found = Ground("EPSG:32632").local(Path("x"), grid, [])
    assert np.abs(found - east_north_up(lat, np.full(20, 9.0), np.full(20, 400.0))).max() < 2e-3


def test_a_truth_and_positions_of_the_earth_share_an_origin(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(**SHORT)
    csv_files(tmp_path, drive)
    t = drive.twist_t_ns[::5]
    chance = np.random.default_rng(2)
    lat, lon = 47 + chance.uniform(0, 1e-3, len(t)), 8.5 + chance.uniform(0, 1e-3, len(t))
    h = 440 + chance.uniform(0, 3, len(t))
    local = east_north_up(lat, lon, h)
    rows = [f"{int(a)},{b:.10f},{c:.10f},{d:.5f},0,0,0,1" for a, b, c, d in zip(t, lat, lon, h)]  # noqa: B905
    (tmp_path / "true.csv").write_text(
        "\n".join(["t_ns,latitude,longitude,alt_m,qx,qy,qz,qw", *rows, ""])
    )
    rows = [f"{int(a)},{b * 1e7:.3f},{c * 1e7:.3f},1.5" for a, b, c in zip(t, lat, lon)][3:]  # noqa: B905
    (tmp_path / "gnss.csv").write_text("\n".join(["t_ns,lat_e7,lon_e7,sigma_m", *rows, ""]))
    target, f = tmp_path / "out.plr", tmp_path
    said = pelorus(
        *("convert", "csv", "--twists", f / "twists.csv", "--stereo", f / "stereo.csv"),
        *("--calibration", f / "camera.json", "--truth", f / "true.csv"),
        *("--position", f / "gnss.csv", "--fix", "none", target),
        *("--columns", "truth.lat=latitude:deg,truth.lon=longitude:deg"),
        *("--columns", "position.lat=lat_e7,position.lon=lon_e7"),
    ).out
    assert said.count("places in WGS 84 become metres east, north and up of the first one") == 2
    readings = messages_of(target, Reading)
    assert np.abs(np.array([m.value[:2] for m in readings]) - local[3:, :2]).max() < 0.02
    assert {m.axes for m in readings} == {3}, "a height that is not there is not measured"
    named = Columns.of(["lat=latitude:deg", "lon=longitude:deg"])
    assert np.abs(truth_of(f / "true.csv", named).poses.p - local).max() < 1e-3


def test_a_grid_that_nobody_named_and_places_that_are_none_are_told(tmp_path: Path) -> None:
    def said(head: str, rows: list[str], crs: str = "") -> str:
        path = tmp_path / "true.csv"
        path.write_text("\n".join([head + ",qx,qy,qz,qw", *(row + ",0,0,0,1" for row in rows), ""]))
        with pytest.raises(PelorusError) as caught:
            truth_of(path, Columns.of([], crs))
        return str(caught.value)

    utm = ["0,500000,5300000,400", "1,500001,5300000,400"]
    head = "t_s,easting_m,northing_m,alt_m"
    assert "in which grid?; --crs EPSG:326NN is expected" in said(head, utm)
    assert "--crs EPSG:99: is not known" in said(head, utm, "EPSG:99")
    assert "has easting_m and northing_m, and --crs is EPSG:4258" in said(head, utm, "EPSG:4258")
    far = ["0,47,8,400", "1,0.0,0.0,400"]
    assert "km from the first one; at most 100 km are expected: is there a row without" in said(
        "t_s,lat_deg,lon_deg,alt_m", far
    )
    assert "is no place in WGS 84" in said(
        "t_s,lat_deg,lon_deg,alt_m", ["0,470,8,400", "1,47,8,400"]
    )


def test_fixes_of_a_bag_become_positions_of_the_antenna(tmp_path: Path, pelorus: Run) -> None:
    drive = clean(**SHORT)
    recorder = odometry(
        with_tracks(Recorder(), drive, "left_optical"), drive, drive.v_B_mps, drive.w_B_radps
    )
    t = drive.twist_t_ns[::4] + NS
    lat, lon, h = (
        52 + 1e-6 * np.arange(len(t)),
        13 + 2e-6 * np.arange(len(t)),
        np.full(len(t), 40.0),
    )
    for k, at in enumerate(zip(lat, lon, h, strict=True)):
        lost = k in (2, 3)
        place = (np.nan,) * 3 if lost else at
        recorder.fix("/fix", int(t[k]), place, 0.7, -1 if lost else 0, "gnss")
    antenna = Poses(np.eye(3), np.array([-0.4, 0.1, 1.3]))
    both = links(drive, NAMES) | {("base_link", "gnss"): antenna}
    recorder.transforms("/tf_static", NS, both)
    target, bag = tmp_path / "out.plr", written(recorder, tmp_path, "mcap")
    words = (*of_cameras(tmp_path, drive), "--position-topic", "/fix")
    said = pelorus("convert", "ros", bag, target, *words).out
    assert "/fix: 2 of" in said
    assert "the antenna sits as /tf_static says: gnss - base_link" in said
    readings = messages_of(target, Reading)
    kept = [k for k in range(len(t)) if k not in (2, 3)]
    due = east_north_up(*(np.asarray(x[kept], np.float64) for x in (lat, lon, h)))
    assert np.abs(np.array([m.value for m in readings]) - due).max() < 1e-3
    assert np.allclose([m.sigma for m in readings], 0.7)
    assert np.allclose([m.at_B_m for m in readings], antenna.p)
    recorder = odometry(with_tracks(Recorder(), drive), drive, drive.v_B_mps, drive.w_B_radps)
    recorder.fix("/fix", int(t[0]), (52, 13, 40))
    bag = written(recorder, tmp_path / "plain", "mcap")
    words = (*on_body(tmp_path, drive), "--position-topic", "/fix")
    said = pelorus("convert", "ros", bag, target, *words, status=1).err
    assert "/fix: messages tell no covariance; --position-sigma M is expected" in said
    pelorus("convert", "ros", bag, target, *words, "--position-sigma", "2.5")


# --- the start ------------------------------------------------------------------------------------


def on_earth(drive: Recording, yaw: float, sigma_m: float, F: Floats) -> tuple[Recording, Poses]:
    """The drive of a body with axes turned by F, its truth turned by yaw and moved; positions."""
    turn = Rotation.from_euler("z", yaw).as_matrix()
    truth = Poses(turn @ drive.truth.R @ F, drive.truth.p @ turn.T + [40.0, -7.0, 3.0])
    chance, arm = np.random.default_rng(4), np.array([0.3, -0.2, 0.9])
    places = truth.p + truth.R @ arm + sigma_m * chance.standard_normal(truth.p.shape)
    readings = [
        Reading(t, 3, 7, place, np.full(3, sigma_m), arm)
        for t, place in zip(drive.truth_t_ns.tolist(), places, strict=True)
    ]
    T = drive.T_CB
    made = replace(
        drive,
        v_B_mps=drive.v_B_mps @ F,
        w_B_radps=drive.w_B_radps @ F,
        truth=truth,
        readings=readings[::3],
    )
    axes = BodyAxes.FORWARD_LEFT_UP if F[1, 1] > 0 else BodyAxes.FORWARD_RIGHT_DOWN
    return made.with_extrinsic(Poses(T.R @ F, T.p)).with_header(body_axes=axes), truth


@pytest.mark.parametrize("yaw", [0.3, -2.8, 1.9])
@pytest.mark.parametrize("F", [np.eye(3), np.diag([1.0, -1.0, -1.0])])
def test_the_heading_at_the_start_is_found_by_the_way_and_the_filter_takes_positions(
    yaw: float, F: Floats, tmp_path: Path
) -> None:
    drive, truth = on_earth(clean(seed=5, duration_s=40.0), yaw, 0.4, F)
    made, finding = earth_start.started(replace(drive, truth_t_ns=drive.truth_t_ns[:0]))
    assert finding.is_conclusive
    assert made.start is not None
    off = truth.R[0].T @ made.start.R_WB
    assert np.linalg.norm(Rotation.from_matrix(off).as_rotvec()) < 0.1
    assert np.linalg.norm(made.start.p_WB_m - truth.p[0]) < 0.6
    path = tmp_path / "d.plr"
    replace(made, truth_t_ns=drive.truth_t_ns[:0], truth=truth.at(slice(0, 0))).write(path)
    summary = run(path, "--json").summary
    assert summary["readings_used"] > 0.95 * len(made.readings)


def test_a_heading_that_the_way_does_not_tell_is_said() -> None:
    drive, _ = on_earth(clean(**SHORT), 1.0, 50.0, np.eye(3))
    made, finding = earth_start.started(drive)
    assert made.start is None
    assert not finding.is_conclusive
    assert "the way is too short: it is known to" in finding.evidence
