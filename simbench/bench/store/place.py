"""Access the place of a run: a local folder, or a URL that fsspec can reach."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from simbench.detectors.errors import masked, nearest
from simbench.files import URL, FileError, whole_file
from simbench.files import folder as make_folder


class Place:
    """A folder of this machine; every file in it appears whole or not at all."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.url = str(folder)  # what names it to `place_of`, passwords and all

    def __str__(self) -> str:
        return str(self._folder)

    @property
    def local(self) -> Path | None:
        """The folder, where it is one of this machine."""
        return self._folder

    def absolute(self) -> Place:
        """Return the same place for a process that may stand in another folder."""
        return Place(self._folder.absolute())

    def read(self, name: str) -> bytes:
        """Return a file's content; raises OSError."""
        return (self._folder / name).read_bytes()

    def write(self, name: str, content: bytes) -> None:
        """Write a file, and the folders above it; raises FileError."""
        file = self._folder / name
        make_folder(file.parent)
        with whole_file(file, "wb") as f:
            f.write(content)

    def names(self, sub: str = "") -> list[str]:
        """Return the names in a folder, sorted, those that begin with a dot left out; none when
        there is no folder.
        """
        folder = self._folder / sub
        return (
            sorted(f.name for f in folder.iterdir() if not f.name.startswith("."))
            if folder.is_dir()
            else []
        )

    def refuse_unkept(self) -> None:
        """Raise FileError where what is written cannot be listed and read back; a folder of this
        machine can.
        """

    def remove(self, sub: str) -> None:
        """Remove a folder and all in it, if it is there."""
        shutil.rmtree(self._folder / sub, ignore_errors=True)


class _RemotePlace(Place):
    """A folder with a URL, in memory, a bucket or elsewhere; FileError when nobody reads and
    writes its scheme.
    """

    def __init__(self, scheme: str, path: str) -> None:
        self.url = f"{scheme}://{path.rstrip('/')}"
        try:
            import fsspec
            from fsspec.registry import available_protocols
        except ImportError:
            raise FileError(
                f"{self} is no folder of this machine, and fsspec, which reaches others, is not"
                " installed: pip install 'stiction-simbench[remote]'"
            ) from None
        if scheme not in available_protocols():
            raise FileError(
                f"{self} cannot be written: scheme {scheme!r} is unknown:"
                f" {nearest(scheme, available_protocols())}"
            )
        try:
            self._files, self._root = fsspec.core.url_to_fs(self.url)
        except Exception as error:  # each scheme's library has other errors
            # one that only wraps another
            reason = (
                "it is no place by itself"
                if isinstance(error, (TypeError, AttributeError))
                else _reason(error)
            )
            raise FileError(
                f"{self} cannot be reached: {reason}; a place that can be written is needed"
            ) from None

    def __str__(self) -> str:
        return masked(self.url)

    @property
    def local(self) -> None:
        """Nothing: it is no folder of this machine."""
        return None

    def absolute(self) -> Place:
        """Return itself."""
        return self

    def _do(self, what: str, name: str, *more: Any) -> Any:
        try:
            return getattr(self._files, what)(f"{self._root}/{name}".rstrip("/"), *more)
        except FileNotFoundError:
            raise
        except Exception as error:
            raise FileError(f"{self}/{name}: {what} failed: {_reason(error)}") from None

    def read(self, name: str) -> bytes:
        """Return a file's content; raises OSError."""
        return self._do("cat_file", name)

    def write(self, name: str, content: bytes) -> None:
        """Write a file; raises FileError."""
        try:
            self._do("pipe_file", name, content)
        except (FileNotFoundError, FileError):  # where folders are not made by writing into them
            self._do("makedirs", name.rpartition("/")[0], True)
            self._do("pipe_file", name, content)

    def names(self, sub: str = "") -> list[str]:
        """Return the names in a folder, sorted; none when there is no folder."""
        try:
            # what was listed before others wrote is no listing
            self._files.invalidate_cache()
            paths = self._do("ls", sub, False)
        except FileNotFoundError:
            return []
        names = (path.rstrip("/").rsplit("/", 1)[-1] for path in paths)
        return sorted(n for n in names if not n.startswith("."))

    def refuse_unkept(self) -> None:
        """Raise FileError where what is written cannot be listed, read back and removed, before
        anything is simulated.
        """
        try:
            self.write("trial/whole", b"whole")
            kept = self.names("trial") == ["whole"] and self.read("trial/whole") == b"whole"
            self.remove("trial")
            if kept and not self.names("trial"):
                return
            why = "what is written there reads back otherwise"
        except OSError as error:
            why = str(error)
        raise FileError(
            f"{self} keeps no run ({why}); a place that can be written, listed and read is needed"
        )

    def remove(self, sub: str) -> None:
        """Remove a folder and all in it, if it is there."""
        if self.names(sub):
            self._do("rm", sub, True)


def place_of(path: str | Path | Place) -> Place:
    """Return the place a path or URL names."""
    if isinstance(path, Place):
        return path
    url = URL.match(str(path))
    if url is None:
        return Place(Path(path))
    if url[1] in ("file", "local"):
        return Place(Path(f"/{url[2]}"))
    return _RemotePlace(url[1], url[2])


def _reason(error: Exception) -> str:
    return masked(" ".join(str(error).split())) or type(error).__name__
