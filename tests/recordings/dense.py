# SPDX-License-Identifier: MIT
"""More points than slots: the simulator's trajectories and IMU with a denser cloud, as a front end
offers it that follows some 250 points, and filters of fewer slots.

usage: dense.py [--bin build/bin] [--only TEXT] [--seeds 8] [--slots 50,75,100] [-- REPLAY OPTIONS]

Points are laid into what the left camera sees, 5 to 7 m away, until it sees 250; one that is seen
again has its id again. The calibration is exact. The first 120 s; RMS and means over seeds: each
has its own cloud and pixels, and all have one IMU.

err0     m; ATE: m; NEES/6: 1 is expected; as `pelorus evaluate` has them
sigma    what the filter tells of the pose, RMS over the drive: rotation, degrees; position, m
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from judge import Case, conf, converted, figures, parser_of, run
from numpy.typing import NDArray
from pelorus.evaluate.evaluation import assess, by_imu
from pelorus.io.trajectory import estimate_in, filled, truth_in
from pelorus.wire.frames import End, Header, Message, Stereo, Truth
from pelorus.wire.framing import messages_of, write_file
from pelorus.wire.layout import Floats

DRIVES = ("udel_gore_zupt", "tum_corridor1")
OFFERED, SECONDS, DEPTHS_M = 250, 120.0, (5.0, 7.0)
COLUMNS = ("err0", "ATE", "NEES/6", "sigma deg", "sigma m")


class Eye:
    """The stereo pair of a HEADER along the true poses."""

    def __init__(self, header: Header, truth: dict[int, Truth]) -> None:
        self.header, self.truth = header, truth

    def pose(self, t_ns: int) -> tuple[Floats, Floats]:
        """Returns R_WC and p_WC of the left camera."""
        at = self.truth[t_ns]
        R_WC = np.asarray(at.R_WB) @ np.asarray(self.header.R_CB).T
        return R_WC, np.asarray(at.p_WB_m) - R_WC @ np.asarray(self.header.t_CB_m)

    def look(self, points_W: Floats, t_ns: int) -> tuple[Floats, NDArray[np.bool_]]:
        """Pixels (n, 4) in the order uL vL uR vR; whether left and right see them (n, 2)."""
        R, p = self.pose(t_ns)
        c = self.header.camera
        q = (points_W - p) @ R
        z = np.where(q[:, 2] > 0.1, q[:, 2], np.nan)
        u, v = c.cx_px + c.fx_px * q[:, 0] / z, c.cy_px + c.fy_px * q[:, 1] / z
        right = u - c.fx_px * c.baseline_m / z
        high = (v > 0) & (v < self.header.image_height_px)
        seen = [(x > 0) & (x < self.header.image_width_px) & high for x in (u, right)]
        return np.stack([u, v, right, v], axis=1), np.stack(seen, axis=1)

    def lay(self, count: int, t_ns: int, rng: np.random.Generator) -> Floats:
        """Returns new points in the world that the left camera sees."""
        R, p = self.pose(t_ns)
        c, size = self.header.camera, (self.header.image_width_px, self.header.image_height_px)
        u, v = rng.uniform(0, size, (count, 2)).T
        ray = np.stack([(u - c.cx_px) / c.fx_px, (v - c.cy_px) / c.fy_px, np.ones(count)], axis=1)
        points: Floats = rng.uniform(*DEPTHS_M, (count, 1)) * ray @ R.T + p
        return points


def dense(recording: Path, seed: int, out: Path) -> None:
    """Writes the recording with another cloud."""
    messages = [m for m in messages_of(recording) if not isinstance(m, End)]
    frames = [m.t_ns for m in messages if isinstance(m, Stereo)]
    frames = [t for t in frames if t <= frames[0] + SECONDS * 1e9]
    (header,) = (m for m in messages if isinstance(m, Header))
    eye = Eye(header, {m.t_ns: m for m in messages if isinstance(m, Truth)})
    rng = np.random.default_rng(seed)
    points = np.empty((0, 3))
    for t in frames:
        missing = OFFERED - int(eye.look(points, t)[1][:, 0].sum())
        points = np.vstack([points, eye.lay(max(missing, 0), t, rng)])
    kept: list[Message] = []
    for message in messages:
        if getattr(message, "t_ns", 0) > frames[-1]:
            continue
        if isinstance(message, Stereo):
            pixels, seen = eye.look(points, message.t_ns)
            ids = np.nonzero(seen[:, 0])[0][:OFFERED]
            ids = ids[seen[ids, 1]]
            noisy = pixels[ids] + rng.normal(0, header.noise.pixel_sigma_px, (len(ids), 4))
            kept.append(Stereo(message.t_ns, ids.astype(np.uint32), noisy.astype(np.float32)))
        else:
            kept.append(message)
    write_file(out, kept, len(kept))


def row_of(messages: list[Message]) -> list[float]:
    """Returns the columns of one drive."""
    found, truth = estimate_in(messages), truth_in(messages)
    assert found is not None
    assert truth is not None
    told = assess(found[0], filled(truth, found[0].t_ns), found[1], 0, by_imu(messages))
    assert told is not None
    way, turn = (np.sqrt((told.sigma[:, k : k + 3] ** 2).sum(axis=1).mean()) for k in (0, 3))
    of_drive = figures(messages)
    return [of_drive["err0"], of_drive["ATE"], of_drive["NEES/6"], np.degrees(turn), way]


def main() -> int:
    """Prints the table."""
    parser = parser_of(__doc__, "drives whose name contains it")
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--slots", default="50,75,100")
    parser.add_argument("options", nargs="*")
    given = parser.parse_args()
    given.cache.mkdir(parents=True, exist_ok=True)
    exact = [f"--{part}-sigma=0" for part in ("focal", "baseline", "camera-turn")]
    options = [*conf("imu"), "--calibrate=off", *exact, *given.options]
    print(f"{'':24}" + "".join(f"{name:>11}" for name in COLUMNS))
    for drive in (name for name in DRIVES if given.only in name):
        recording = converted(Case(drive, f"imu/{drive}-60-seed0.npz", ("imu-npz",)), given.cache)
        clouds = [given.cache / f"{drive}-{OFFERED}-{seed}.plr" for seed in range(given.seeds)]
        for seed, cloud in enumerate(clouds):
            dense(recording, seed, cloud)
        for slots in given.slots.split(","):
            program = given.bin / "pelorus-replay"
            logs = (run(program, cloud, [*options, "--slots", slots]) for cloud in clouds)
            rows = np.array([row_of(log) for log in logs])
            mean = [*np.sqrt((rows[:, :2] ** 2).mean(axis=0)), *rows[:, 2:].mean(axis=0)]
            print(f"{drive:16}{slots:>4} slots" + "".join(f"{x:11.3g}" for x in mean), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
