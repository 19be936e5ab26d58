# SPDX-License-Identifier: MIT
"""The pictures of `pelorus report`: plane, limits, axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from imu_drives import noisy
from pelorus.commands.report import DRAWINGS
from pelorus.evaluate.frame_table import write_csv
from pelorus.grid import plane
from pelorus.math.se3 import Poses
from pelorus.native.replay import Programs
from pelorus.program import style
from pelorus.report import pictures
from pelorus.report.curves import Curves
from pelorus.wire.frames import BodyAxes
from replay_drive import drive, known
from report_runs import built_programs, compared, recorded


@pytest.fixture
def programs() -> Programs:
    return built_programs()


def turned(axes: str) -> Poses:
    """At rest, with the body's z along the named axis of the world; `-` turns it round."""
    z = np.zeros(3)
    z["xyz".index(axes[-1])] = -1 if axes.startswith("-") else 1
    x = np.roll(z, 1)
    R = np.stack((x, np.cross(z, x), z), axis=-1)
    return Poses(np.tile(R, (5, 1, 1)), np.zeros((5, 3)))


@pytest.mark.parametrize("towards", ["x", "y", "z", "-x", "-y", "-z"])
@pytest.mark.parametrize("axes", [BodyAxes.FORWARD_LEFT_UP, BodyAxes.FORWARD_RIGHT_DOWN])
def test_the_viewer_stands_above_the_body(axes: BodyAxes, towards: str) -> None:
    poses = turned(towards)
    chosen = plane.choose(axes, poses)
    right, up = (axis.sign * np.eye(3)[axis.number] for axis in chosen[:2])
    above = poses.R[0][:, 2] * (1 if axes == BodyAxes.FORWARD_LEFT_UP else -1)
    assert np.cross(right, up).tolist() == above.tolist()


def test_car_axes_are_shown_as_usual() -> None:
    upright = Poses(np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)))
    up = plane.choose(BodyAxes.FORWARD_LEFT_UP, upright)
    down = plane.choose(BodyAxes.FORWARD_RIGHT_DOWN, upright)
    assert (up.right.label, up.up.label) == ("x (m)", "y (m)")
    assert (down.right.label, down.up.label) == ("x (m)", "-y (m)")


def test_other_bodies_are_shown_in_the_plane_of_largest_extent() -> None:
    p = np.array([[0.0, 0, 0], [3, 0.1, 9], [-3, 0.2, 4]])
    chosen = plane.choose(BodyAxes.OTHER, Poses(np.tile(np.eye(3), (3, 1, 1)), p))
    assert (chosen.right.label, chosen.up.label) == ("x (m)", "z (m)")
    assert "x-z" in chosen.why


def test_a_run_that_strays_does_not_blow_up_the_picture(tmp_path: Path, programs: Programs) -> None:
    found = compared(recorded(tmp_path, drive()), programs)
    calm = pictures.view(found)
    course = found.run("course")
    course.trajectory.poses.p[-1] += 1e6
    wild = pictures.view(found)
    assert wild.box.side < 3 * calm.box.side
    for path in (wild.paths["yours"], wild.truth):
        assert path is not None
        assert (path >= wild.box.low).all()
        assert (path <= wild.box.high).all()


def test_a_shaped_box_holds_the_old_one_and_has_the_shape() -> None:
    box = pictures.Box(np.array([1.0, 2.0]), np.array([4.0, 3.0]))
    for ratio in (0.2, 1.0, 3.0, 7.0):
        shaped = box.shaped(ratio)
        width, height = shaped.high - shaped.low
        assert width / height == pytest.approx(ratio)
        assert (shaped.low <= box.low + 1e-12).all()
        assert (shaped.high >= box.high - 1e-12).all()


def test_equal_metres_are_equal_pixels(tmp_path: Path, programs: Programs) -> None:
    figure = pictures.top_view(compared(recorded(tmp_path, drive() + known()), programs))
    axes = figure.axes[0]
    figure.draw_without_rendering()
    origin, there = axes.transData.transform([[0, 0], [1, 1]])
    across, up = there - origin
    assert across == pytest.approx(up)
    width, height = axes.get_position().size * figure.get_size_inches()
    assert width == pytest.approx(pictures.PANEL_IN)  # the equal aspect has not shrunk the panel
    assert height >= pictures.PANEL_HEIGHT_IN[0] - 1e-9


def test_every_picture_has_labelled_axes(tmp_path: Path, programs: Programs) -> None:
    found = compared(recorded(tmp_path, drive()), programs, "--bias", "on")
    for picture in pictures.pictures(found):
        figure = picture.draw()
        labels = [axes.get_xlabel() for axes in figure.axes if axes.get_xlabel()]
        labels += [axes.get_ylabel() for axes in figure.axes if axes.get_ylabel()]
        assert len(labels) >= 2, picture.name
        for label in labels:
            assert "(" in label, f"{picture.name}: {label} has no unit"
    assert {picture.name for picture in pictures.pictures(found)} == set(DRAWINGS)


def test_limits_show_every_error_and_as_much_of_the_band_as_lets_it_be_seen() -> None:
    assert pictures.limits(np.array([0.0, -2.0]), np.array([1.0, 1.0])) == pytest.approx(
        (-2.2, 2.2)
    )
    wide = pictures.limits(np.array([0.01]), np.array([1e6]))
    assert wide[1] == pytest.approx(0.01 * pictures.BAND_MAX * pictures.HEADROOM)
    assert pictures.limits(np.zeros(3), np.zeros(3)) == (-1.0, 1.0)


def test_a_logarithmic_axis_ignores_the_few_smallest_values() -> None:
    axes = style.new_figure(4, 3).subplots()
    axes.plot(np.concatenate(([1e-30], np.full(200, 5.0))))
    style.limit_decades(axes)
    assert axes.get_ylim()[0] == pytest.approx(2.5)


def test_the_biases_of_an_imu_have_its_names_and_their_truth(
    tmp_path: Path, programs: Programs
) -> None:
    recording = tmp_path / "imu.plr"
    noisy().recording.write(recording)
    found = compared(recording, programs, also=())
    charts = {chart["title"]: chart for chart in Curves(found.main.messages).json()["charts"]}
    lines = {line["name"]: line for line in charts["Gyro bias"]["lines"]}
    assert set(lines) == {"x", "y", "z", "largest sigma", "x true", "y true", "z true"}
    assert charts["Accelerometer bias"]["unit"] == "m/s²"
    truth = noisy().recording.truth_bias
    assert truth is not None
    assert lines["y true"]["low"] >= truth[:, 4].min() - 1e-9
    assert lines["y true"]["low"] + 65534 * lines["y true"]["step"] <= truth[:, 4].max() + 1e-9
    write_csv(tmp_path / "frames.csv", found.main.frames)
    titles = (tmp_path / "frames.csv").read_text().partition("\n")[0].split(",")
    assert {"bias_ax", "var_bias_az", "bias_wx", "new"} <= set(titles)
    assert "bias_vx" not in titles
