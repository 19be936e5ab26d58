# SPDX-License-Identifier: MIT
"""The output that every converter and the simulation have in common."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rich.markup import escape

from pelorus.faults.finding import Finding
from pelorus.io.recording import Recording
from pelorus.program.console import out
from pelorus.wire.frames import TEXT_BYTES_MAX, Text


def _verdict(finding: Finding) -> str:
    if not finding.is_conclusive:
        return "[yellow]cannot tell[/]"
    if finding.measured:
        return "[green]measured[/]"
    return "[bold yellow]FOUND[/]" if finding.found else "[green]good[/]"


def write(recording: Recording, findings: list[Finding], target: Path) -> None:
    """Prints the findings, keeps them in the recording as TEXT, and writes the file."""
    for finding in findings:
        out.print(f"{finding.subject}: {_verdict(finding)}: {escape(finding.evidence)}")
        out.print(f"    -> {escape(finding.action)}")
    remarks = [
        Text(f"{f.subject}: {f.action}"[:TEXT_BYTES_MAX]) for f in findings if f.found or f.measured
    ]
    size = replace(recording, remarks=[*recording.remarks, *remarks]).write(target)
    tracks = recording.tracks
    out.print(
        f"{escape(str(target))}: {size} bytes, {recording.motion_words}, "
        + (
            f"{len(recording.frame_t_ns)} frames with {len(tracks)} observations, "
            if recording.pictures is None
            else f"{len(recording.pictures.t_ns)} pairs of pictures, "
        )
        + f"{len(recording.truth_t_ns)} truth poses, {len(recording.known)} known landmarks"
        + (f", {len(recording.readings)} readings" if recording.readings else "")
    )
