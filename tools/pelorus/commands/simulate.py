# SPDX-License-Identifier: MIT
"""`pelorus simulate OUT.plr`."""

from __future__ import annotations

from pathlib import Path

import typer
from rich.markup import escape

from pelorus.commands.choices import Timing
from pelorus.console import out
from pelorus.simulation.simulate import Options, simulate

D = Options()  # the defaults stand there


def register(parent: typer.Typer) -> None:
    """Add `simulate` to the command line."""
    parent.command(
        "simulate",
        epilog="Example:  pelorus simulate drive.plr --duration 60 --seed 7 --outliers 0.05",
    )(run)


def run(
    target: Path = typer.Argument(..., metavar="OUT.plr", help="The recording to write."),
    seed: int = typer.Option(D.seed, help="The same seed gives the same bytes."),
    duration: float = typer.Option(D.duration_s, metavar="S", help="Length of the drive."),
    frame_rate: float = typer.Option(D.frame_rate_hz, metavar="HZ", help="Stereo frames."),
    twist_rate: float = typer.Option(
        D.twist_rate_hz, metavar="HZ", help="Twists: a whole multiple of the frame rate."
    ),
    twist_timing: Timing = typer.Option(Timing.START, help="When a twist reading holds."),
    speed: float = typer.Option(D.speed_mps, metavar="M/S", help="Mean speed."),
    lap: float = typer.Option(D.lap_s, metavar="S", help="Time of a lap."),
    landmarks: int = typer.Option(D.landmarks, help="Landmarks along the way."),
    observations: int = typer.Option(D.observations, help="Most observations of a frame."),
    range_: float = typer.Option(D.range_m, "--range", metavar="M", help="How far is seen."),
    keep_ids: bool = typer.Option(
        False, "--keep-ids", help="A landmark seen again has its old id: loops close."
    ),
    known: bool = typer.Option(
        False, "--known", help="Write the landmarks as known ones (implies --keep-ids)."
    ),
    known_sigma: float = typer.Option(
        D.known_sigma_m, metavar="M", help="Standard deviation to be told of known landmarks."
    ),
    loss: float = typer.Option(D.loss, help="Probability a frame that a track breaks."),
    pixel_sigma: float = typer.Option(D.pixel_sigma_px, metavar="PX", help="Noise of a pixel."),
    velocity_sigma: float = typer.Option(
        D.velocity_sigma_mps, metavar="M/S", help="Noise of a linear velocity, each axis."
    ),
    gyro_sigma: float = typer.Option(
        D.gyro_sigma_radps, metavar="RAD/S", help="Noise of an angular velocity, each axis."
    ),
    bias_velocity_sigma: float = typer.Option(
        D.bias_velocity_sigma_mps, metavar="M/S", help="The linear bias is drawn with it."
    ),
    bias_gyro_sigma: float = typer.Option(
        D.bias_gyro_sigma_radps, metavar="RAD/S", help="The angular bias is drawn with it."
    ),
    bias_velocity_walk: float = typer.Option(
        D.bias_velocity_walk, help="Variance that the linear bias gains, (m/s)^2 a second."
    ),
    bias_gyro_walk: float = typer.Option(
        D.bias_gyro_walk, help="Variance that the angular bias gains, (rad/s)^2 a second."
    ),
    outliers: float = typer.Option(D.outliers, help="Fraction of observations that are wrong."),
    drop: float = typer.Option(D.drop, help="Fraction of frames that are lost."),
    camera_delay: float = typer.Option(
        D.camera_delay_s,
        metavar="S",
        help="Frames stand so much later in the file than their time, as off a slow camera.",
    ),
) -> None:
    """Simulate a drive through a field of landmarks, with the truth."""
    options = Options(
        seed=seed,
        duration_s=duration,
        frame_rate_hz=frame_rate,
        twist_rate_hz=twist_rate,
        twist_timing=twist_timing.value_in_header,
        speed_mps=speed,
        lap_s=lap,
        landmarks=landmarks,
        observations=observations,
        range_m=range_,
        keep_ids=keep_ids,
        known=known,
        known_sigma_m=known_sigma,
        loss=loss,
        pixel_sigma_px=pixel_sigma,
        velocity_sigma_mps=velocity_sigma,
        gyro_sigma_radps=gyro_sigma,
        bias_velocity_sigma_mps=bias_velocity_sigma,
        bias_gyro_sigma_radps=bias_gyro_sigma,
        bias_velocity_walk=bias_velocity_walk,
        bias_gyro_walk=bias_gyro_walk,
        outliers=outliers,
        drop=drop,
        camera_delay_s=camera_delay,
    )
    recording = simulate(options).recording
    size = recording.write(target)
    out.print(
        f"{escape(str(target))}: {size} bytes, {len(recording.twist_t_ns)} twists, "
        f"{len(recording.frame_t_ns)} frames with {len(recording.tracks)} observations, "
        f"{len(recording.truth_t_ns)} truth poses, {len(recording.known)} known landmarks"
    )
