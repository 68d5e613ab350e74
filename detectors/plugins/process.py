"""The process of third-party plug-ins: `python -m detectors.plugins.process`, which knows nothing but what it is asked.

Where the system can fork, it is two: one that ends whatever is left, and below it one that imports and answers.
"""

from __future__ import annotations

import base64
import contextlib
import ctypes
import gc
import json
import mmap
import os
import pickle
import select
import shutil
import signal
import struct
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from detectors.errors import UserError

_SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER of Linux: what loses its parent below this process becomes its child
_END_SECONDS = 4.0  # s for all that a plug-in started to end
_FORKS = hasattr(os, "fork")
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
# what changes files, and at which of its arguments they stand
_CHANGES = {
    **dict.fromkeys(("chmod", "chown", "mkdir", "remove", "rmdir", "setxattr", "removexattr", "truncate", "utime"), (0,)),
    **dict.fromkeys(("link", "rename"), (0, 1)), "symlink": (1,),
}  # fmt: skip
STARTS = ("subprocess.Popen", "os.system", "os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn", "os.startfile")
_TALKS = ("connect", "bind", "sendto", "sendmsg", "getaddrinfo", "gethostbyname")
# what a detector may import of the benchmark: its public names that stand in `detectors`
_KNOWN = ("simbench", "simbench.lazy")
_TRUTH = ("simbench", "scenarios", "results")  # beside `detectors`: what simulates a grid again, or has its labels
_HARMLESS = ("/proc/cpuinfo", "/proc/meminfo")  # of the machine; libraries read these, and their own process's maps
_WATCHED = ("open", "import", "os.", "socket.", "subprocess.")

_asked = mmap.mmap(-1, 8)  # shared by both processes: which copy answers at the moment
_unwalled = [False]  # while this file works itself
_refused: list[str] = []


def main() -> None:
    """Answer questions from stdin on stdout until there are no more."""
    read, write, null = os.dup(0), os.dup(1), os.open(os.devnull, os.O_RDWR)
    for handle in (0, 1, 2):
        os.dup2(null, handle)
    folder = tempfile.mkdtemp(prefix="simbench-plugin-")
    os.environ.update(dict.fromkeys(("TMPDIR", "TEMP", "TMP", "MPLCONFIGDIR"), folder))
    tempfile.tempdir = folder
    os.chdir(folder)
    try:
        (_supervise if _FORKS else _serve)(read, write)
    finally:
        os.chdir(os.path.dirname(folder))
        shutil.rmtree(folder, ignore_errors=True)


def _supervise(read: int, write: int) -> None:
    """Let a copy answer; when it, the run or the run's patience ends, end all that is left and say how and how many."""
    adopts, run = _adopts(), os.getppid()
    wake, woken = os.pipe()
    os.set_blocking(woken, False)
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)
        try:
            _serve(read, write, _adopts())
        finally:
            os._exit(0)
    os.close(read)
    stop: list[int] = []
    signal.set_wakeup_fd(woken)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.signal(signal.SIGTERM, lambda *_: stop.append(1))
    done, status = os.waitpid(child, os.WNOHANG)
    while not done and not stop and os.getppid() == run:
        if select.select([wake], [], [], 0.5)[0]:
            os.read(wake, 64)
        done, status = os.waitpid(child, os.WNOHANG)
    with contextlib.suppress(OSError):
        os.killpg(child, signal.SIGKILL)
    left = _end_children({child, *struct.unpack("<Q", _asked[:])}) if adopts else 0
    with contextlib.suppress(OSError):
        _send(write, json.dumps({"ended": _way(status) if done else "", "left": left}).encode())


def _serve(read: int, write: int, adopts: bool = False) -> None:
    _send(write, _answer(lambda: _settled(pickle.loads(_received(read)))))
    said = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115  of every copy in turn: to make one each time costs as much as a fork
    while True:
        question, most, fork = pickle.loads(_received(read))

        def work(packed: bytes = question) -> Any:
            function, arguments = pickle.loads(packed)
            return function(*arguments)

        content = _copy_answers(read, write, said, work, most) if fork and _FORKS else _answer(work)
        left = _end_children(set()) if adopts else 0
        if left:
            content = json.dumps({"error": f"left {left} process{'es' * (left > 1)} behind, which had to be ended"}).encode()
        _send(write, content if len(content) <= most else b"")


def _copy_answers(read: int, write: int, answer: IO[bytes], work: Callable[[], Any], most: int) -> bytes:
    """Let a copy of this process answer: what it remembers of the question goes with it."""
    _unwalled[0] = True
    gc.freeze()  # a collection in the copy would touch, and so copy, every object
    child = os.fork()
    _unwalled[0] = False
    if child == 0:
        os.close(read)
        os.close(write)
        status = 1
        with contextlib.suppress(BaseException):
            content = _answer(work)
            while content:
                content = content[answer.write(content) :]
            status = 0
        os._exit(status)
    _asked[:] = struct.pack("<Q", child)
    status = os.waitpid(child, 0)[1]
    answer.seek(0)
    content = answer.read(most + 1)
    answer.seek(0)
    answer.truncate()
    return content if content and not status else json.dumps({"error": f"ended its process ({_way(status)})"}).encode()


def _answer(work: Callable[[], Any]) -> bytes:
    said: dict[str, Any]
    try:
        said = {"answer": plain(work())}
        json.dumps(said)
    except MemoryError:
        said = {"error": "takes more memory than it may"}
    except BaseException as error:  # whatever the code of others does, sys.exit too
        said = {"error": _sentence(error), "refusal": str(error) if isinstance(error, UserError) else None}
    said["refused"] = list(dict.fromkeys(_refused))
    _refused.clear()
    return json.dumps(said).encode()


def plain(value: Any) -> Any:
    """Return tables, lists, words and numbers of Python's; an array as its bytes in text, an object as its fields."""
    if is_dataclass(value):
        value = {f.name: getattr(value, f.name) for f in fields(value)}
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return {"float64": base64.b64encode(np.ascontiguousarray(value, dtype="<f8").tobytes()).decode()}
    return value.item() if isinstance(value, np.generic) else value


def _sentence(error: BaseException) -> str:
    # a plug-in's own sentence about itself needs no name of a Python class
    cause = error.__cause__ if error.__cause__ is not None else error
    try:
        return " ".join(f"{type(cause).__name__}: {cause}".split())[:300]
    except BaseException:  # an error whose text raises another
        return type(cause).__name__


def _settled(rules: dict[str, Any]) -> list[str]:
    """Set limits and walls before anything of others is imported; return what this platform lacks, in sentences."""
    sys.dont_write_bytecode = True
    lacking = [] if _FORKS else ["a plug-in may remember here what it was asked before: this platform cannot fork"]
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (rules["bytes"],) * 2)
    except ImportError:
        lacking.append("plug-ins have no limit on memory here: this platform has none")
    from detectors.compiled import _cache_folder

    sys.addaudithook(_wall(rules["folders"], [os.getcwd(), str(_cache_folder())], rules["detector"]))
    return lacking


def _wall(folders: list[str], trees: list[str], detector: bool) -> Callable[[str, tuple], None]:
    """Return the audit hook that no Python code can take away: what a plug-in may not do raises, and is noted."""
    roots = tuple(map(os.path.realpath, [*trees, *(os.path.join(f, "__pycache__") for f in folders)]))
    beside = {os.path.realpath(f) for f in folders}
    house = os.path.realpath(Path(__file__).parents[2]) + os.sep
    truth = tuple(house + room + os.sep for room in _TRUTH)

    def real(path: Any) -> str:
        return "" if path is None or isinstance(path, int) else os.path.realpath(os.fsdecode(path))

    def foreign(path: str) -> bool:
        if path in ("", os.devnull) or os.path.dirname(path) in beside:
            return False
        if path.startswith(house) and f"{os.sep}__pycache__" in path:  # numba's, of the simulator's own kernels
            return detector
        return not any(path == r or path.startswith(r + os.sep) for r in roots)

    def wish(event: str, args: tuple) -> str | None:
        if event == "import":
            name = args[0]
            known = not detector or name.partition(".")[0] not in ("simbench", "scenarios") or name in _KNOWN
            return None if known else f"import {name}: a detector sees records alone"
        if event in ("open", "os.listdir", "os.scandir", "os.chdir"):
            path = real(args[0])
            if (path + os.sep).startswith("/proc/") and path not in (f"/proc/{os.getpid()}/maps", *_HARMLESS):
                return f"look at {path}"
            # what `import simbench` itself reads
            public = os.path.basename(path).partition(".")[0] in ("__init__", "lazy")
            if detector and event == "open" and path.startswith(truth) and not public:
                return f"look at {path}: a detector sees records alone"
            # a folder that is held open would hide where a name in it leads
            held = event == "open" and args[1] is None and os.path.isdir(path)
            return f"write {path}" if event == "open" and (args[2] & _WRITES or held) and foreign(path) else None
        if event in STARTS:
            return f"start a process ({event})"
        if event in ("os.kill", "os.killpg"):
            return "end another process" if args[0] != os.getpid() else None
        room, _, deed = event.partition(".")
        if room == "socket":
            return f"use the network ({event})" if deed in _TALKS else None
        touched = [real(args[k]) for k in _CHANGES.get(deed, ())] if room == "os" else []
        return next((f"{deed} {path}" for path in touched if foreign(path)), None)

    def hook(event: str, args: tuple) -> None:
        if _unwalled[0] or not event.startswith(_WATCHED):
            return
        why = wish(event, args)
        if why is not None:
            _refused.append(f"may not {why}")
            raise PermissionError(f"a plug-in may not {why}")

    return hook


def _adopts() -> bool:
    """Make what loses its parent below this process its child, where the platform can."""
    with contextlib.suppress(OSError, AttributeError):
        return os.path.exists("/proc/self/stat") and ctypes.CDLL(None).prctl(_SUBREAPER, 1, 0, 0, 0) == 0
    return False


def _end_children(own: set[int]) -> int:
    """End every process below this one, wherever it put itself; return how many there were beside its own."""
    found: set[int] = set()
    until = time.monotonic() + _END_SECONDS
    _unwalled[0] = True
    try:
        while time.monotonic() < until:
            if not os.waitpid(-1, os.WNOHANG)[0]:
                below = _below(os.getpid())
                found |= below
                for pid in below:
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(pid, signal.SIGKILL)
                time.sleep(0.002)
    except ChildProcessError:  # none is left
        pass
    finally:
        _unwalled[0] = False
    return len(found - own)


def _below(top: int) -> set[int]:
    children: dict[int, list[int]] = {}
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            parent = int(file.read_bytes().rpartition(b")")[2].split()[1])
            children.setdefault(parent, []).append(int(file.parent.name))
    found, todo = set(), [top]
    while todo:
        some = children.get(todo.pop(), [])
        found |= set(some)
        todo += some
    return found


def _way(status: int) -> str:
    code = os.waitstatus_to_exitcode(status)
    return f"signal {-code}" if code < 0 else f"exit status {code}"


def _received(read: int) -> bytes:
    """Wait for a question, behind its size in 8 bytes; end with the run."""
    return _taken(read, struct.unpack("<Q", _taken(read, 8))[0])


def _taken(read: int, size: int) -> bytes:
    content = bytearray()
    while len(content) < size:
        part = os.read(read, min(size - len(content), 1 << 20))
        if not part:
            raise SystemExit
        content += part
    return bytes(content)


def _send(write: int, content: bytes) -> None:
    left = memoryview(struct.pack("<Q", len(content)) + content)
    while left:
        left = left[os.write(write, left) :]


if __name__ == "__main__":
    main()
