"""The program in a plug-in's worker process, started by `Host`:
`python -m simbench.detectors.plugins.process BYTES MESSAGE FOLDER`.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import shutil
import sys
import threading
import time

from simbench.detectors.errors import AnswerError, UserError

_LONGEST = 300  # characters of an error's text


def main() -> None:
    """Answer questions from stdin on stdout until there are no more."""
    memory, most = map(int, sys.argv[1:3])
    source = os.fdopen(os.dup(0), "rb")
    sink = os.fdopen(os.dup(1), "wb")
    null = os.open(os.devnull, os.O_RDWR)
    for handle in (0, 1, 2):  # what the plug-in prints mixes with no answer
        os.dup2(null, handle)
    # a process that a plug-in leaves running must not hold the pipes open
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(
            after_in_child=lambda: os.closerange(source.fileno(), sink.fileno() + 1)
        )
    with contextlib.suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    sys.dont_write_bytecode = True
    threading.Thread(target=_watch, args=(os.getppid(), sys.argv[3]), daemon=True).start()
    with contextlib.suppress(EOFError):
        while True:
            pickle.dump(_answer(pickle.load(source), most), sink)
            sink.flush()
    os._exit(0)


def _watch(parent: int, folder: str) -> None:
    """End with the run, whatever the plug-in is doing then."""
    while os.getppid() == parent:
        time.sleep(1.0)
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)


def _answer(question: bytes, most: int) -> bytes:
    """Return a pickled pair: the kind of error, empty where there is none, and its text or the
    answer.
    """
    try:
        function, arguments = pickle.loads(question)
        answer = pickle.dumps(("", function(*arguments)))
        failure = ("failed", f"answers with {len(answer)} bytes; at most {most} are allowed")
        if len(answer) <= most:
            return answer
    except MemoryError:
        failure = ("failed", "takes more memory than it may")
    except UserError as error:
        failure = ("form" if isinstance(error, AnswerError) else "refused", str(error))
    except BaseException as error:  # whatever the code of others does, sys.exit too
        failure = ("failed", _sentence(error))
    return pickle.dumps(failure)


def _sentence(error: BaseException) -> str:
    try:
        return f"{type(error).__name__}: {error}"[:_LONGEST]
    except BaseException:  # an error whose text raises another
        return type(error).__name__


if __name__ == "__main__":
    main()
