"""Lock the folder of a run: a file with a heartbeat shows every machine that the folder is in
use.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import sys
import threading
import time
import uuid
from collections.abc import Iterable, Iterator
from pathlib import Path

from simbench.bench.store.checksums import RunError
from simbench.detectors.errors import masked, printable
from simbench.files import FileError

LEASE = ".lease"
BEAT = 0.5  # s between two heartbeats
STALE = 5.0  # s without one, after which nobody works there
OLD = 3600.0  # s without a change, after which what is half-written belongs to nobody


@contextlib.contextmanager
def lease(folder: Path, subfolders: tuple[str, ...] = ("",)) -> Iterator[None]:
    """Hold a folder alone; what a dead holder left half-written goes, where nothing of it moved for
    `STALE` seconds.
    """
    file = folder / LEASE
    about = {
        "host": socket.gethostname(),
        "pid": os.getpid(),
        "since": time.strftime("%Y-%m-%d %H:%M:%S"),
        "command": printable(masked(" ".join(sys.argv)))[:200],
        "token": uuid.uuid4().hex,
    }
    folders = [folder / sub for sub in subfolders]
    while not _made(file, about):
        _wait_out(file, folders)
    made = file.stat().st_mtime_ns  # by the clock of whoever keeps the folder, as all others there
    _remove(f for f, (changed, _) in _temporaries(folders).items() if made - changed > OLD * 1e9)
    ended = threading.Event()
    beats = threading.Thread(target=_beat, args=(file, about, ended), daemon=True)
    beats.start()
    try:
        yield
    finally:
        ended.set()
        beats.join()
        with contextlib.suppress(OSError):
            if about["token"].encode() in file.read_bytes():
                file.unlink()


def _made(file: Path, about: dict) -> bool:
    try:
        file.parent.mkdir(exist_ok=True)  # the holder before may have removed it when it was done
        with open(file, "xb") as f:
            try:
                f.write(_text(about, 0))
                f.flush()
            except OSError:  # a lease without a holder, as a full disk leaves it, delays others
                file.unlink()
                raise
    except FileExistsError:
        return False
    except OSError as error:
        why = (error.strerror or str(error)).lower()
        raise FileError(f"{file} cannot be written: {why}") from error
    return True


def _text(about: dict, beat: int) -> bytes:
    return json.dumps({**about, "beat": f"{beat:012d}"}).encode()


def _beat(file: Path, about: dict, ended: threading.Event) -> None:
    """Count on in the file: its content, unlike its time, is what another machine reads fresh."""
    beat = 0
    while not ended.wait(BEAT):
        beat += 1
        with contextlib.suppress(OSError), open(file, "r+b") as f:
            # else somebody took it over: this one had stopped for long
            if about["token"].encode() in f.read():
                f.seek(0)
                f.write(_text(about, beat))


def _wait_out(file: Path, folders: list[Path]) -> None:
    """Return once a lease that is there is gone, by itself or as stale; RunError as soon as it
    moves.
    """
    try:
        first = last = file.read_bytes()
        before, until = _temporaries(folders), time.monotonic() + STALE
        while last == first and time.monotonic() < until:
            time.sleep(BEAT)
            last = file.read_bytes()
        if last != first and last[:1] == b"{" and first[:1] == b"{":
            holder = json.loads(last)
            who = (
                f"process {holder['pid']} on {holder['host']} works there since {holder['since']}"
                f" ({holder['command']})"
            )
            raise RunError(
                f"{file.parent}: {who}; wait for its end, stop it, or choose another folder"
            )
        if last == first:
            # one of two that find it stale succeeds
            aside = file.with_name(f"{LEASE}.{uuid.uuid4().int}")
            file.rename(aside)
            if aside.read_bytes() != first:  # somebody else had taken it over since
                aside.rename(file)
                return
            _remove(
                f
                for f, state in _temporaries(folders).items()
                if before.get(f) == state or f == aside
            )
    except (OSError, ValueError, KeyError):  # it went, or was being made, meanwhile
        time.sleep(BEAT)


def _remove(files: Iterable[Path]) -> None:
    for file in files:
        with contextlib.suppress(OSError):
            file.unlink()


def _temporaries(folders: list[Path]) -> dict[Path, tuple[int, int]]:
    states = {}
    for file in (f for folder in folders for f in folder.glob(".*.[0-9]*")):
        with contextlib.suppress(OSError):
            about = file.stat()
            states[file] = (about.st_mtime_ns, about.st_size)
    return states
