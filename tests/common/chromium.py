"""A headless Chromium for tests: load one page, see what it asks for and complains about, evaluate
JavaScript in it.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--remote-debugging-port=0",
    "--remote-allow-origins=*",
)


def executable() -> str | None:
    """Path of the browser, or None."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


needs_browser = pytest.mark.skipif(
    executable() is None, reason="no Chromium here: the page is checked as text only"
)
PAPER = 703  # px of A4 between margins of 12 mm
OUTSIDE = """[...document.querySelectorAll("th, td, svg, pre, .tile")].filter(e => {
  const frame = e.closest(".scroll, .wide"), edge = document.documentElement.clientWidth + 1;
  return e.getBoundingClientRect().right > edge ||
    (frame && getComputedStyle(frame).overflow !== "visible"); }).length"""


VISIBLE = """[...document.querySelectorAll("svg")].map(s => {
  const r = s.getBoundingClientRect(), b = s.getBBox(), style = getComputedStyle(s);
  return [r.width, r.height, r.left, r.right, b.width, b.height,
          style.visibility, style.display]; })"""
FIXED = """document.querySelectorAll('svg [style*="#ffffff"], svg [style*="#000000"]').length"""
WIDE = 704  # px: a wide picture scrolls in a frame on a phone


def assert_alone(file: Path) -> None:
    """Assert that a page is one file without a link to anywhere, whose references all hit."""
    text = file.read_text(encoding="utf-8")
    assert "<script src" not in text
    assert "@import" not in text
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    targets = re.findall(r'(?:src|href|action)="([^"]*)"', text)
    for target in targets + re.findall(r"url\(([^)]*)\)", text):
        assert target.startswith("data:") or (target[:1] == "#" and target[1:] in ids), target


def seen_pictures(file: Path, width: int, dark: bool) -> int:
    """Assert that a page fails in nothing, asks for nothing and never scrolls sideways, and that
    its pictures are seen in its ink and on its ground; return how many there are.
    """
    with opened(file, width, dark) as page:
        pictures = page.evaluate(VISIBLE)
        over = page.evaluate(
            "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        )
        ink, ground = page.evaluate(
            "(s => [s.color, s.backgroundColor])(getComputedStyle(document.body))"
        )
        lines = page.evaluate('getComputedStyle(document.querySelector("svg")).fill')
        named = page.evaluate('document.querySelectorAll("svg[role=img][aria-label]").length')
        fixed = page.evaluate(FIXED)
        assert page.errors == []
        assert page.requests == [file.resolve().as_uri()]
    assert over <= 0, "the page itself never scrolls sideways"
    for w, h, left, right, inner_w, inner_h, visibility, display in pictures:
        assert w > 100
        assert h > 40
        assert -1 <= left < right <= width + 1 or w == WIDE
        assert min(inner_w, inner_h) > 0
        assert (visibility, display) == ("visible", "block")
    bright = [sum(int(x) for x in re.findall(r"\d+", c)[:3]) for c in (ink, ground)]
    assert (bright[0] > bright[1]) == dark
    assert lines == ink, "pictures follow the page's ink"
    assert fixed == 0, "what is black or white in a picture follows the page"
    assert named == len(pictures), "every picture has a text in its place"
    return len(pictures)


def lost_on_paper(file: Path) -> int:
    """Count the cells, pictures and tiles that a printed page cuts off or hides in a frame that
    would have to be scrolled.
    """
    with opened(file, PAPER, media="print") as page:
        assert page.evaluate("document.querySelectorAll('td').length") > 0
        return page.evaluate(OUTSIDE)


class Page:
    """One loaded page."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._count = 0
        self.errors: list[str] = []
        self.requests: list[str] = []

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send one command and note what happens meanwhile."""
        self._count += 1
        self._socket.send(json.dumps({"id": self._count, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv())
            if message.get("id") == self._count:
                assert "error" not in message, message
                return message["result"]
            self._note(message)

    def wait_for(self, event: str, seconds: float = 30.0) -> None:
        """Read until an event has come."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            message = json.loads(self._socket.recv())
            self._note(message)
            if message.get("method") == event:
                return
        raise TimeoutError(event)

    def evaluate(self, expression: str) -> Any:
        """Return the value of a JavaScript expression."""
        answer = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def _note(self, message: dict[str, Any]) -> None:
        method, given = message.get("method"), message.get("params", {})
        if method == "Network.requestWillBeSent":
            self.requests.append(given["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            self.errors.append(str(given["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and given["type"] in (
            "error",
            "warning",
            "assert",
        ):
            self.errors.append(str(given["args"]))
        elif method == "Log.entryAdded" and given["entry"]["level"] in ("error", "warning"):
            self.errors.append(given["entry"]["text"])


@contextlib.contextmanager
def opened(
    file: Path, width: int = 1200, dark: bool = False, media: str = "screen"
) -> Iterator[Page]:
    """Load a file in a separate browser."""
    import websocket

    browser = executable()
    assert browser is not None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        process = subprocess.Popen(
            [
                browser,
                *FLAGS,
                f"--user-data-dir={profile}",
                f"--window-size={width},900",
                "about:blank",
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "HOME": profile},
        )
        try:
            port = _port(Path(profile) / "DevToolsActivePort", process)
            with urlopen(f"http://127.0.0.1:{port}/json/list", timeout=30) as answer:
                target = next(t for t in json.load(answer) if t["type"] == "page")
            socket = websocket.create_connection(target["webSocketDebuggerUrl"], timeout=60)
            try:
                page = Page(socket)
                for domain in ("Page", "Runtime", "Network", "Log"):
                    page.call(f"{domain}.enable")
                page.call(
                    "Emulation.setDeviceMetricsOverride",
                    width=width,
                    height=900,
                    deviceScaleFactor=1,
                    mobile=False,
                )
                scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
                page.call("Emulation.setEmulatedMedia", media=media, features=[scheme])
                page.call("Page.navigate", url=file.resolve().as_uri())
                page.wait_for("Page.loadEventFired")
                yield page
            finally:
                socket.close()
        finally:
            process.terminate()
            process.wait(timeout=30)


def _port(file: Path, process: subprocess.Popen) -> int:
    end = time.monotonic() + 60
    while time.monotonic() < end:
        if file.is_file() and file.read_text().strip():
            return int(file.read_text().split()[0])
        assert process.poll() is None, "the browser did not start"
        time.sleep(0.05)
    raise TimeoutError("the browser gave no port")
