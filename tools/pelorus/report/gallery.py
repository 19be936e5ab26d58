# SPDX-License-Identifier: MIT
"""Which pictures a report has, and what stands under them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from matplotlib.figure import Figure

from pelorus.grid import picture
from pelorus.grid.files import heights
from pelorus.report import bands, curves, hero, top_view
from pelorus.report.comparison import Comparison
from pelorus.report.style import RHO, THETA

CURVE_MIN = 2


NAMES = (
    *("top-view", "error-body", "error-world", "error-course", "nees", "covariance", "bias"),
    *("observations", "time", "map", "hero"),
)


class Picture(NamedTuple):
    """A file `name`.png; without a caption it does not stand on the page."""

    name: str
    title: str
    caption: str
    draw: Callable[[], Figure]


def pictures(compared: Comparison) -> list[Picture]:
    """In the page's order; what needs a truth or a bias is left out without one, and a curve
    needs two frames.
    """
    out = [_top_view(compared), *_map(compared)]
    if len(compared.main.frames.t_ns) < CURVE_MIN:
        return out
    truths = [len(accuracy.t_ns) for accuracy in compared.accuracy.values()]
    judged = min(truths, default=0) >= CURVE_MIN
    if judged:
        runs = [compared.run(name) for name in ("body", "world", "course")]
        out += [_errors(compared, run.name) for run in runs if not run.poses_given]
        out.append(_nees(compared))
    out.append(_covariance(compared))
    if compared.main.summary["bias"] == "on":
        out.append(_biases(compared))
    out += [_observations(compared), _times(compared)]
    if judged and not compared.main.poses_given:
        out.append(Picture("hero", "", "", partial(hero.draw, compared)))
    return out


def _top_view(compared: Comparison) -> Picture:
    seen = top_view.view(compared)
    words = f"Seen {seen.plane.why}." if seen.plane.why.startswith("from") else (
        f"Seen in {seen.plane.why}, for the recording does not say which way is up."
    )  # fmt: skip
    if seen.uncertain:
        words += f" {seen.uncertain} landmarks of body are too uncertain to be drawn."
    if seen.truth is not None:
        words += " The truth is brought to the estimate's start."
    return Picture("top-view", "Trajectories", words, partial(top_view.draw, compared))


def _map(compared: Comparison) -> list[Picture]:
    grid = compared.grid
    if grid is None:
        return []
    words = (
        f"Cells of {grid.resolution_m:g} m, {heights(grid.band)}, from the rays between the camera "
        "and the landmarks of body, weighted by the landmarks' covariance. `pelorus map` draws it "
        "with other settings, and writes it for nav2's map_server."
    )
    title = f"{compared.subject.title}: {grid.plane.why}"
    return [Picture("map", "Free and occupied", words, partial(picture.draw, grid, title))]


def _errors(compared: Comparison, name: str) -> Picture:
    return Picture(
        f"error-{name}",
        f"Error of {name}",
        f"e = ({RHO}, {THETA}) = Log(T⁻¹ A T_true) in body axes, A bringing the truth to the "
        "estimate's "
        "start, within three standard deviations of the filter's own covariance. An honest filter "
        "stays inside.",
        partial(bands.draw, compared, name),
    )


def _nees(compared: Comparison) -> Picture:
    return Picture(
        "nees",
        "Consistency",
        "Normalised estimation error squared, a degree of freedom: 1 on average for an honest "
        "filter, above it for one that believes more than it knows. The band holds 95 % of a "
        "consistent filter's frames.",
        partial(curves.nees, compared),
    )


def _covariance(compared: Comparison) -> Picture:
    return Picture(
        "covariance",
        "Trace of the covariance",
        "Above, of the state as it is: pose and the landmarks in its slots, more of them at one "
        "time than at another. In the middle, of the whole map, the course's figure 2, for "
        f"the course's filter: all {compared.whole_map.ids} landmarks of the recording, those not "
        "seen yet at their prior of 6 m², those that have left with the covariance with which they "
        "left. The models count landmarks in different units (world in metres, body in angles and "
        "inverse range), so compare the runs below, where it is the position alone.",
        partial(curves.covariance, compared),
    )


def _biases(compared: Comparison) -> Picture:
    return Picture(
        "bias",
        "Biases",
        "The biases of the twist as body estimates them.",
        partial(curves.biases, compared),
    )


def _observations(compared: Comparison) -> Picture:
    return Picture(
        "observations",
        "Observations",
        "What became of a frame's observations: used in the update, rejected by the gate, or the "
        "first of a new landmark; below, the landmarks that the state holds.",
        partial(curves.observations, compared),
    )


def _times(compared: Comparison) -> Picture:
    return Picture(
        "time",
        "Time a frame",
        "Predict, gate, update, retract, on this machine and with all that runs beside it.",
        partial(curves.times, compared),
    )
