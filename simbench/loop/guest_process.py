"""The process of strangers' valves and effects: it imports their files, and computes whatever they take part in."""

from __future__ import annotations

import base64
import os
import sys
from typing import Any

import numpy as np

from detectors.errors import UserError
from detectors.host_process import serve
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import VALVES, Number

FOLDERS = {folder.kind: folder for folder in (VALVES, EFFECTS)}


def main() -> None:
    """Serve: `python -m simbench.loop.guest_process READ WRITE PARENT KIND=SOURCE ...`."""
    files = [word.partition("=") for word in sys.argv[4:]]
    known: list[str] = []

    def answer(asked: dict[str, Any]) -> Any:
        for kind, _, source in files[len(known) :]:
            known.append(FOLDERS[kind].add_file(source) if os.sep in source else source)
        if asked["do"] == "describe":
            return {"plain": _described(files[0][0], known[0])}
        function, arguments = asked["call"]
        try:
            return {"plain": plain(function(*arguments))}
        except UserError as error:
            return {"refused": str(error)}

    serve(answer)


def _described(kind: str, name: str) -> dict[str, Any]:
    module = FOLDERS[kind].load(name)
    if not isinstance(module.PARAMETERS, dict):
        raise TypeError(f"PARAMETERS is a {type(module.PARAMETERS).__name__}, a dict of Number and Choice is needed")
    rules = {str(key): {"number": isinstance(rule, Number), **vars(rule)} for key, rule in module.PARAMETERS.items()}
    said = {word: getattr(module, word) for word in ("SOURCE", "FRICTION", "BLOCK", "ACTS") if hasattr(module, word)}
    return {**said, "doc": module.__doc__ or "", "PARAMETERS": rules}


def plain(value: Any) -> Any:
    """Return tables, lists, words and numbers of Python's; an array of numbers as the text of its bytes.

    Examples
    --------
    >>> plain({"mv": np.zeros(1), "S": np.float64(2.0)})
    {'mv': {'float64': 'AAAAAAAAAAA='}, 'S': 2.0}
    """
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return {"float64": base64.b64encode(np.ascontiguousarray(value, dtype="<f8").tobytes()).decode()}
    return value.item() if isinstance(value, np.generic) else value


if __name__ == "__main__":
    main()
