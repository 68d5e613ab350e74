"""The process of one guest: it imports a stranger's detector, and answers in plain values through two pipes."""

from __future__ import annotations

import json
import os
import pickle
import resource
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from detectors.judge import judge_one
from detectors.method import Method
from detectors.plugins.registry import methods
from detectors.prepared import Prepared
from detectors.verdict import Verdict


def serve(answer: Callable[[dict[str, Any]], Any]) -> None:
    """Answer questions until the parent is gone: `python -m MODULE READ WRITE PARENT ...`.

    Parameters
    ----------
    answer : callable
        From a question to plain values; whatever it raises is answered as the reason why there are none.
    """
    read, write, parent = int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    os.write(write, struct.pack("<Q", 0))  # it lives
    limit = None
    while True:
        asked = _receive(read)
        if asked["bytes"] != limit:
            limit = asked["bytes"]
            resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
        # should nobody be left to end it, and no line of Python be reached
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, 2.0 * asked["seconds"] + 60.0)
        try:
            text = json.dumps({"answer": answer(asked)}).encode()
        except MemoryError:
            text = json.dumps({"error": "takes more memory than it may"}).encode()
        except BaseException as error:  # whatever a stranger's code does, sys.exit too
            text = json.dumps({"error": _said(error)}).encode()
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        content = struct.pack("<Q", len(text)) + text
        while content:
            content = content[os.write(write, content) :]


def main() -> None:
    """Serve one detector: `python -m detectors.host_process READ WRITE PARENT SOURCE`."""
    methods.entry_host = None
    source, name = sys.argv[4], ""

    def answer(asked: dict[str, Any]) -> Any:
        nonlocal name
        name = name or (methods.add_file(source) if os.sep in source else source)
        return _described(name) if asked["do"] == "describe" else _judged(name, asked)

    serve(answer)


def _said(error: BaseException) -> str:
    # a plug-in's own sentence about itself needs no name of a Python class
    cause = error.__cause__ if error.__cause__ is not None else error
    try:
        return " ".join(f"{type(cause).__name__}: {cause}".split())[:300]
    except BaseException:  # an error whose text raises another
        return type(cause).__name__


def _described(name: str) -> Any:
    method = methods.load(name).METHOD
    if not isinstance(method, Method):
        return None
    return {**asdict(method), "exempt": {}}


def _judged(name: str, asked: dict[str, Any]) -> list[Any]:
    prepared = Prepared(asked["record"], asked["front_end"], part=asked["part"])
    for signal_ in (prepared.record.op, prepared.record.pv, prepared.record.sp, prepared.record.mv):
        if signal_ is not None:
            signal_.flags.writeable = False
    prepared.__dict__.update(asked["known"])
    found = []
    for raw in asked["modes"]:
        verdict = judge_one(name, methods.load(name), prepared, raw, dict(asked["thresholds"]))
        if not isinstance(verdict, Verdict):
            raise TypeError(f"answers with a {type(verdict).__name__}, which is no Verdict")
        if verdict.reason.startswith((" ", ";")):  # notes of the house follow a reason that is none
            raise ValueError("answers without a reason")
        found.append({k: _plain(v) for k, v in vars(verdict).items()})
    return found


def _plain(value: Any) -> Any:
    """Numbers of numpy as Python's; what is neither a number, a word nor a table of them stays and fails to be written."""
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    return value.item() if hasattr(value, "item") else value


def _receive(read: int) -> dict[str, Any]:
    """Wait for a question: its size, 8 bytes, then what it says; the next one comes after the answer alone."""
    content = memoryview(bytearray(8))
    _fill(read, content)
    content = memoryview(bytearray(struct.unpack("<Q", content)[0]))
    _fill(read, content)
    return pickle.loads(content)


def _fill(read: int, place: memoryview) -> None:
    while place:
        count = os.readv(read, [place])
        if not count:
            os._exit(0)
        place = place[count:]


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(0)


if __name__ == "__main__":
    main()
