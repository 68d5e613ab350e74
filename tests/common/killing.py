"""Plug-ins that stop at a record until their process was killed."""

import os
import signal
import threading
import time
from pathlib import Path


def stops(folder: Path, at: int = 20) -> str:
    """What `detect` begins with: at its call of that number it waits; the first of a process is
    about a plain record.
    """
    return f"""
import os, pathlib, time
seen, stop = pathlib.Path({str(folder)!r}) / "seen", pathlib.Path({str(folder)!r}) / "stop"
with seen.open("a") as f:
    f.write("x")
if seen.stat().st_size == {at}:
    stop.write_text(f"{{os.getpid()}} ")
    while stop.exists():
        time.sleep(0.01)
"""


def kill_when_it_stops(folder: Path, pid: int | None = None) -> threading.Thread:
    """Kill a process, or that of the plug-in, once that has stopped."""
    stop = folder / "stop"

    def run() -> None:
        until = time.monotonic() + 240.0
        while not stop.exists() or not stop.read_text().endswith(" "):
            if time.monotonic() > until:
                return
            time.sleep(0.02)
        os.kill(pid or int(stop.read_text()), signal.SIGKILL)
        stop.unlink()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    return thread
