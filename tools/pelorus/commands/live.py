# SPDX-License-Identifier: MIT
"""`pelorus live --camera KIND`."""

from __future__ import annotations

import signal
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.markup import escape

from pelorus.commands.choices import CONFIG, SETTINGS, VIEW, settings_given, watching
from pelorus.commands.outputs import run_command
from pelorus.errors import Existing, PelorusError
from pelorus.live.camera import CAMERAS, Asked, Camera, open_camera
from pelorus.live.port import FORMS
from pelorus.online.diagnosis import Level, Status
from pelorus.program.console import err, out, told

if TYPE_CHECKING:
    from pelorus.live.outputs import Output
    from pelorus.live.session import Intake, Session
    from pelorus.online.odometry import Odom

CHECK_S = 60.0
SAY_EVERY_NS = 1_000_000_000
WAVE = (
    "Lay it down for three seconds; then for a minute wave it slowly: up and down, left and right, "
    "to and fro, and turn it about each axis, before something with texture 1 to 3 m away."
)
app = typer.Typer()


@app.command(
    epilog="Example:  pelorus live --camera oak --log drive.plr --mavlink serial:/dev/ttyS0"
)
def live(
    source: str = typer.Argument(
        "", metavar="[FOLDER|DRIVE.plr|DEVICE]", help="Which one, where the kind has several."
    ),
    camera: str = typer.Option(..., metavar="KIND", help=f"{', '.join(CAMERAS)}."),
    log: Path | None = typer.Option(
        None,
        metavar="OUT.plr",
        help="Keep all that the filter is given and what it says; it replays to the bit. Whole up "
        "to any moment; as OUT.plr.zst up to the last 32 KB.",
    ),
    view: str | None = VIEW,
    mavlink: str | None = typer.Option(
        None,
        metavar="PORT",
        help=f"ODOMETRY to an autopilot, with HEARTBEAT and TIMESYNC: {FORMS}.",
    ),
    origin: tuple[float, float, float] | None = typer.Option(
        None,
        metavar="LAT LON ALT",
        help="With --mavlink: where the robot begins, deg and m, for an autopilot without GPS.",
    ),
    udp: str | None = typer.Option(
        None, metavar="HOST:PORT", help="Each pose as a datagram of JSON."
    ),
    mount: tuple[float, float, float, float, float, float] = typer.Option(
        (0.0,) * 6,
        metavar="X Y Z ROLL PITCH YAW",
        help="Where the left camera sits on the robot: m forward, left, up of the point whose pose "
        "is told; deg, pitch > 0 looks down. Else the pose is the left camera's.",
    ),
    size: str = typer.Option("", metavar="WxH", help="Of the pictures, px; else the kind's own."),
    rate: int | None = typer.Option(
        None, min=1, max=120, metavar="HZ", help="Pairs of pictures a second; else the kind's own."
    ),
    calibration: list[Path] = typer.Option(
        [],
        metavar="FILE",
        help="In place of the factory's, or where the camera has none; as for pelorus convert.",
    ),
    extrinsic: Path | None = typer.Option(
        None, metavar="FILE", help="JSON with R_CB and t_CB_m: from the IMU to the left camera."
    ),
    imu: str = typer.Option(
        "",
        metavar="DEVICE[:BAUD]",
        help="For v4l2: a serial port that gives lines `ax ay az wx wy wz` in m/s^2 and rad/s, or "
        "with a time in s before them.",
    ),
    wheels: str = typer.Option(
        "",
        metavar="udp:PORT|FILE.csv",
        help="Speeds of wheels beside the IMU, datagrams of JSON or rows of a table: `v_mps`, or "
        "`left_mps` and `right_mps`; `t_ns` or `t_s` on the camera's clock, else they are of now.",
    ),
    wheel_sigma: float = typer.Option(0.03, metavar="M/S", help="Noise of a speed."),
    wheel_at: tuple[float, float, float] = typer.Option(
        (0.0, 0.0, 0.0),
        metavar="X Y Z",
        help="The middle of their axle on the robot, m, as --mount.",
    ),
    wheel_track: float = typer.Option(
        0.0, min=0.0, metavar="M", help="Distance from the left to the right wheel."
    ),
    config: Path | None = CONFIG,
    settings: list[str] = SETTINGS,
    check: bool = typer.Option(
        False, "--check", help="Wave it for a minute: can calibration and IMU be trusted?"
    ),
    seconds: float | None = typer.Option(
        None, min=1.0, metavar="S", help=f"Stop after so long; of --check {CHECK_S:g}."
    ),
) -> None:
    """Tell where a camera is, now: on the screen, in a log, to an autopilot, to a viewer.

    Ctrl-C ends it, and the log is whole. docs/LIVE.md has cameras, wiring and autopilots.
    """
    from pelorus.live.session import How, Session  # noqa: PLC0415 - scipy loads slowly
    from pelorus.live.wheels import Beside, WheelsAsked  # noqa: PLC0415

    if origin is not None and mavlink is None:
        raise PelorusError("--origin is told to an autopilot: it needs --mavlink PORT")
    if log is not None and not log.parent.is_dir():
        raise PelorusError(f"--log {log}: there is no folder {log.parent}")
    given = settings_given(config, settings)
    asked = Asked(source, _size(size), rate, tuple(calibration), extrinsic, imu)
    with tempfile.TemporaryDirectory(prefix="pelorus-") as folder:
        if check:
            log, seconds = log or Path(folder) / "wave.plr", seconds or CHECK_S
            Existing.keep(_settings_of(log))  # before the minute, not after it
            out.print(WAVE)
        with ExitStack() as stack:
            watch = stack.enter_context(watching(view)) if view is not None else None
            opened = open_camera(camera, asked)
            stack.callback(opened.close)
            if wheels:
                of_wheels = WheelsAsked(wheels, wheel_sigma, wheel_at, wheel_track)
                opened = Beside(opened, of_wheels, mount)
                stack.callback(opened.close)
            outputs = _outputs(mavlink, origin, udp)
            for output in outputs:
                stack.callback(output.close)
            for remark in opened.remarks:
                out.print(escape(remark))
            own = getattr(opened, "settings", {})
            how = How(mount, settings=own | given, log=log, watch=watch)
            _drive(Session(opened, how), opened, outputs, seconds)
        if check and log is not None:
            raise typer.Exit(_verdict(log))


def _size(words: str) -> tuple[int, int] | None:
    if not words:
        return None
    width, x, height = words.partition("x")
    if not (x and width.isdecimal() and height.isdecimal()):
        raise PelorusError(f"--size {words}: WIDTHxHEIGHT in px is expected, as in 640x400")
    return int(width), int(height)


def _outputs(
    mavlink: str | None, origin: tuple[float, float, float] | None, udp: str | None
) -> list[Output]:
    from pelorus.live.autopilot import Autopilot, Origin  # noqa: PLC0415
    from pelorus.live.outputs import Datagrams  # noqa: PLC0415

    made: list[Output] = []
    if udp is not None:
        made.append(Datagrams(udp))
    if mavlink is not None:
        autopilot = Autopilot(mavlink, None if origin is None else Origin(*origin))
        autopilot.start()
        made.append(autopilot)
    return made


def _drive(session: Session, camera: Camera, outputs: list[Output], seconds: float | None) -> None:
    """Until the camera ends, the time is over or somebody stops it; always to an end in order."""
    from pelorus.live.session import Intake  # noqa: PLC0415

    intake, screen = Intake(camera), _Screen(session, outputs)
    try:
        with _stopped_by_signals(intake), screen:
            for measured, too_slow in intake:
                screen.show(_handed_on(session.take(measured, too_slow), outputs))
                if seconds is not None and session.seconds >= seconds:
                    break
    finally:
        _handed_on(session.finish(), outputs)
    screen.tell_end()


def _handed_on(odoms: list[Odom], outputs: list[Output]) -> list[Odom]:
    for odom in odoms:
        for output in outputs:
            output.odom(odom)
    return odoms


@contextmanager
def _stopped_by_signals(intake: Intake) -> Iterator[None]:
    """Ctrl-C and SIGTERM end the drive between two measurements; a second Ctrl-C at once."""

    def stop(number: int, frame: object) -> None:
        if intake.stop.is_set():
            signal.default_int_handler(number, None)
        del frame
        intake.stop.set()

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Screen:
    """A line that changes on a terminal, one every ten seconds elsewhere, and all news at once."""

    def __init__(self, session: Session, outputs: list[Output]) -> None:
        from pelorus.live.outputs import HealthLine, News  # noqa: PLC0415

        self._session, self._outputs = session, outputs
        self._line, self._news = HealthLine(), News()
        self._status = err.status("waits for camera and IMU")
        self._next_ns: int | None = None
        self._last = ""
        self._poses = 0

    def __enter__(self) -> None:
        if err.is_terminal:
            self._status.start()

    def __exit__(self, *_: object) -> None:
        self._status.stop()

    def show(self, odoms: list[Odom]) -> None:
        for odom in odoms:
            self._poses += 1
            self._last = self._line.of(odom)
        if odoms:
            if err.is_terminal:
                self._status.update(escape(self._last))
            told.say(self._last)
        now = self._session.newest_ns
        if self._next_ns is None:
            self._next_ns = now + 5 * SAY_EVERY_NS  # until then it starts
        elif now >= self._next_ns:
            self._next_ns = now + SAY_EVERY_NS
            self._tell_news()

    def _tell_news(self) -> None:
        found = self._session.diagnose()
        found += [Status("output", Level.WARN, o.trouble) for o in self._outputs if o.trouble]
        for words in self._news.of(found):
            err.print(escape(words))

    def tell_end(self) -> None:
        """The last pose, and what went wrong."""
        session = self._session
        if session.pipeline.blocked:
            raise PelorusError("; ".join(session.pipeline.blocked.values()))
        if not self._poses:
            found = session.diagnose() or [Status("estimate", Level.ERROR, "no pose was told")]
            why = "; ".join(f"{one.message}; {one.do}".removesuffix("; ") for one in found)
            raise PelorusError(
                f"{session.camera.name}: gave no pose in {session.seconds:.1f} s: {why}"
            )
        out.print(escape(self._last))
        if session.log_trouble:
            raise PelorusError(session.log_trouble)


def _verdict(log: Path) -> int:
    """What the check of the recording says; the settings stand beside the log, or are let go."""
    force = ("--force",) if Existing.overwritten else ()
    return run_command("check", str(log), "--out", str(_settings_of(log)), *force)


def _settings_of(log: Path) -> Path:
    return log.with_name(f"{log.name.partition('.')[0]}.conf")
