# SPDX-License-Identifier: MIT
"""`pelorus simulate OUT.plr`."""

from __future__ import annotations

from pathlib import Path

import typer
from rich.markup import escape

from pelorus.commands.choices import Timing
from pelorus.console import err, out
from pelorus.errors import PelorusError
from pelorus.recording import Recording
from pelorus.simulation.mishaps import Mishaps, Span
from pelorus.simulation.simulate import Options, blindness, simulate

D = Options()  # the defaults stand there
M = Mishaps()
PANEL = "What goes wrong"
FROM = "It begins then."
FOR = "It lasts so long; 0: to the end."


def register(parent: typer.Typer) -> None:
    """Add `simulate` to the command line."""
    parent.command(
        "simulate",
        epilog="Example:  pelorus simulate slip.plr --slip 0.5 --slip-from 20 --slip-for 5",
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
    parked: bool = typer.Option(
        False, "--parked", help="Stand still: neither --speed nor --lap moves it."
    ),
    landmarks: int = typer.Option(D.landmarks, help="Landmarks along the way."),
    observations: int = typer.Option(D.observations, help="Most observations of a frame."),
    min_depth: float = typer.Option(
        D.min_depth_m,
        metavar="M",
        help="None is seen nearer; 0: as they come. A far scene: --min-depth 50 --max-depth 400.",
    ),
    max_depth: float = typer.Option(
        D.max_depth_m, metavar="M", help="None is seen farther, and --range gives way; 0: --range."
    ),
    baseline: float = typer.Option(D.baseline_m, metavar="M", help="Of the stereo camera."),
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
    twist_delay: float = typer.Option(
        M.twist_delay_s,
        metavar="S",
        help="Twists stand so much later in the file than their time: behind newer frames.",
        rich_help_panel=PANEL,
    ),
    slip: float = typer.Option(
        M.slip, metavar="FACTOR", help="All readings are multiplied by it.", rich_help_panel=PANEL
    ),
    slip_from: float = typer.Option(0.0, metavar="S", help=FROM, rich_help_panel=PANEL),
    slip_for: float = typer.Option(0.0, metavar="S", help=FOR, rich_help_panel=PANEL),
    dead_encoder_from: float | None = typer.Option(
        None,
        metavar="S",
        help="From then on the linear velocity reads zero.",
        rich_help_panel=PANEL,
    ),
    dead_encoder_for: float = typer.Option(0.0, metavar="S", help=FOR, rich_help_panel=PANEL),
    frozen_from: float | None = typer.Option(
        None,
        metavar="S",
        help="From then on the camera repeats its last frame.",
        rich_help_panel=PANEL,
    ),
    frozen_for: float = typer.Option(0.0, metavar="S", help=FOR, rich_help_panel=PANEL),
    track_drift: float = typer.Option(
        M.track_drift,
        metavar="PX",
        help="Tracks wander off their landmark: sigma in px after a second, growing as the root.",
        rich_help_panel=PANEL,
    ),
    moving: float = typer.Option(
        M.moving, metavar="SHARE", help="Share of the landmarks that move.", rich_help_panel=PANEL
    ),
    moving_speed: float = typer.Option(
        M.moving_speed_mps,
        metavar="M/S",
        help="All of them, one way, level.",
        rich_help_panel=PANEL,
    ),
    convoy: float = typer.Option(
        M.convoy,
        metavar="SHARE",
        help="They move along with the robot, at this share of its speed.",
        rich_help_panel=PANEL,
    ),
    moving_from: float = typer.Option(0.0, metavar="S", help=FROM, rich_help_panel=PANEL),
    moving_for: float = typer.Option(0.0, metavar="S", help=FOR, rich_help_panel=PANEL),
    jump: float = typer.Option(
        M.jump_m,
        metavar="M",
        help="The robot is set aside to its left, and no twist tells of it.",
        rich_help_panel=PANEL,
    ),
    jump_at: float = typer.Option(
        M.jump_at_s, metavar="S", help="When it is.", rich_help_panel=PANEL
    ),
    baseline_error: float = typer.Option(
        M.baseline_error_percent,
        metavar="PERCENT",
        help="The true baseline is so much larger than the header's.",
        rich_help_panel=PANEL,
    ),
    focal_error: float = typer.Option(
        M.focal_error_percent,
        metavar="PERCENT",
        help="The true focal length is so much larger than the header's.",
        rich_help_panel=PANEL,
    ),
) -> None:
    """Simulate a drive through a field of landmarks, with the truth.

    And what may go wrong on it: slipping wheels, a frozen camera, a moving scene. All times are
    counted from the beginning of the drive.
    """
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
        parked=parked,
        min_depth_m=min_depth,
        max_depth_m=max_depth,
        baseline_m=baseline,
        mishaps=Mishaps(
            slip=slip,
            slip_span=Span(slip_from, slip_for),
            dead_encoder=_span("dead-encoder", dead_encoder_from, dead_encoder_for),
            twist_delay_s=twist_delay,
            frozen=_span("frozen", frozen_from, frozen_for),
            track_drift=track_drift,
            moving=moving,
            moving_speed_mps=moving_speed,
            convoy=convoy,
            moving_span=Span(moving_from, moving_for),
            jump_m=jump,
            jump_at_s=jump_at,
            baseline_error_percent=baseline_error,
            focal_error_percent=focal_error,
        ),
    )
    recording = simulate(options).recording
    _tell_blindness(recording)
    size = recording.write(target)
    out.print(
        f"{escape(str(target))}: {size} bytes, {len(recording.twist_t_ns)} twists, "
        f"{len(recording.frame_t_ns)} frames with {len(recording.tracks)} observations, "
        f"{len(recording.truth_t_ns)} truth poses, {len(recording.known)} known landmarks"
    )


def _span(name: str, from_s: float | None, for_s: float) -> Span | None:
    if from_s is None:
        if for_s:
            raise PelorusError(f"--{name}-for is {for_s}: it needs --{name}-from")
        return None
    return Span(from_s, for_s)


def _tell_blindness(recording: Recording) -> None:
    """A recording of nothing is no recording; where a part of it is blind, say so."""
    trouble = blindness(recording)
    if trouble and not len(recording.tracks):
        raise PelorusError(trouble)
    if trouble:
        err.print(f"[bold yellow]warning:[/] {trouble}")
