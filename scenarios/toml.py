"""Loop and grid files as text, and the hash of what they say."""

from __future__ import annotations

import hashlib
import json
import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from simbench.scenarios.columns import with_columns
from simbench.scenarios.errors import SpecError

# a key of a hundred parts with points between
_DEEP = re.compile(r"""(?<![\w"'-])(?:[\w"'-]++\s*+\.\s*+){100}""")


def toml_of(table: Mapping[str, Any]) -> str:
    """Return a loop's table as the text of a loop file."""
    lines = []
    for section, content in table.items():
        for part in content if isinstance(content, list) else [content]:
            lines.append(f"[[{section}]]" if isinstance(content, list) else f"[{section}]")
            lines += [f"{key} = {_toml_value(value)}" for key, value in part.items()]
            lines.append("")
    return "\n".join(lines)


def read_loop(path: str | Path) -> dict[str, Any]:
    """Read the table of a loop file, with the columns of the files that it names."""
    return with_columns(read_toml(path), Path(path).parent, str(path))


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file or say in one sentence why not."""
    # a pipe would be waited for
    if (file := Path(path)).exists() and not file.is_file() and not file.is_dir():
        raise SpecError(f"{path} is no file; a TOML file is needed")
    try:
        text = Path(path).read_text(encoding="utf-8")
        if _DEEP.search(text):  # which takes the parser the square of its depth
            raise RecursionError
        return tomllib.loads(text)
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise SpecError(f"{path} is a folder; a TOML file is needed") from None
    except UnicodeDecodeError:
        raise SpecError(f"{path} is no UTF-8 text; a TOML file is needed") from None
    except OSError as error:
        raise SpecError(f"{path} cannot be read: {error.strerror}") from None
    except tomllib.TOMLDecodeError as error:
        raise SpecError(
            f"{path} is no valid TOML: {error}; lines of NAME = VALUE and [SECTION] are needed"
        ) from None
    except RecursionError:
        raise SpecError(
            f"{path} cannot be read: its values are nested too deeply; some ten levels are allowed"
        ) from None
    except ValueError:  # Python's own limit on whole numbers
        raise SpecError(
            f"{path} cannot be read: it holds a number of more than 4300 digits; shorter ones are"
            " needed"
        ) from None


def content_hash(content: Any) -> str:
    """Return 16 hex digits that identify a nested table of numbers and names."""
    text = json.dumps(_canonical_form(content), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _toml_value(value: Any) -> str:
    """Write one value in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_toml_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, float) and math.isinf(value):
        return "inf" if value > 0 else "-inf"
    return repr(value)


def _canonical_form(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _canonical_form(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_canonical_form(v) for v in value]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return repr(float(value))
    return value
