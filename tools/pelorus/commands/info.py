# SPDX-License-Identifier: MIT
"""`pelorus info IN.plr`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import typer
from rich.markup import escape
from rich.table import Table

from pelorus.evaluate.inertial_survey import ImuSurvey
from pelorus.evaluate.survey import (
    SensorSurvey,
    Survey,
    TrackSurvey,
    require_useful,
    survey,
    survey_json,
)
from pelorus.io.small_sensors import SMALL_SENSORS, WHEEL
from pelorus.program.console import one_line, out, print_json
from pelorus.wire.calibrated import Calibrated
from pelorus.wire.frames import Config, Header, Kind, Process
from pelorus.wire.settings import IDS, describe

GAPS_SHOWN = 5
SPELLS_SHOWN = 40
FAULTS_SHOWN = 10
SEVERITIES = ("info", "warning", "error")

app = typer.Typer()


@app.command(epilog="Example:  pelorus info drive.plr")
def info(
    recording: Path = typer.Argument(..., metavar="IN.plr", help="The recording to look into."),
    as_json: bool = typer.Option(False, "--json", help="The same as one JSON object."),
) -> None:
    """Show what a recording holds: header, settings, counts, rates, gaps, damage, and of a filter's
    result from when to when it was not good, and why.

    The exit status is 1 if nothing in it can be used.
    """
    found = survey(recording)
    if as_json:
        print_json(survey_json(found))
        require_useful(found)
        return
    out.print(f"[bold]{escape(str(found.path))}[/]  {found.counts.bytes} bytes")
    if found.header is not None:
        _show_header(found.header)
    for config in found.configs[-1:]:
        _show_config(config, len(found.configs))
    _show_counts(found)
    _show_streams(found)
    _show_sensors(found)
    if found.imu is not None:
        _show_imu(found.imu, found.origin_ns)
    if found.tracks is not None:
        _show_tracks(found.tracks)
    for text in found.texts:
        severity = SEVERITIES[text.severity] if text.severity < len(SEVERITIES) else "?"
        out.print(f"{severity}: {escape(one_line(text.text))}")
    if found.calibrated is not None:
        _show_calibrated(found.calibrated, found.configs)
    _show_health(found)
    _show_damage(found)
    require_useful(found)


def _show_header(header: Header) -> None:
    table = _two_columns(f"HEADER (version {header.version_major}.{header.version_minor})")
    camera = header.camera
    table.add_row("name", escape(header.name))
    table.add_row("body axes", header.body_axes.name.lower().replace("_", "-"))
    by_imu = header.process is Process.IMU
    table.add_row("moved by", "an IMU" if by_imu else "twists")
    if not by_imu:
        table.add_row("twist timing", header.twist_timing.name.lower())
    size = f"{header.image_width_px} x {header.image_height_px} px"
    table.add_row("image", size if header.image_width_px else "size unknown")
    table.add_row("focal lengths", f"{camera.fx_px:g}, {camera.fy_px:g} px")
    table.add_row("principal point", f"{camera.cx_px:g}, {camera.cy_px:g} px")
    table.add_row("baseline", f"{camera.baseline_m:g} m")
    for label, row in zip(("R_CB", "", ""), header.R_CB, strict=True):
        table.add_row(label, "  ".join(f"{x:9.6f}" for x in row))
    table.add_row("t_CB", "  ".join(f"{x:9.6f}" for x in header.t_CB_m) + "  m")
    for name, value in vars(header.noise).items():
        if value >= 0:
            table.add_row(f"suggests {name}", f"{value:g}")
    out.print(table)


def _show_config(config: Config, count: int) -> None:
    which = "in force" if config.build_fingerprint else "wanted"
    table = _two_columns(f"CONFIG ({which}{f', the last of {count}' if count > 1 else ''})")
    if config.build_fingerprint:
        table.add_row("build fingerprint", f"{config.build_fingerprint:08x}")
        table.add_row("landmarks of the build", str(config.max_landmarks))
        table.add_row("observations of the build", str(config.max_observations))
        table.add_row("observations a block", str(config.block_observations))
        table.add_row("bytes of a real", str(config.real_bytes))
    for id, value in config.settings.items():
        table.add_row(*describe(id, value))
    out.print(table)


def _show_calibrated(estimate: Calibrated, configs: list[Config]) -> None:
    """Prints what was estimated, and the calibration with it, to be copied."""
    table = Table("calibration, estimated", "corrected by", "+-", "", box=None, pad_edge=False)
    for part, value, sigma in estimate.parts():
        table.add_row(part.name, f"{value:+.4f}", f"{sigma:.4f}", part.unit)
    out.print(table)
    c = estimate.camera
    out.print(
        f"    -> fx {c.fx_px:.3f}, fy {c.fy_px:.3f}, cx {c.cx_px:.3f}, cy {c.cy_px:.3f} px, "
        f"baseline {c.baseline_m:.6f} m"
    )
    for label, row, t in zip(("T_CB", "", ""), estimate.R_CB, estimate.t_CB_m, strict=True):
        out.print(f"       {label:5}" + "  ".join(f"{x:10.7f}" for x in (*row, t)))
    if estimate.offset_s:
        before = next((m.settings.get(IDS["camera-offset"], 0.0) for m in reversed(configs)), 0.0)
        out.print(f"       camera-offset = {before + estimate.offset_s:.5f}")


def _show_counts(found: Survey) -> None:
    table = Table("frames", "count", "remark", box=None, pad_edge=False, title_justify="left")
    for kind in Kind:
        if found.counts.frames[kind]:
            roles = ", ".join(f"{n} {role}" for role, n in found.landmarks.items())
            table.add_row(
                kind.name, str(found.counts.frames[kind]), roles if kind == Kind.LANDMARK else ""
            )
    out.print(table)


def _show_streams(found: Survey) -> None:
    streams = {kind.name: stream for kind, stream in found.streams.items()}
    streams |= {f"READING {name}": sensor.stream for name, sensor in found.sensors.items()}
    if not streams:
        return
    origin = found.origin_ns
    table = Table(
        "stream", "from s", "to s", "rate Hz", "gaps", "longest s", box=None, pad_edge=False
    )
    for name, stream in streams.items():
        longest = max((gap.length_ns for gap in stream.gaps), default=0)
        table.add_row(
            name,
            _seconds(stream.first_ns - origin),
            _seconds(stream.last_ns - origin),
            f"{stream.rate_hz:.2f}",
            str(len(stream.gaps)),
            _seconds(longest) if longest else "",
        )
    out.print(table)
    out.print(f"time 0 is {origin} ns")
    for name, stream in streams.items():
        worst = sorted(stream.gaps, key=lambda gap: -gap.length_ns)[:GAPS_SHOWN]
        for gap in worst:
            at = _seconds(gap.after_ns - origin)
            out.print(f"gap: {name} pauses for {_seconds(gap.length_ns)} s after {at} s")


def _show_sensors(found: Survey) -> None:
    letters = {sensor.name: sensor.letters for sensor in SMALL_SENSORS}
    for name, sensor in found.sensors.items():
        axes = "".join(x for k, x in enumerate(letters.get(name, "012")) if sensor.axes >> k & 1)
        sigma = ", ".join(f"{x:.3g}" for x in dict.fromkeys(sensor.sigma))
        out.print(
            f"{sensor.stream.count} readings of a {name}, axes {axes}, sigma {sigma} (median), "
            f"values {_ranges(sensor.ranges)}"
        )
        if name == WHEEL.name:
            _show_wheels(sensor)


def _show_wheels(sensor: SensorSurvey) -> None:
    """Prints where the wheels sit, and for how long they stand."""
    places = ", ".join(f"({', '.join(f'{x:g}' for x in place)})" for place in sensor.places_B_m)
    length_s = (sensor.stream.last_ns - sensor.stream.first_ns) * 1e-9
    out.print(
        f"    the wheels sit at {places} m (x, y, z of the body); they read exactly 0 for "
        f"{sensor.zero_s:.1f} of {length_s:.1f} s"
    )


def _show_imu(imu: ImuSurvey, origin_ns: int) -> None:
    out.print(
        f"{imu.readings} readings of an IMU: accelerometer {_ranges(imu.accel_range)} m/s^2, gyro "
        f"{_ranges(imu.gyro_range)} rad/s (x, y, z)"
    )
    still = imu.still
    if still is None:
        out.print("at no time does the IMU rest for 2 s")
        return
    rate = ", ".join(f"{x:.2g}" for x in still.rate_radps)
    out.print(
        f"the IMU rests from {_seconds(still.from_ns - origin_ns)} to "
        f"{_seconds(still.to_ns - origin_ns)} s: specific force {still.force_mps2:.3f} m/s^2, gyro "
        f"{rate} rad/s, noise {still.gyro_noise:.2g} rad/s/sqrt(Hz) and {still.accel_noise:.2g} "
        "m/s^2/sqrt(Hz)"
    )


def _ranges(axes: Sequence[tuple[float, float]]) -> str:
    return ", ".join(f"{least:.3g} to {most:.3g}" for least, most in axes) or "nothing"


def _show_tracks(tracks: TrackSurvey) -> None:
    least, median, most = tracks.per_frame
    out.print(
        f"{tracks.observations} observations, {least} / {median} / {most} a frame "
        f"(least, median, most), of {tracks.landmarks} ids seen in "
        f"{tracks.frames_per_landmark:g} frames (median); {tracks.no_disparity} without disparity"
    )


def _show_health(found: Survey) -> None:
    if found.health is None:
        return
    out.print(f"health: {found.health.summary()}")
    for spell in found.health.spells[:SPELLS_SHOWN]:
        out.print(f"  {spell.words(found.origin_ns)}")
    more = len(found.health.spells) - SPELLS_SHOWN
    if more > 0:
        out.print(f"  and {more} more, all of them with --json")


def _show_damage(found: Survey) -> None:
    counts = found.counts
    for remark in found.remarks:
        out.print(f"[yellow]note:[/] {escape(remark)}")
    if counts.clean:
        out.print("[green]no damage[/]")
        return
    out.print(
        f"[bold red]damage:[/] {counts.damaged} frames damaged, {counts.missing} missing in the "
        f"sequence, {counts.malformed} malformed, {counts.unknown} of unknown kind, "
        f"{counts.too_long} too long"
    )
    for fault in counts.faults[:FAULTS_SHOWN]:
        out.print(f"  byte {fault.offset}: {escape(fault.what)}")
    faults = counts.damaged + counts.malformed + counts.unknown + counts.too_long
    if faults > FAULTS_SHOWN:
        out.print(f"  and {faults - FAULTS_SHOWN} more")


def _two_columns(title: str) -> Table:
    table = Table(title=title, title_justify="left", box=None, show_header=False, pad_edge=False)
    table.add_column(style="cyan")
    table.add_column()
    return table


def _seconds(ns: int) -> str:
    return f"{ns * 1e-9:.3f}"
