"""The manifest of a run: what was run, with which versions and code, and whether old and new pieces
may be combined.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import platform
import shutil
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from simbench.bench.store.folder import NoRun, RunError, digest, write_file
from simbench.bench.store.tables import FORMAT
from simbench.files import local_path

MANIFEST = "manifest.json"
# in a run's folder: where methods are added to it, and there the run with them once it is whole
ADDING = ".adding"
WHOLE = "whole"
SOURCES = "plugins"  # folder of a run that holds the files of its plug-ins
_CHECKSUM = "checksum"
UNANSWERED = "unanswered"  # key of such a method: records that its file leaves out
FROM_FILE = "file"  # value of `answered` of a method whose answers were joined from a file
# what must be the same before old and new pieces may stand in one table
_BINDING = (
    "format",
    "grid_hash",
    "methods",
    "plugins",
    "code",
    "versions",
)
_LIBRARIES = ("stiction-simbench", "numpy", "scipy", "numba", "scikit-learn")

# files of this room that decide what the tables hold
_DECISIVE = ("motion", "oracle", "resolve", "tables", "truth", "work")


def describe(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return a manifest: the settings of a run, and the versions and code with which it is run."""
    return {
        "format": FORMAT,
        **settings,
        "code": code_hash(),
        "commit": _read_commit(),
        "versions": {
            "python": platform.python_version(),
            **{name: _installed_version(name) for name in _LIBRARIES},
        },
        "machine": f"{platform.system()} {platform.machine()}",
        "processor": processor(),
        "complete": False,
    }


def read_manifest(path: str | Path) -> dict[str, Any]:
    """Return the manifest of a run."""
    # the file as JSON
    folder = local_path(path)
    put_in_place(folder)
    file = folder / MANIFEST
    try:
        manifest = json.loads(file.read_bytes())
        written_in = manifest["format"]
    except (FileNotFoundError, NotADirectoryError):
        raise NoRun(f"{folder} holds no run: {MANIFEST} is missing") from None
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        if isinstance(error, json.JSONDecodeError):
            where = f", line {error.lineno}, column {error.colno},"
        else:
            where = ""
        raise RunError(
            f"{file}{where} is damaged; it must be JSON with a format version: restore it"
        ) from None
    except OSError as error:
        raise RunError(
            f"{file} cannot be read ({error.strerror or error}); a file of the run is needed there:"
            " restore it"
        ) from None

    # of today's format, and as it was written
    if written_in != FORMAT:
        raise RunError(
            f"{file} was written in format version {written_in!r:.60}; version {FORMAT} is needed:"
            " run it again"
        )
    plain = _without_checksum(manifest)
    if manifest.get(_CHECKSUM) != _checksum_of(plain):
        raise RunError(
            f"{file} is not as it was written: its checksum, {_checksum_of(plain)}, must be the one"
            f" that it states, {str(manifest.get(_CHECKSUM))[:16]!r}; restore it, or run it again"
        )
    return plain


def put_in_place(folder: Path) -> None:
    """Let the files of a run that was made in its folder, if there is one, take the place of those
    that are there, the manifest last; a call that was killed in it is ended by the next.
    """
    # nothing is begun in nearly all folders
    begun = folder / ADDING / WHOLE
    if not begun.is_dir():
        return

    # file by file, each at once, so that a kill leaves nothing half
    files = []
    for file in begun.rglob("*"):
        if file.is_file():
            files.append(file)
    for file in sorted(files, key=lambda file: file == begun / MANIFEST):
        place = folder / file.relative_to(begun)
        place.parent.mkdir(exist_ok=True)
        with contextlib.suppress(FileNotFoundError):  # two may do it at once
            file.replace(place)
    shutil.rmtree(folder / ADDING, ignore_errors=True)


def write_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest whole, with a checksum over all of it."""
    plain = _without_checksum(manifest)
    content = {**plain, _CHECKSUM: _checksum_of(plain)}
    write_file(folder / MANIFEST, json.dumps(content, indent=1, allow_nan=False).encode())


def _without_checksum(manifest: Mapping[str, Any]) -> dict[str, Any]:
    plain = dict(manifest)
    plain.pop(_CHECKSUM, None)
    return plain


def _checksum_of(plain: Mapping[str, Any]) -> str:
    # through JSON once: tuples become lists, keys become text, as they will be read
    return digest(json.dumps(json.loads(json.dumps(plain)), sort_keys=True).encode())


def run_key(manifest: Mapping[str, Any]) -> str:
    """Return a hash (16 hex digits) of everything that two pieces must share to be joined in one
    table.
    """
    return digest(json.dumps({key: manifest[key] for key in _BINDING}, sort_keys=True).encode())


def own_methods(manifest: Mapping[str, Any]) -> set[str]:
    """Return the names of plug-ins, and of detectors of the caller, that a run states."""
    return {name.removeprefix("own ") for name in manifest.get("plugins", ())}


def unmatched(manifest: Mapping[str, Any]) -> int:
    """Return how many healthy loops of a run are left out because they could not be matched with
    sticky ones.
    """
    planned = manifest.get("scenarios")
    done = manifest.get("counts", {}).get("scenarios")
    if manifest.get("complete") and planned and done:
        return planned - done
    return 0


def refuse_to_mix(where: Path, manifest: Mapping[str, Any]) -> None:
    """Raise RunError, with the difference, if the run on disk is not the one that is to be
    continued.
    """
    old = read_manifest(where)
    for key in _BINDING:
        if old.get(key) != manifest[key]:
            difference = _describe_difference(key, old.get(key), manifest[key])
            raise RunError(f"{where} cannot be resumed: {difference}")


def refuse_other_code(where: object, stated: Mapping[str, Any]) -> None:
    """Raise RunError, with the difference, if a run was made by other code or libraries than are
    here.
    """
    here = describe({})
    for key in ("code", "versions"):
        if stated[key] != here[key]:
            raise RunError(
                f"no method can be asked about the loops of {where}:"
                f" {_describe_difference(key, stated[key], here[key])}; run it again"
            )


@cache
def code_hash() -> str:
    """Return a hash (16 hex digits) of all source files that the tables of a run depend on, as they
    were when first read.
    """
    import simbench

    digest = hashlib.sha256()
    ours = Path(simbench.__path__[0])
    rooms = [
        ours / "detectors",
        ours / "scenarios",
        ours / "loop",
        ours / "theory",
        ours / "gap" / "effects",
    ]
    files = []
    for room in rooms:
        for file in sorted(room.rglob("*.py")):
            files.append(file)
    for file in files + [f for f in sorted((ours / "bench").rglob("*.py")) if f.stem in _DECISIVE]:
        digest.update(file.name.encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


@cache
def processor() -> dict[str, str]:
    """Return what numpy, BLAS and numba choose their code by on this machine: last bits of what
    detectors compute hang on it.
    """
    from llvmlite import binding
    from numba.core import config
    from numpy._core._multiarray_umath import __cpu_features__
    from threadpoolctl import threadpool_info

    def there(features: Mapping[str, bool]) -> str:
        return " ".join(sorted(name for name, is_there in features.items() if is_there))

    blas = set()
    with contextlib.suppress(OSError):  # a platform that does not tell which libraries are loaded
        blas = {x.get("architecture") for x in threadpool_info() if x["user_api"] == "blas"}
    named = config.CPU_NAME or binding.get_host_cpu_name()
    return {
        "numpy": there(__cpu_features__),
        "blas": " ".join(sorted(map(str, blas))),
        "numba": f"{named}: {there(binding.get_host_cpu_features())}",
    }


def _describe_difference(key: str, old: Any, new: Any) -> str:
    # A table: keys that go, come and change
    if isinstance(old, dict) and isinstance(new, dict):
        gone = [k for k in old if k not in new]
        come = [k for k in new if k not in old]
        if gone:
            changes = [f"the run has {', '.join(gone)}, which this command does not ask for"]
        else:
            changes = []
        if come:
            changes += [f"this command asks for {', '.join(come)}, which the run does not have"]
        for k in old:
            if k in new and old[k] != new[k]:
                changes.append(_describe_change(k, old[k], new[k]))
        verb = "differ" if key.endswith("s") else "differs"
        return f"{key} {verb}: {'; '.join(changes[:3])}"

    # A single value
    names = {"grid_hash": "the grid", "code": "the code"}
    return f"{names.get(key, key)} differs (was {old}, is {new})"


def _describe_change(name: str, old: Any, new: Any) -> str:
    """Say what changed of one entry: a nested one is named, not printed."""
    if isinstance(old, dict) and isinstance(new, dict):
        return (
            f"{name} has another"
            f" {' and '.join(k for k in {**old, **new} if old.get(k) != new.get(k))}"
        )
    return f"{name} was {old}, is {new}"


def _installed_version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "absent"


@cache
def _read_commit() -> str | None:
    """Return the commit of the checkout that this file is in, read without git."""
    # A working tree has its HEAD, a linked one elsewhere
    git = Path(__file__).resolve().parents[3] / ".git"
    try:
        if git.is_file():  # a linked working tree: its HEAD lies apart from the branches
            git = Path(git.read_text().removeprefix("gitdir:").strip())
        head = (git / "HEAD").read_text().strip()
        if not head.startswith("ref: "):
            return head

        # The branch that HEAD names
        shared = git / "commondir"
        return (
            ((git / shared.read_text().strip() if shared.exists() else git) / head[5:])
            .read_text()
            .strip()
        )
    except OSError:
        return None
