"""Find plug-ins by name: in a folder of the package, among the entry points of installed
distributions, or in a file that the user names.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from functools import cached_property
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType

from simbench.detectors.errors import AnswerError, ParameterError, UnknownName
from simbench.detectors.method import refuse_wrong_call, wrong_fields


class PluginFolder:
    """The plug-ins of one kind; a plug-in is a module, its name is its file name.

    `package` holds the built-in ones, `group` is the entry-point group by which other distributions
    add theirs, `required` are the attributes each must have, `reserved` names that mean something
    else where plug-ins are named, `alone` those of the package that are in no set.
    """

    def __init__(
        self,
        kind: str,
        package: str,
        group: str,
        required: tuple[str, ...],
        reserved: tuple[str, ...] = (),
        alone: tuple[str, ...] = (),
    ) -> None:
        self.kind = kind
        self.package = package
        self.group = group
        self.required = required
        self.reserved = reserved
        self.alone = alone
        # raises ParameterError for a module that describes no plug-in of this kind
        self.refuse: Callable[[str, ModuleType], None] | None = None
        self._keys: dict[str, tuple[Path, int]] = {}  # path and time of change of a file
        self._files: dict[str, ModuleType] = {}
        self._loaded: dict[str, ModuleType] = {}

    def names(self) -> list[str]:
        """Return the names that a set may hold, sorted; nothing is imported."""
        return sorted(set(self.every_name()) - set(self.alone))

    def every_name(self) -> list[str]:
        """Return every known name, sorted; nothing is imported."""
        return sorted(self._built_in | set(self._entry_points) | set(self._files))

    def built_in(self, name: str) -> bool:
        """Return whether a plug-in, or the one of which this is a variant, comes with this
        project.
        """
        return name.partition("@")[0] in self._built_in

    def load(self, name: str) -> ModuleType:
        """Import one plug-in by its id; UnknownName with the nearest known names, ParameterError
        when it lacks a required attribute.
        """
        if name in self._files:
            return self._files[name]
        if name not in self._loaded:
            if name not in self.every_name():
                raise UnknownName(self.kind, name, self.every_name())
            self._loaded[name] = self._check_module(
                self._load_published(name) or importlib.import_module(f"{self.package}.{name}"),
                name,
            )
        return self._loaded[name]

    def add_file(self, path: str | Path) -> str:
        """Register a plug-in from one Python file outside the package, named after its stem;
        ParameterError where it cannot be used.
        """
        # A name that is free, and a file that is Python
        path = Path(path)
        name = self._free_name(path)
        spec = importlib.util.spec_from_file_location(f"plugin_{name}", path)
        if spec is None or spec.loader is None:
            raise ParameterError(
                f"{self.kind} file {path} is no Python file; one that ends in .py is needed"
            )
        module = importlib.util.module_from_spec(spec)

        # as any other module: a plug-in may look itself up
        sys.modules[spec.name] = module
        try:
            with redirect_stdout(sys.stderr):  # stdout is the answer's
                spec.loader.exec_module(module)
        except (
            Exception,
            SystemExit,
        ) as error:  # a plug-in may fail in any way; the user needs the file's name
            sys.modules.pop(spec.name, None)
            raise self._import_error(f"{self.kind} file {path}", repr(error)) from error

        # It has what the folder asks of its parts
        self._files[name] = self._check_module(module, name)
        return name

    def add_files(self, *paths: str | Path) -> list[str]:
        """Register files and return their names; one that is known and unchanged stays as it is."""
        files = list(dict.fromkeys(Path(p).resolve() for p in paths))
        names = [file.stem for file in files]
        for file, name in zip(files, names, strict=True):
            self._free_name(file, names.count(name) > 1)
            key = (file, file.stat().st_mtime_ns)
            if self._keys.get(name) != key:
                self.forget(name)
                self.add_file(file)
                self._keys[name] = key
        return names

    @contextmanager
    def added(self, paths: Iterable[str | Path]) -> Iterator[list[str]]:
        """Register files for the duration of a `with` block."""
        before = set(self._files)
        try:
            yield self.add_files(*paths)
        finally:
            for name in set(self._files) - before:
                self.forget(name)

    def outside(self) -> list[str]:
        """Return the names of plug-ins that were added or imported from other distributions."""
        return sorted(set(self._files) | (set(self._loaded) & set(self._entry_points)))

    def _free_name(self, path: Path, taken: bool = False) -> str:
        """Return the id of a plug-in's file; ParameterError where there is none, or where it is
        taken.
        """
        name = path.stem
        if not path.is_file():
            raise ParameterError(f"{self.kind} file {path} does not exist")
        if not (name.isidentifier() and name.isascii() and name == name.lower()):
            needs = "small letters of a to z, digits and _ are needed; rename the file"
            raise ParameterError(f"{self.kind} file {path}: {name!a} is no id; {needs}")
        if taken or self._is_taken(name):
            raise ParameterError(
                f"{self.kind} file {path}: the name {name!r} is taken; another is needed: rename"
                " the file"
            )
        return name

    def _is_taken(self, name: str) -> bool:
        return name in self.reserved or self.built_in(name) or name in self._entry_points

    def own_file(self, path: str | Path) -> bool:
        """Return whether a file is that of a built-in plug-in."""
        folder = importlib.import_module(self.package).__path__[0]
        return (
            Path(path).stem in self._built_in
            and Path(path).resolve().parent == Path(folder).resolve()
        )

    @contextmanager
    def adopted(self, modules: Mapping[str, ModuleType]) -> Iterator[None]:
        """Make a caller's plug-ins known for one question only."""
        before = dict(self._files)
        self.adopt(modules)
        try:
            yield
        finally:
            self._files = before

    def adopt(self, modules: Mapping[str, ModuleType]) -> None:
        """Make plug-ins known that stand in no file: a caller's, who answers for them; they run
        where the caller does.
        """
        for name in modules:
            if self._is_taken(name):
                raise ParameterError(
                    f"{self.kind} {name!r}: the name is taken; another is needed: rename the"
                    " function"
                )
        self._files.update(modules)

    def forget(self, name: str) -> None:
        """Take a file that was added out again, and what was imported of another distribution."""
        self._files.pop(name, None)
        self._keys.pop(name, None)
        if name in self._entry_points:
            self._loaded.pop(name, None)

    @cached_property
    def _entry_points(self) -> dict:
        # reads the metadata of every installed distribution: once is enough; none takes a name that
        # means something already
        points = {}
        for e in entry_points(group=self.group):
            if e.name not in self.reserved and not self.built_in(e.name):
                points[e.name] = e
        return points

    def _load_published(self, name: str) -> ModuleType | None:
        """Return what another distribution publishes under a name, or its replacement here."""
        # None of that name is published
        point = self._entry_points.get(name)
        if point is None:
            return None
        try:
            return point.load()
        except (
            Exception,
            SystemExit,
        ) as error:  # it may fail in any way; the user needs its distribution's name
            # The sentence names the distribution at fault
            if point.dist:
                whose = point.dist.name
            else:
                whose = "another distribution"
            where = f"{self.kind} {name!r} of {whose} ({point.value})"
            raise self._import_error(where, repr(error)) from error

    @cached_property
    def _built_in(self) -> frozenset[str]:
        package = importlib.import_module(self.package)
        return frozenset(
            m.name for m in pkgutil.iter_modules(package.__path__) if not m.name.startswith("_")
        )

    def _import_error(self, where: str, why: str) -> ParameterError:
        needs = f"a {self.kind} needs {', '.join(self.required)}"
        return ParameterError(
            f"{where} cannot be imported: {why}" + ("" if needs in why else f"; {needs}")
        )

    def _check_module(self, module: ModuleType, name: str) -> ModuleType:
        # Every attribute that a plug-in needs is there
        missing = []
        for a in self.required:
            if not hasattr(module, a):
                missing.append(a)
        if missing:
            raise ParameterError(
                f"{self.kind} {name!r} ({module.__file__}) lacks {', '.join(missing)}, which it"
                " needs"
            )

        # Those with a lower-case name are functions
        for a in (a for a in self.required if a.islower() and not callable(getattr(module, a))):
            raise ParameterError(
                f"{self.kind} {name!r} ({module.__file__}): {a} = {getattr(module, a)!r:.60} is no"
                " function"
            )

        # The folder's own condition, for parts of others
        if self.refuse is not None and not self.built_in(name):
            self.refuse(name, module)
        return module


PUBLISHED = "published"
_CHAPTER = "chapter"
# sets of methods, and reference rows of a score
RESERVED = ("all", "fast", "full", "oracle", "no_waveform", "rhythm", "always_no", "always_yes")


class _Detectors(PluginFolder):
    """The detectors; `NAME@published` is a detector with the thresholds of its source,
    `NAME@chapter` with the chapter's.
    """

    def load(self, name: str) -> ModuleType:
        """Import one detector, or the published variant of one; see `PluginFolder.load`."""
        # The name has a variant after an @, or none
        base, at, variant = name.partition("@")
        if at and variant not in (PUBLISHED, _CHAPTER):
            raise UnknownName(self.kind, name, self.names() + self.variants())
        module = super().load(base)
        if not at:
            return module

        # A variant of the chapter exists only where the chapter has one
        if variant == _CHAPTER and not module.METHOD.chapter:
            chapters = []
            for n in self.names():
                if super().load(n).METHOD.chapter:
                    chapters.append(f"{n}@{_CHAPTER}")
            raise UnknownName(self.kind, name, [f"{base}@{PUBLISHED}"] + chapters)

        # The same detector with the thresholds of that variant
        shown = ModuleType(name, module.__doc__)
        shown.__dict__.update(
            METHOD=module.METHOD.as_published(variant == _CHAPTER),
            detect=module.detect,
            __file__=module.__file__,
        )
        return shown

    def variants(self) -> list[str]:
        """Return NAME@published of every detector."""
        return [f"{name}@{PUBLISHED}" for name in self.names()]


def _refuse_wrong_detector(name: str, module: ModuleType) -> None:
    """Raise ParameterError for a file whose METHOD is not whole, and AnswerError where `detect`
    cannot be called with a record.
    """
    for wrong in wrong_fields(module.METHOD):
        raise ParameterError(f"detector {name!r} ({module.__file__}): {wrong}")
    try:
        refuse_wrong_call(module.detect, "prepared", module.METHOD)
    except AnswerError as wrong:
        raise AnswerError(f"detector {name!r}: {wrong}") from None


methods = _Detectors(
    "detector",
    "simbench.detectors.methods",
    "simbench.detectors",
    ("METHOD", "detect"),
    RESERVED,
    alone=("likelihood",),  # fits whole loops: seconds a record
)
methods.refuse = _refuse_wrong_detector
