"""Plug-ins by name: the files of a folder, entry points of other distributions, and single files a user points at."""

from __future__ import annotations

import importlib
import importlib.util
import os
import pkgutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from detectors.errors import ParameterError, UnknownName, UserError
from detectors.method import Method
from detectors.plugins.host import SECONDS, Host
from detectors.plugins.rebuilt import method_of


class PluginFolder:
    """The plug-ins of one kind; a plug-in is a module, its name is its file name.

    `package` holds the built-in ones, `group` is the entry-point group by which other distributions add theirs, `required` are
    the attributes each must have, `reserved` names that mean something else where plug-ins are named.
    """

    def __init__(self, kind: str, package: str, group: str, required: tuple[str, ...], reserved: tuple[str, ...] = ()) -> None:
        self.kind = kind
        self.package = package
        self.group = group
        self.required = required
        self.reserved = reserved
        # (file or published name, seconds) -> the process in which it lives, which has a `stub()` to stand for it here
        self.make_host: Callable[[Path | str, float], Any] = _no_host
        self.host_entries = False  # whether what another distribution publishes lives in such a process; else imported here
        self._hosts: dict[str, tuple[tuple, Any]] = {}  # with the file they were made of
        self._above: dict[str, str] = {}
        self._files: dict[str, ModuleType] = {}
        self._loaded: dict[str, ModuleType] = {}

    def names(self) -> list[str]:
        """Return every known name, sorted; nothing is imported."""
        return sorted(self._own | set(self._entry_points) | set(self._files))

    def lend(self, name: str, module: str) -> None:
        """Make a plug-in of the house known that needs more than this package; it is asked for by name alone, in no set."""
        if importlib.util.find_spec(module.partition(".")[0]) is not None:
            self._above[name] = module

    @property
    def lent(self) -> list[str]:
        """Plug-ins that are asked for by name alone."""
        return sorted(self._above)

    def load(self, name: str) -> ModuleType:
        """Import one plug-in by its id; UnknownName with the nearest known names, ParameterError when it lacks a required
        attribute."""
        if name in self._files:
            return self._files[name]
        if name not in self._loaded:
            if name not in self._above and name not in self.names():
                raise UnknownName(self.kind, name, sorted({*self.names(), *self._above}))
            own = self._above.get(name, f"{self.package}.{name}")
            self._loaded[name] = self._checked(self._outside(name) or importlib.import_module(own), name)
        return self._loaded[name]

    def add_file(self, path: str | Path) -> str:
        """Register a plug-in from one Python file outside the package, named after its stem; ParameterError where it cannot be
        used."""
        path, name = self._free_file(path)
        spec = importlib.util.spec_from_file_location(f"plugin_{name}", path)
        if spec is None or spec.loader is None:
            raise ParameterError(f"{self.kind} file {path} is no Python file; one that ends in .py is needed")
        module = importlib.util.module_from_spec(spec)
        # where any other module stands as well: a plug-in may look itself up
        sys.modules[spec.name] = module
        try:
            spec.loader.exec_module(module)
        except (Exception, SystemExit) as error:  # a plug-in may fail in any way; the user needs the file's name
            sys.modules.pop(spec.name, None)
            raise self._useless(f"{self.kind} file {path}", repr(error)) from error
        self._files[name] = self._checked(module, name)
        return name

    def add_hosted(self, path: str | Path, seconds: float = SECONDS) -> str:
        """Register a plug-in's file without importing it: a process of its own does; otherwise as `add_file`."""
        path, name = self._free_file(path)
        _refuse_limit(seconds)
        key = (path.resolve(), path.stat().st_mtime_ns)
        known = self._hosts.get(name)
        if known is None or known[0] != key:
            if known is not None:
                known[1].close()
            host = self.make_host(path.resolve(), seconds)
            self._files[name] = self._stub(host, f"{self.kind} file {path}")
            self._hosts[name] = (key, host)
        return name

    def add_all_hosted(self, paths: Iterable[str | Path], seconds: float = SECONDS) -> list[str]:
        """Register several files as `add_hosted` does; two of one name are refused. Every plug-in known is asked again."""
        _refuse_limit(seconds)
        files = list(dict.fromkeys(Path(p).resolve() for p in paths))
        names = [f.stem for f in files]
        for file in files:
            _refuse_name(file, self.kind, names.count(file.stem) > 1)
        added = [self.add_hosted(f, seconds) for f in files]
        for name, (file, host) in self._hosts.items():
            host.strikes = 0
            if name in added or not file:  # one that is published
                host.seconds = seconds
        return added

    @contextmanager
    def hosted(self, paths: Iterable[str | Path], seconds: float = SECONDS) -> Iterator[list[str]]:
        """Register several files for one question only: afterwards the names known are those of before."""
        before = set(self._files)
        try:
            yield self.add_all_hosted(paths, seconds)
        finally:
            for name in set(self._files) - before:
                self.forget(name)

    @contextmanager
    def entries_hosted(self) -> Iterator[None]:
        """Let what other distributions publish live in processes of their own, for one question only."""
        before, self.host_entries = self.host_entries, True
        self._forget_entries()
        try:
            yield
        finally:
            self.host_entries = before
            self._forget_entries()

    def _forget_entries(self) -> None:
        for name in self._entry_points:
            self._loaded.pop(name, None)
            self.forget(name)

    def host_of(self, name: str) -> Any:
        """Return the process a plug-in lives in; None for those of the house."""
        if self.host_entries and name in self._entry_points and name not in self._files:
            self.load(name)
        found = self._hosts.get(name)
        return None if found is None else found[1]

    def _free_file(self, path: str | Path) -> tuple[Path, str]:
        path = Path(path)
        if not path.is_file():
            raise ParameterError(f"{self.kind} file {path} does not exist")
        _refuse_name(path, self.kind, self._taken(path.stem))
        return path, path.stem

    def _taken(self, name: str) -> bool:
        return name in self.reserved or name in self._own or name in self._above or name in self._entry_points

    def own_file(self, path: str | Path) -> bool:
        """Return whether a file is that of a built-in plug-in."""
        folder = importlib.import_module(self.package).__path__[0]
        return Path(path).stem in self._own and Path(path).resolve().parent == Path(folder).resolve()

    def adopt(self, modules: Mapping[str, ModuleType]) -> None:
        """Make plug-ins known that stand in no file: a caller's own, who answers for them; they run where the caller does."""
        for name in modules:
            if self._taken(name):
                raise ParameterError(f"{self.kind} {name!r}: the name is taken; another is needed: rename the function")
        self._files.update(modules)

    @contextmanager
    def adopted(self, modules: Mapping[str, ModuleType]) -> Iterator[None]:
        """Make a caller's own plug-ins known for one question only."""
        before = dict(self._files)
        self.adopt(modules)
        try:
            yield
        finally:
            self._files = before

    def forget(self, name: str) -> None:
        """Take a file that was added out again."""
        self._files.pop(name, None)
        found = self._hosts.pop(name, None)
        if found is not None:
            found[1].close()

    @cached_property
    def _entry_points(self) -> dict:
        # reads the metadata of every installed distribution: once is enough; none takes a name that means something already
        return {e.name: e for e in entry_points(group=self.group) if e.name not in {*self._own, *self._above, *self.reserved}}

    def _outside(self, name: str) -> ModuleType | None:
        """Return what another distribution publishes under a name, or what stands for it here."""
        point = self._entry_points.get(name)
        if point is None:
            return None
        where = f"{self.kind} {name!r} of {point.dist.name if point.dist else 'another distribution'} ({point.value})"
        if not self.host_entries:
            try:
                return point.load()
            except (Exception, SystemExit) as error:  # it may fail in any way; the user needs its distribution's name
                raise self._useless(where, repr(error)) from error
        host = self.make_host(name, SECONDS)
        stub = self._stub(host, where)
        self._hosts[name] = ((), host)
        return stub

    @cached_property
    def _own(self) -> frozenset[str]:
        package = importlib.import_module(self.package)
        return frozenset(m.name for m in pkgutil.iter_modules(package.__path__) if not m.name.startswith("_"))

    def _stub(self, host: Any, where: str) -> ModuleType:
        """What stands for a plug-in outside its own process: its description of itself; ParameterError where it gives none."""
        try:
            return host.stub()
        except UserError as error:
            host.close()
            raise self._useless(where, str(error)) from None

    def _useless(self, where: str, why: str) -> ParameterError:
        needs = f"a {self.kind} needs {', '.join(self.required)}"
        return ParameterError(f"{where} cannot be imported: {why}" + ("" if needs in why else f"; {needs}"))

    def _checked(self, module: ModuleType, name: str) -> ModuleType:
        missing = [a for a in self.required if not hasattr(module, a)]
        if missing:
            raise ParameterError(f"{self.kind} {name!r} ({module.__file__}) lacks {', '.join(missing)}, which it needs")
        for a in (a for a in self.required if a.islower() and not callable(getattr(module, a))):
            raise ParameterError(f"{self.kind} {name!r} ({module.__file__}): {a} = {getattr(module, a)!r:.60} is no function")
        return module


def _no_host(source: Path | str, seconds: float) -> Any:
    raise ParameterError(f"{source}: plug-ins of this kind are not taken from others")


def _refuse_name(path: Path, kind: str, taken: bool) -> None:
    """Raise ParameterError when a file's stem cannot be the id of a plug-in, or is one that means something already."""
    name = path.stem
    if not name.isidentifier() or name != name.lower():
        raise ParameterError(f"{kind} file {path}: {name!r} is no id; small letters, digits and _ are needed; rename the file")
    if taken:
        raise ParameterError(f"{kind} file {path}: the name {name!r} is taken; another is needed: rename the file")


def _refuse_limit(seconds: float) -> None:
    if not 0.0 < seconds < 1e6:
        raise ParameterError(f"time limit {seconds} s; a number above 0 is needed")


PUBLISHED, _CHAPTER = "published", "chapter"
_RESERVED = ("all", "fast", "full", "oracle", "always_no", "always_yes")


class _Detectors(PluginFolder):
    """The detectors; `NAME@published` is a detector with the thresholds of its source, `NAME@chapter` with the chapter's.

    Those of other distributions live in processes of their own, as a user's files do.
    """

    def load(self, name: str) -> ModuleType:
        """Import one detector, or the published variant of one; see `PluginFolder.load`."""
        base, at, variant = name.partition("@")
        if at and variant not in (PUBLISHED, _CHAPTER):
            raise UnknownName(self.kind, name, [*self.names(), *self.variants()])
        module = super().load(base)
        if not at:
            return module
        if variant == _CHAPTER and not module.METHOD.chapter:
            chapters = [f"{n}@{_CHAPTER}" for n in self.names() if super(_Detectors, self).load(n).METHOD.chapter]
            raise UnknownName(self.kind, name, [f"{base}@{PUBLISHED}", *chapters])
        shown = ModuleType(name, module.__doc__)
        shown.__dict__.update(
            METHOD=module.METHOD.as_published(variant == _CHAPTER), detect=module.detect, __file__=module.__file__
        )
        return shown

    def host_of(self, name: str) -> Any:
        """Return the process a detector, or the published variant of it, lives in; None for those of the house."""
        return super().host_of(name.partition("@")[0])

    def variants(self) -> list[str]:
        """Return NAME@published of every detector."""
        return [f"{name}@{PUBLISHED}" for name in self.names()]


class _DetectorHost(Host):
    """The process of one detector."""

    def __init__(self, source: Path | str, seconds: float) -> None:
        folders = [source.parent] if isinstance(source, Path) else []
        super().__init__(_describe_detector, str(source), seconds=seconds, folders=folders, detector=True)

    def stub(self) -> ModuleType:
        """Return what stands for the plug-in outside its own process: its description of itself."""
        method = method_of(self.described())
        stub = ModuleType("hosted", method.title)
        stub.__dict__.update(METHOD=method, detect=_elsewhere, __file__=None)
        return stub


def _elsewhere(*_: Any, **__: Any) -> None:
    raise ParameterError("this detector is a plug-in, which answers in a process of its own alone")


def _describe_detector(source: str) -> Method | None:
    """Import a detector where this runs, in its own process, and return its description."""
    methods.host_entries = False
    method = methods.load(methods.add_file(source) if os.sep in source else source).METHOD
    return method if isinstance(method, Method) else None


methods = _Detectors("detector", "detectors.methods", "simbench.detectors", ("METHOD", "detect"), _RESERVED)
methods.make_host, methods.host_entries = _DetectorHost, True
# stands above this package, which may stand alone
methods.lend("likelihood", "simbench.gap.stiction.method")
