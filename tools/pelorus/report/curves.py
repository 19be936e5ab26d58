# SPDX-License-Identifier: MIT
"""The data that the page draws of one log.

They are curves over time, health with its reasons, path and map, the history of each landmark, and
the evidence. Curves are whole. Landmarks and rejections may be too many for a page: the oldest and
least seen are left out, and `left_out` says how many.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy

from pelorus.evaluate.evaluation import Accuracy, accuracy_of
from pelorus.evaluate.frame_table import FrameTable, frame_table
from pelorus.evaluate.health import GOOD, NOT_STARTED, SHORT
from pelorus.grid.plane import AXES, choose
from pelorus.io.trajectory import POSE_SIZE, Trajectory, estimate_in
from pelorus.math.ellipsoids import ellipsoids
from pelorus.math.motion import Times, nearest
from pelorus.report.landmarks import WHY, landmarks_json, packed
from pelorus.report.packed import Packer
from pelorus.wire import schema
from pelorus.wire.evidence import Evidence
from pelorus.wire.frames import Message, Truth, TruthKnows
from pelorus.wire.framing import header_of_messages
from pelorus.wire.layout import Floats, stacked

SIGMAS = 3.0
BAND = 0.95
FRAMES_MOST = 150_000  # two hours at 20 Hz
BESIDE = "beside"  # the suffix of another log's curves
NO_HEALTH = 255
NOTHING = "Nothing to draw: in no frame of this log is it known and not zero."
TURNS = ("roll", "pitch", "yaw")
SHAPES = 200  # ellipsoids along the path
INSIDE = (
    "In body axes, first poses aligned, and three sigma of the filter's own covariance: an honest "
    "filter stays inside."
)
RHO_THETA = tuple(f"var_{part}_{axis}" for part in ("rho", "theta") for axis in AXES)


class Other(NamedTuple):
    """Another run over the same recording, for comparison."""

    trajectory: Trajectory
    accuracy: Accuracy | None


class Curves:
    """Builds the page's data: JSON that refers to columns in a Packer."""

    def __init__(
        self,
        messages: Sequence[Message],
        truth: Trajectory | None = None,
        others: Mapping[str, Other] | None = None,
        beside: Curves | None = None,
    ) -> None:
        """Takes a log; each curve of another log, `beside`, is drawn with its counterpart."""
        self.packer = Packer()
        self.left_out: list[str] = []
        self._others = others or {}
        self._beside = beside
        self.messages = messages
        self._frames = self._thinned(frame_table(messages))
        self._t = self._seconds(self._frames.t_ns)
        self._found = estimate_in(messages)
        self.accuracy = accuracy_of(messages, truth)

    @property
    def origin_ns(self) -> int:
        return int(self._frames.t_ns[0])

    def _thinned(self, frames: FrameTable) -> FrameTable:
        """Returns every nth frame where a browser cannot hold all, with those that were not
        good.
        """
        count = len(frames.t_ns)
        if count <= FRAMES_MOST:
            return frames
        every = -(-2 * count // FRAMES_MOST)
        kept = np.arange(count) % every == 0
        trouble = np.flatnonzero((frames["health"] != GOOD) | (frames["status"] != 0))
        kept[trouble[: FRAMES_MOST // 2]] = True
        self.left_out.append(
            f"{count - np.count_nonzero(kept)} of {count} frames, all but every {every}th and the "
            "first that were not good"
        )
        columns = {name: values[kept] for name, values in frames.columns.items()}
        return FrameTable(frames.t_ns[kept], columns, frames.by_imu)

    def _seconds(self, t_ns: Times) -> Floats:
        """Returns times since the first frame, s; a clock that went back stands still."""
        return np.asarray(np.maximum.accumulate((t_ns - self.origin_ns) * 1e-9))

    def json(self) -> dict[str, Any]:
        """Returns the data without the columns."""
        return {
            "t": self.packer.add_exactly(np.round(self._t * 1e3), "u4"),  # ms
            "health": self.packer.add_exactly(_shown_health(self._frames), "u1"),
            "reasons": self.packer.add_exactly(self._frames.reasons, "u4"),
            "status": self.packer.add_exactly(self._frames["status"] + 128, "u1"),
            **self._health_beside(),
            "words": _words(),
            "charts": [self._packed(chart) for chart in self._charts()],
            "map": self._map(),
            "landmarks": landmarks_json(
                self.messages,
                self.origin_ns,
                self._found and self._found[0],
                self.packer,
                self.left_out,
            ),
        }

    def _health_beside(self) -> dict[str, Any]:
        if self._beside is None:
            return {}
        there = self._at_own(self._beside, _shown_health(self._beside._frames))
        known = np.where(np.isnan(there), NO_HEALTH, there)
        return {"health_beside": self.packer.add_exactly(known, "u1")}

    # --- curves -----------------------------------------------------------------------------------

    def _charts(self) -> Iterator[dict[str, Any]]:
        yield from self._errors()
        yield from self._motion()
        yield self._innovations()
        yield from self._biases()
        yield from self._observations()
        yield self._timing()
        yield from self._evidence()

    def _chart(
        self, title: str, unit: str, about: str, lines: Sequence[tuple[str, Floats]], **more: Any
    ) -> dict[str, Any]:
        return {"title": title, "unit": unit, "about": about, "lines": list(lines), **more}

    def _packed(self, chart: dict[str, Any]) -> dict[str, Any]:
        least = 0.0 if chart.get("log") else -np.inf  # a logarithm shows only positive values
        if not any((np.nan_to_num(x, nan=-np.inf) > least).any() for _, x in chart["lines"]):
            return chart | {"lines": [], "empty": chart.get("empty", NOTHING)}
        chart.pop("empty", None)
        columns = [{"name": name, **self.packer.add(values)} for name, values in chart["lines"]]
        if self._beside is not None:
            for like, (line, values) in self._beside.lines(chart):
                there = {"name": f"{line}, {BESIDE}", "like": like}
                columns.append(there | self.packer.add(self._at_own(self._beside, values)))
        return chart | {"lines": columns}

    def lines(self, like: Mapping[str, Any]) -> Iterator[tuple[int, tuple[str, Floats]]]:
        """Yields the curves of the chart of the same title, with the numbers of their counterparts.

        Bands are left out.
        """
        names = [name for name, _ in like["lines"]]
        for chart in self._own_charts:
            if chart["title"] == like["title"]:
                for k, line in enumerate(chart["lines"]):
                    if k not in chart.get("band", ()) and line[0] in names:
                        yield names.index(line[0]), line

    @cached_property
    def _own_charts(self) -> list[dict[str, Any]]:
        return list(self._charts())

    def _at_own(self, other: Curves, values: Floats) -> Floats:
        """Returns another log's values at this one's frames: by stamps, else by time since the
        first frame.
        """
        same = np.isin(self._frames.t_ns, other._frames.t_ns).mean() > 0.5
        offset_ns = other.origin_ns - self.origin_ns if same else 0
        mine, theirs = (np.round(x * 1e9).astype(np.int64) for x in (self._t, other._t))
        theirs += offset_ns
        at = nearest(theirs, mine)
        reach = np.median(np.diff(mine)) / 2 if len(mine) > 1 else 0.0
        return np.where(np.abs(theirs[at] - mine) <= reach, values[at], np.nan)

    def _errors(self) -> Iterator[dict[str, Any]]:
        sigma = np.sqrt(self._frames.stack(*RHO_THETA))
        accuracy = self.accuracy
        if accuracy is None:
            p, r = (SIGMAS * np.linalg.norm(sigma[:, part], axis=1) for part in _PARTS)
            about = "Three sigma of the filter's own covariance, all axes; the log has no truth."
            yield self._chart("Position uncertainty", "m", about, [("3 sigma", p)])
            about = "The same of the rotation."
            yield self._chart("Rotation uncertainty", "deg", about, [("3 sigma", np.degrees(r))])
            return
        error = self._spread(accuracy.t_ns, accuracy.error)
        for k, axis in enumerate(AXES):
            about = "" if k else INSIDE
            band = SIGMAS * sigma[:, k]
            lines = [("error", error[:, k]), ("- 3 sigma", -band), ("+ 3 sigma", band)]
            yield self._chart(f"Position error, {axis}", "m", about, lines, band=[1, 2])
        turn = np.degrees(np.linalg.norm(error[:, 3:], axis=1))
        bound = np.degrees(SIGMAS * np.linalg.norm(sigma[:, 3:], axis=1))
        about = "Angle of the rotation between estimate and truth, and three sigma of it."
        lines = [("error", turn), ("3 sigma", bound)]
        yield self._chart("Rotation error", "deg", about, lines)
        low, high = np.array(scipy.stats.chi2.interval(BAND, POSE_SIZE)) / POSE_SIZE
        about = (
            "Normalised estimation error squared, per degree of freedom: 1 on average for an "
            "honest filter; 95 % of its frames are in the band."
        )
        nees = self._spread(accuracy.t_ns, accuracy.nees[:, None])[:, 0]
        own = [("NEES", nees)]
        lines = own + [(name, x[:, 0]) for name, x in self._of_others(lambda a: a.nees[:, None])]
        yield self._chart("NEES / 6", "", about, lines, log=True, levels=[low, high])
        if self._others:
            here = np.linalg.norm(error[:, :3], axis=1)
            there = self._of_others(lambda a: np.linalg.norm(a.error[:, :3], axis=1)[:, None])
            lines = [("this", here), *((name, x[:, 0]) for name, x in there)]
            about = "Distance from the truth, first poses aligned."
            yield self._chart("Position error of each run", "m", about, lines)

    def _of_others(self, values: Callable[[Accuracy], Floats]) -> list[tuple[str, Floats]]:
        return [
            (name, self._spread(other.accuracy.t_ns, values(other.accuracy)))
            for name, other in self._others.items()
            if other.accuracy is not None
        ]

    def _spread(self, t_ns: Times, values: Floats) -> Floats:
        """Returns the values at all frames: NaN where there is no truth."""
        out = np.full((len(self._frames.t_ns), values.shape[1]), np.nan)
        order = np.argsort(t_ns, kind="stable")
        at = np.searchsorted(t_ns[order], self._frames.t_ns)
        at = np.minimum(at, len(t_ns) - 1)
        same = t_ns[order][at] == self._frames.t_ns
        out[same] = values[order[at[same]]]
        return out

    def _motion(self) -> Iterator[dict[str, Any]]:
        """Yields the charts of velocity and attitude, with the truth where there is one."""
        frames = self._frames
        v = [(axis, frames[f"v{axis}_mps"]) for axis in AXES]
        yield self._chart("Velocity", "m/s", "Of the body, along its own axes.", v)
        lines = list(zip(TURNS, _turns_deg(frames.stack("qx", "qy", "qz", "qw")).T, strict=True))
        about = "Of the body in the world: about its x, y and z axes, the last one first."
        if self.accuracy is not None:
            true = _turns_deg(
                scipy.spatial.transform.Rotation.from_matrix(self.accuracy.truth.R).as_quat()
            )
            true = self._spread(self.accuracy.t_ns, true)
            lines += [(f"{name} true", true[:, k]) for k, name in enumerate(TURNS)]
        yield self._chart("Roll, pitch, yaw", "deg", about, lines)

    def _innovations(self) -> dict[str, Any]:
        dof = self._frames["nis_dof"]
        known = dof > 0
        safe = np.where(known, dof, 1)
        nis, low, high = (
            np.where(known, values, np.nan)
            for values in (
                self._frames["nis"] / safe,
                scipy.stats.chi2.ppf((1 - BAND) / 2, safe) / safe,
                scipy.stats.chi2.ppf((1 + BAND) / 2, safe) / safe,
            )
        )
        about = (
            "Innovations squared in their own sigmas, per degree of freedom (NIS): 1 is "
            "expected, and "
            "95 % of the frames in the band if noise is as set. Above: pixel-sigma is too small."
        )
        lines = [("NIS", nis), ("low", low), ("high", high)]
        return self._chart(
            *("Innovations", "NIS / dof", about, lines),
            band=[1, 2], levels=[1.0], empty="Nothing to draw: no frame was used."
        )  # fmt: skip

    def _biases(self) -> Iterator[dict[str, Any]]:
        frames = self._frames
        kinds = (
            (("v", "Accelerometer bias", "m/s²"), ("w", "Gyro bias", "rad/s"))
            if frames.by_imu
            else (("v", "Velocity bias", "m/s"), ("w", "Turn rate bias", "rad/s"))
        )
        for letter, title, unit in kinds:
            values = frames.stack(*(f"bias_{letter}{axis}" for axis in AXES))
            if not np.nan_to_num(values).any():
                continue  # not estimated
            variance = frames.stack(*(f"var_bias_{letter}{axis}" for axis in AXES))
            lines = [(axis, values[:, k]) for k, axis in enumerate(AXES)]
            sigma = np.sqrt(np.clip(variance, 0, None)).max(axis=1)
            lines.append(("largest sigma", sigma))
            about = "As estimated, and the largest of its sigmas."
            true = self._true_biases()["vw".index(letter)]
            if np.isfinite(true).any():
                about = "As estimated, as the recording knows it, and the largest of its sigmas."
                lines += [(f"{axis} true", true[:, k]) for k, axis in enumerate(AXES)]
            yield self._chart(title, unit, about, lines)

    def _true_biases(self) -> tuple[Floats, Floats]:
        known = [m for m in self.messages if isinstance(m, Truth) and m.knows & TruthKnows.BIAS]
        if not known:
            nothing = np.full((len(self._t), 3), np.nan)
            return nothing, nothing
        t_ns = np.array([m.t_ns for m in known], np.int64)
        true = self._spread(t_ns, stacked((m.bias for m in known), 6))
        return true[:, :3], true[:, 3:]

    def _observations(self) -> Iterator[dict[str, Any]]:
        frames = self._frames
        about = "Points in the frame, those of landmarks in the state, and those that were used."
        names = ("observations", "matched", "used")
        lines = [(name, frames[name]) for name in names]
        yield self._chart("Points", "a frame", about, lines)
        matched = frames["matched"]
        share = np.divide(
            100 * frames["gated"], matched, out=np.full(len(matched), np.nan), where=matched > 0
        )
        about = "Of the matches, by the gate. As the sigmas say it is one of a hundred."
        empty = "Nothing to draw: no point matched a landmark, so none could be rejected."
        yield self._chart("Rejected", "%", about, [("rejected", share)], levels=[1.0], empty=empty)

    def _timing(self) -> dict[str, Any]:
        ms = self._frames["update_us"] * 1e-3
        period = np.diff(self._t, prepend=np.nan) * 1e3
        lines = [("period of the frames", np.where(period > 0, period, np.nan))]
        if ms.any():
            lines.append(("computing", np.where(ms > 0, ms, np.nan)))
        about = "Time between frames, and the time that each took to compute."
        return self._chart("Timing", "ms", about, lines, log=True)

    def _evidence(self) -> Iterator[dict[str, Any]]:
        evidence = {m.t_ns: m for m in self.messages if isinstance(m, Evidence)}
        if not evidence:
            return
        rows = [evidence.get(t) for t in self._frames.t_ns.tolist()]
        statistic, weight, agreement = (
            np.array([np.nan if e is None else getattr(e, name) for e in rows])
            for name in ("statistic", "weight", "agreement")
        )
        about = (
            "Why: the sum of the differences between pictures and odometry, squared in units of "
            "what is usual on this drive: 6 on average. Above 32 the pose is doubted."
        )
        lines = [("statistic", np.maximum(statistic, 1e-2))]
        yield self._chart("Doubt", "chi-square", about, lines, log=True, levels=[32.0])
        about = "Why: by how much the odometry's sigmas are widened; 1 is as stated."
        yield self._chart("Weight", "times sigma", about, [("weight", weight)], log=True)
        nu = stacked((np.full(6, np.nan) if e is None else np.abs(e.nu) for e in rows), 6)
        lines = [
            ("translation", np.linalg.norm(nu[:, :3], axis=1)),
            ("rotation", np.linalg.norm(nu[:, 3:], axis=1)),
            ("agreement", agreement),
        ]
        about = (
            "Why: pictures less odometry in the odometry's stated sigmas, and the share of "
            "frames in which both agreed before a doubt began: it stands while that lasts."
        )
        yield self._chart("Pictures less odometry", "sigma", about, lines, log=True)

    # --- the way and the map ----------------------------------------------------------------------

    def _map(self) -> dict[str, Any]:
        if self._found is None:
            return {"tracks": [], "axes": [0, 1]}
        trajectory = self._found[0]
        plane = choose(header_of_messages(self.messages).body_axes, trajectory.poses)
        tracks = [self._track("estimate", trajectory.t_ns, trajectory.poses.p)]
        if self.accuracy is not None:
            tracks.append(self._track("truth", self.accuracy.t_ns, self.accuracy.truth.p))
        tracks += [
            self._track(name, other.trajectory.t_ns, other.trajectory.poses.p)
            for name, other in self._others.items()
        ]
        if (beside := self._beside) is not None and beside._found is not None:
            there = beside._found[0]
            tracks.append(self._track(BESIDE, there.t_ns, there.poses.p, beside._seconds))
        return {
            "tracks": tracks,
            "axes": [plane.right.number, plane.up.number],
            "signs": [plane.right.sign, plane.up.sign],
            "shapes": self._shapes(),
        }

    def _shapes(self) -> dict[str, Any]:
        """Returns position ellipsoids in the world, at some frames all along the path."""
        assert self._found is not None
        trajectory, P = self._found
        some = np.unique(np.linspace(0, len(P) - 1, min(len(P), SHAPES)).astype(int))
        some = some[np.isfinite(P[some]).all(axis=(1, 2))]
        R, p = trajectory.poses.R[some], trajectory.poses.p[some]
        shapes = ellipsoids(R @ P[some, :3, :3] @ R.transpose(0, 2, 1))
        t_ms = np.round(self._seconds(trajectory.t_ns)[some] * 1e3)
        return {
            "t": self.packer.add_exactly(t_ms, "u4"),
            "p": [self.packer.add_exactly(p[:, k], "f4") for k in range(3)],
            **packed(shapes, self.packer),
        }

    def _track(
        self, name: str, t_ns: Times, p: Floats, seconds: Callable[[Times], Floats] | None = None
    ) -> dict[str, Any]:
        some = slice(None, None, -(-len(p) // FRAMES_MOST))
        since = (seconds or self._seconds)(t_ns)[some]
        columns = [self.packer.add(p[some, k]) for k in range(3)]
        t = self.packer.add_exactly(np.round(since * 1e3), "u4")
        return {"name": name, "p": columns, "t": t}


_PARTS = (slice(0, 3), slice(3, 6))


def _shown_health(frames: FrameTable) -> Floats:
    """Returns the health; frames before the start count as good."""
    begun = np.logical_or.accumulate(frames.reasons & NOT_STARTED == 0)
    return np.where(begun, frames["health"], len(schema.HEALTHS))


def _turns_deg(quaternion: Floats) -> Floats:
    """Returns (n, 3) roll, pitch and yaw; NaN where there is none."""
    out = np.full((len(quaternion), 3), np.nan)
    known = np.isfinite(quaternion).all(axis=1)
    if known.any():
        turned = scipy.spatial.transform.Rotation.from_quat(quaternion[known]).as_euler(
            "ZYX", degrees=True
        )
        out[known] = turned[:, ::-1]
    return out


def _words() -> dict[str, Any]:
    reasons = {
        str(bit.bit_length() - 1): SHORT.get(name, schema.REASONS[bit])
        for bit, name in schema.REASON_NAMES.items()
    }
    harmless = [k for k in range(32) if schema.LIMITS["harmless_reasons"] >> k & 1]
    return {
        "health": [*schema.HEALTHS.values(), "not started"],
        "reasons": reasons,
        "harmless": harmless,
        "status": {str(k): words.partition(":")[0] for k, words in schema.STATUSES.items()},
        "why": {str(k): words for k, words in WHY.items()},
    }
