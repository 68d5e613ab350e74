"""Simulate what every available test would show for each record of a blind test; each result is
packed, opened on request, and logged.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

from results.studies.withheld import menu
from simbench.detectors.errors import ParameterError
from simbench.files import folder, whole_file
from simbench.loop.effects import NONE
from simbench.safe_path import safe_path

TESTS, OPENED, OPENED_LOG = "tests", "opened", "opened.csv"
_SEED = 9000  # added to a record's seed, with the test's place on the menu: other load, other noise


def write_whole(file: Path, content: str | bytes) -> None:
    """Write whole or not at all: a call that is cut off can be resumed."""
    with whole_file(file, "w" if isinstance(content, str) else "wb") as f:
        f.write(content)


def write(out: Path, test: Callable[..., Any], items: Mapping[str, Any], jobs: int) -> None:
    """Write tests/ID-TEST.sealed of every record and test."""
    place = folder(out / TESTS)
    asked = [delayed(_write)(place, test, name, item) for name, item in items.items()]
    with safe_path():
        Parallel(n_jobs=jobs)(asked)


def _write(place: Path, test: Callable[..., Any], name: str, item: Any) -> None:
    for id_ in menu.MENU:
        sealed = zlib.compress(json.dumps(outcome(test, item, id_)).encode())
        write_whole(place / f"{name}-{id_}.sealed", sealed)


def outcome(test: Callable[..., Any], item: Any, id_: str) -> dict[str, str]:
    """Return the two files of one test on a drawn record, as texts."""
    a, plan = item.answer, menu.plan(id_, item.columns, item.baseline)
    known = (a["effect"], a["effect2"]) if not a.get("foreign") else (a["foreign"], "")
    acts = [
        {"effect": e, "parameters": a[p]}
        for e, p in zip(known, ("parameters", "parameters2"))
        if e not in ("", NONE)
    ]
    columns = test(a, acts, int(a["seed"]) + _SEED + menu.MENU.index(id_), plan)
    Ts = float(item.baseline["sampling"]["Ts"])
    return {"csv": menu.csv_of(columns), "toml": menu.settings_toml(plan.settings(Ts))}


def open_one(out: Path, name: str, id_: str, order: int) -> Path:
    """Open one test of a record, log it, and return the record it shows; its settings lie next to
    it.
    """
    sealed = out / TESTS / f"{name}-{id_}.sealed"
    if not sealed.exists():
        raise ParameterError(
            f"withheld: {out} holds no tests; make them with `gap withheld make --tests`"
        )
    log = out / OPENED_LOG
    rows = log.read_text(encoding="utf-8") if log.exists() else "id,order,test\n"
    if f"{name},{order},{id_}\n" not in rows:
        write_whole(log, f"{rows}{name},{order},{id_}\n")
    return shown(
        folder(out / OPENED), f"{name}-{id_}", json.loads(zlib.decompress(sealed.read_bytes()))
    )


def shown(place: Path, name: str, texts: Mapping[str, str]) -> Path:
    """Write the two files of a test and return its record."""
    for kind in ("toml", "csv"):
        write_whole(place / f"{name}.{kind}", texts[kind])
    return place / f"{name}.csv"
