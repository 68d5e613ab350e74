"""Compute many independent answers in parallel and keep them on disk; an interrupted or later call
computes only what is missing.
"""

from __future__ import annotations

import json
from base64 import b64decode, b64encode
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_type_hints

import joblib
import numpy as np
from joblib import Parallel, delayed
from pydantic import BaseModel

import simbench
from simbench.bench.store.checksums import with_checksum, without_checksum
from simbench.detectors.errors import UserError
from simbench.files import folder, whole_file
from simbench.progress import Progress
from simbench.safe_path import safe_path

_NAMED = "of"  # key under which an encoded object names its class


def resumed(
    ask: Callable[..., Any],
    about: Sequence[tuple[Any, ...]],
    *,
    jobs: int,
    keep: str | Path | None,
    what: str,
) -> list[Any]:
    """Ask of each in turn, in several processes, and return the answers in order.

    Answers that this very code gave to the same questions are read from `keep`; those that no
    question asks for are removed.
    """
    calls = [delayed(ask)(*a) for a in about]
    if keep is not None:
        # processes that live on from another call may stand in another folder
        place = folder(Path(keep).absolute())
        files = [place / f"{ask.__name__}-{joblib.hash((_code(), a))}.json" for a in about]
        for other in set(place.glob(f"{ask.__name__}-*.json")) - set(files):
            other.unlink(missing_ok=True)
        calls = [delayed(_kept)(ask, file, a) for file, a in zip(files, about, strict=True)]
    workers = min(jobs, max(len(about), 1)) if jobs > 0 else jobs
    with safe_path(), Parallel(n_jobs=workers, return_as="generator") as parallel:
        return list(Progress(parallel(calls), total=len(about), desc=what))


@cache
def _code() -> str:
    """Return what changes with any line of the sources that answer."""
    ours = Path(simbench.__path__[0])
    rooms = (ours / "detectors", ours / "scenarios", ours)
    return str(joblib.hash([f.read_bytes() for room in rooms for f in sorted(room.rglob("*.py"))]))


def _kept(ask: Callable[..., Any], file: Path, about: tuple[Any, ...]) -> Any:
    """Return the answer in a file; where there is none, or not what was written, ask and keep
    it.
    """
    try:
        content = without_checksum(json.loads(file.read_text(encoding="utf-8")), file)
        return _decoded(content["answer"], _classes(get_type_hints(ask)["return"]))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, UserError):
        answer = ask(*about)
    with whole_file(file) as f:
        f.write(json.dumps(with_checksum({"answer": _encoded(answer)})))
    return answer


@cache
def _classes(hint: Any) -> dict[str, type]:
    """Return the data classes and models that an annotation speaks of, and those of their
    fields, by name.
    """
    classes, todo = {}, [hint]
    while todo:
        hint = todo.pop()
        todo += get_args(hint)
        if (
            isinstance(hint, type)
            and (is_dataclass(hint) or issubclass(hint, BaseModel))
            and hint not in classes.values()
        ):
            classes[hint.__name__] = hint
            todo += get_type_hints(hint).values()
    return classes


def _encoded(value: Any) -> Any:
    if isinstance(value, (list, tuple, dict)):
        many = [[k, v] for k, v in value.items()] if isinstance(value, dict) else value
        inside = [_encoded(v) for v in many]
        return inside if isinstance(value, list) else {_NAMED: type(value).__name__, "with": inside}
    if isinstance(value, np.ndarray):
        content = b64encode(value.tobytes()).decode()
        return {_NAMED: "ndarray", "with": content, "dtype": value.dtype.str, "shape": value.shape}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, BaseModel) or is_dataclass(value):
        names = (
            type(value).model_fields
            if isinstance(value, BaseModel)
            else [f.name for f in fields(value) if f.init]
        )
        return {
            _NAMED: type(value).__name__,
            "with": {name: _encoded(getattr(value, name)) for name in names},
        }
    return value


def _decoded(value: Any, classes: dict[str, type]) -> Any:
    if isinstance(value, list):
        return [_decoded(v, classes) for v in value]
    if not isinstance(value, dict):
        return value
    name, inside = value[_NAMED], value["with"]
    if name == "ndarray":
        return np.frombuffer(b64decode(inside), dtype=value["dtype"]).reshape(value["shape"]).copy()
    if name in ("tuple", "dict"):
        return {"tuple": tuple, "dict": dict}[name](_decoded(inside, classes))
    return classes[name](**{k: _decoded(v, classes) for k, v in inside.items()})
