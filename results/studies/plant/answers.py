"""What a study asks for hours, kept file by file: a killed command goes on where it stopped."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from simbench.files import whole_file


def answered(path: str | Path, ask: Callable[[], Any]) -> Any:
    """Return the answer kept in a file as JSON; where there is none yet, ask and keep it."""
    file = Path(path)
    if not file.exists():
        answer = ask()
        with whole_file(file) as f:
            json.dump(answer, f)
    return json.loads(file.read_text(encoding="utf-8"))
