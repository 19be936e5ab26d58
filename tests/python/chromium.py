# SPDX-License-Identifier: MIT
"""Chromium without a window, driven over a pipe by its DevTools protocol: no driver, no port."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")
WAIT_S = 60
OneTab = TypeVar("OneTab", bound="Tab")


class Tab:
    """One page."""

    def __init__(self, send: int, receive: int) -> None:
        self._send, self._receive = send, receive
        self._number = 0
        self._rest = b""
        self._session: str | None = None
        self.troubles: list[str] = []  # errors of scripts, and what the console says
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> Any:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._send, json.dumps(message).encode() + b"\0")
        while True:
            said = self._next()
            self._note(said)
            if said.get("id") == self._number:
                assert "error" not in said, said["error"]
                return said.get("result")

    def _next(self) -> Any:
        while b"\0" not in self._rest:
            piece = os.read(self._receive, 1 << 20)
            assert piece, "Chromium has ended"
            self._rest += piece
        message, _, self._rest = self._rest.partition(b"\0")
        return json.loads(message)

    def _note(self, said: Any) -> None:
        if said.get("method") == "Runtime.exceptionThrown":
            self.troubles.append(json.dumps(said["params"]["exceptionDetails"]))
        if said.get("method") == "Log.entryAdded":
            self.troubles.append(said["params"]["entry"]["text"])

    def does(self, script: str) -> Any:
        """The value of an expression, awaited."""
        found = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def open(self, path: Path, width: int, height: int = 900, dark: bool = False) -> None:
        """As on a screen of that size; the page is there when it says so, or has no script."""
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=scheme)
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        self.call("Page.navigate", url=path.resolve().as_uri())
        self.does(
            """new Promise((done) => { const look = () => document.readyState === "complete" &&
            (document.documentElement.dataset.ready || !document.getElementById("data") ||
             document.getElementById("now").textContent.includes("damaged")) ? done() :
            setTimeout(look, 20); look(); })"""
        )

    def press(self, key: str) -> None:
        event = f"new KeyboardEvent('keydown', {{key: {key!r}, bubbles: true}})"
        self.does(f"document.body.dispatchEvent({event})")
        self.settle()

    def mouse(self, *path: tuple[float, float]) -> None:
        """Pressed at the first place, moved along, released at the last."""
        for k, (x, y) in enumerate(path):
            kinds = ["mouseMoved", "mousePressed"] if k == 0 else ["mouseMoved"]
            kinds += ["mouseReleased"] if k == len(path) - 1 else []
            for kind in kinds:
                pressed = (
                    {} if kind == "mouseMoved" and k == 0 else {"button": "left", "buttons": 1}
                )
                count = 0 if kind == "mouseMoved" else 1
                self.call(
                    "Input.dispatchMouseEvent", type=kind, x=x, y=y, clickCount=count, **pressed
                )
        self.settle()

    def settle(self) -> None:
        frames = "requestAnimationFrame(() => requestAnimationFrame(done))"
        self.does(f"new Promise((done) => setTimeout(() => {frames}, 30))")

    def picture(self, path: Path, whole: bool = True) -> None:
        shot = self.call("Page.captureScreenshot", captureBeyondViewport=whole, format="png")
        path.write_bytes(base64.b64decode(shot["data"]))


def chromium() -> str | None:
    """Where the program is, if it is."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


@contextmanager
def tab(kind: type[OneTab]) -> Iterator[OneTab]:
    """Opens a tab of a browser of its own; skips the test where there is none."""
    program = chromium()
    if program is None:
        pytest.skip(f"there is no Chromium ({', '.join(NAMES)}): apt-get install chromium")
    ours_out, ours_in = os.pipe(), os.pipe()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        script = f'exec "$0" "$@" 3<&{ours_out[0]} 4>&{ours_in[1]}'
        options = (
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--remote-debugging-pipe",
        )
        process = subprocess.Popen(
            [
                "bash",
                "-c",
                script,
                program,
                *options,
                f"--user-data-dir={folder}",
                "--no-first-run",
            ],
            pass_fds=(ours_out[0], ours_in[1]),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(ours_out[0])
        os.close(ours_in[1])
        try:
            yield kind(ours_out[1], ours_in[0])
        finally:
            process.terminate()
            process.wait(WAIT_S)
            os.close(ours_out[1])
            os.close(ours_in[0])
