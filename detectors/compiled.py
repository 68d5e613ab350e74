"""Compile plain Python functions with numba when they are first called, and cache the machine code
on disk.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import importlib.util
import inspect
import os
import pickle
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import cache, lru_cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from simbench.detectors.first_use import announce

# that a kernel may take in plain Python before it is compiled; most take as long to compile
_PLAIN_SECONDS = 0.2
# of a function that other kernels alone call: no entry for Python or C is compiled
_UNCALLED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
LANES = 32
"""Values that a row of `lanes` holds: four AVX-512 registers.

Below that LLVM unrolls the loops over them instead.
"""


def lanes():
    """Return room for `LANES` numbers; compiled, they live in registers, and a loop over them
    becomes one instruction.
    """
    return np.empty(LANES)


def wide():
    """Let the loops over lanes of a compiled kernel become instructions of 512 bits where the
    processor has them; by itself LLVM stops at 256. The bits stay the same.

    Every function on the way says so: one that loops, and the kernels that it is inlined into.
    """


def rows(count):
    """Return room for `count` rows of `LANES` numbers that begin with a cache line: a register is
    read from one, not two.
    """
    room = np.empty(count * LANES + 8)
    skip = -room.ctypes.data % 64 // 8
    return room[skip : skip + count * LANES]


@cache
def compiled(function: FunctionType):
    """Return a plain function compiled together with all plain functions it calls, from the disk
    cache when it is there.

    Floats are neither contracted nor reordered: it gives the plain function's bits, but for numpy's
    pairwise sums; division by zero gives inf or NaN. numba's disk cache only watches the file a
    function stands in. So each kernel is written to a separate module whose name carries the hash
    of every source that takes part: an edited helper never meets an old kernel. Not for closures.

    Kernels fill arrays element by element. For an array that is assigned to a part of another one
    numba compiles its string functions as well, which takes seconds.
    """
    options = 'cache=True, error_model="numpy", no_cfunc_wrapper=True'
    text = f"@njit({options})\n{inspect.getsource(function)}"
    return getattr(
        cached_module(function.__name__.strip("_"), names_used(function), text, "numpy"),
        function.__name__,
    )


@cache
def quick(function: FunctionType, *kernels: FunctionType):
    """Return a light kernel: plain until it has worked for so long that numba pays, or numba is
    loaded and has compiled it before. Of what it calls, `kernels` are compiled all the same.

    Loading numba and compiling cost a second, more than a few records do. Both give the same bits;
    not for kernels with numpy's sums.
    """
    worked = 0.0

    def call(*arguments):
        nonlocal worked
        if worked > _PLAIN_SECONDS or ("numba" in sys.modules and _on_disk(function)):
            return compiled(function)(*arguments)
        if kernels:
            plain = _call_compiled(function, kernels)
        else:
            plain = function
        began = time.perf_counter()
        with np.errstate(all="ignore"):  # a division by zero gives inf or NaN, as compiled
            answer = plain(*arguments)
        worked += time.perf_counter() - began
        return answer

    return call


@cache
def _call_compiled(function: FunctionType, kernels: tuple[FunctionType, ...]) -> FunctionType:
    """Return a plain function that calls compiled kernels in place of their plain twins."""
    names = {}
    for kernel in kernels:
        names[kernel.__name__] = compiled(kernel)
    return FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__)


@cache
def _on_disk(function: FunctionType) -> bool:
    """Return whether the machine code of a function was there when it was first asked for."""
    kept = _machine_code(compiled(function))
    return kept is not None and os.path.exists(kept._index_path)


def njit_cached(function: FunctionType):
    """Return a function compiled by numba and cached next to it or for its user; where neither can
    be written, not cached. Division by zero gives inf or NaN.
    """
    from numba import njit

    options: Any = {"error_model": "numpy", "no_cfunc_wrapper": True}
    try:
        return _with_checksum(njit(cache=True, **options)(function))
    except RuntimeError:  # numba finds no folder to write to, and gives up
        return njit(**options)(function)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Keep linear algebra to one thread where its libraries are known: with more, sums come out
    in another order.
    """
    from threadpoolctl import threadpool_limits

    try:
        limits = threadpool_limits(1)
    except (
        OSError
    ):  # this system does not say which libraries are loaded: the environment alone decides
        limits = contextlib.nullcontext()
    with limits:
        yield


def cached_module(
    kind: str, parts: dict[str, Any], text: str, error_model: str = "python"
) -> ModuleType:
    """Write `text` to a module, reused from disk, in which the names of `parts` are known,
    functions compiled; import it.

    A division by zero in one of the parts raises under the `error_model` "python", and gives inf or
    NaN under "numpy".
    """
    from numba import __version__

    digest = hashlib.sha256(
        f"{sys.version}{__version__}{error_model}{text}{_describe_parts(parts)}".encode()
    )
    plain = []
    for f in parts.values():
        if isinstance(f, FunctionType):
            plain.append(f)
    for path in sorted({__file__, *(f.__code__.co_filename for f in reached(plain))}):
        digest.update(_source_of(path))
    name = f"simbench_{kind}_{digest.hexdigest()[:20]}"
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / f"{name}.py"
    whole = f'"""Generated by {__name__}; delete freely."""\n\nfrom numba import njit\n\n\n{text}'
    if _read_module(path) != whole:
        _write_whole(path, whole)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    for part, value in parts.items():
        setattr(
            module, part, _jit(value, error_model) if isinstance(value, FunctionType) else value
        )

    # what was checked is executed, not what the file may hold by now
    exec(compile(whole, str(path), "exec"), module.__dict__)
    for value in list(vars(module).values()):
        _with_checksum(value)
    return module


def _with_checksum(value: Any) -> Any:
    """Give the disk cache of a compiled function its checksum; anything else is returned as it
    is.
    """
    kept = _machine_code(value)
    if kept is not None:
        kept.__class__ = _checked_cache()
    return value


def _machine_code(value: Any) -> Any:
    """Return numba's files of a compiled function; None of anything else."""
    return getattr(getattr(value, "_cache", None), "_cache_file", None)


@cache
def _checked_cache() -> type:
    """Return numba's files of machine code with a checksum in front: what is damaged is compiled
    anew, never executed.
    """
    from numba.core.caching import IndexDataCacheFile

    class Checked(IndexDataCacheFile):
        def _dump(self, obj):
            content = super()._dump(obj)
            return hashlib.sha256(content).digest() + content

        def load(self, key):
            found = super().load(key)
            if found is None:
                announce()
            return found

        def _load_index(self):
            # numba writes its version in front of what carries the checksum
            mark = pickle.dumps(self._version, protocol=-1)
            try:
                stamp, overloads = pickle.loads(
                    _check_content(Path(self._index_path).read_bytes().removeprefix(mark))
                )
            except Exception:  # whatever a damaged pickle raises
                return {}
            return overloads if stamp == self._source_stamp else {}

        def _load_data(self, name):
            return pickle.loads(_check_content(Path(self._data_path(name)).read_bytes()))

    return Checked


def _check_content(content: bytes) -> bytes:
    if hashlib.sha256(content[32:]).digest() != content[:32]:
        raise OSError("a compiled kernel on disk is damaged")  # which numba takes for none
    return content[32:]


def _read_module(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None


def _write_whole(path: Path, text: str) -> None:
    """Write a module that no other process ever sees half; its compiled kernels, of whatever text
    stood there, go.
    """
    # Kernels compiled from an older text go
    for old in path.parent.glob(f"__pycache__/{path.stem}.*"):
        with contextlib.suppress(OSError):
            old.unlink()

    # The text is on disk before it has its name
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.")
    try:
        with open(handle, "w", encoding="utf-8") as f:
            f.write(text)
            f.flush()
            os.fsync(f.fileno())
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


@cache
def _jit(function: FunctionType, error_model: str):
    from numba import njit

    if function is lanes:
        return _compiled_lanes()
    if function is wide:
        return _compiled_wide()
    called = {}
    for n, g in names_used(function).items():
        if isinstance(g, FunctionType):
            called[n] = _jit(g, error_model)
    copy = FunctionType(
        function.__code__,
        {**function.__globals__, **called},
        function.__name__,
        function.__defaults__,
    )
    copy.__module__ = function.__module__
    copy.__qualname__ = function.__qualname__

    # lanes stay in registers only where the loops over them stand in one function
    inlined = error_model == "numpy"
    return njit(copy, error_model=error_model, forceinline=inlined, **_UNCALLED)


@cache
def _compiled_lanes():
    """Return the compiled twin of `lanes`: an array on the stack, which LLVM turns into
    registers.
    """
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic
    from numba.np.arrayobj import make_array, populate_array

    row = types.Array(types.float64, 1, "C")

    @intrinsic
    def registers(typing_context):
        def code(context, builder, signature, arguments):
            room = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), LANES))
            room.align = 64
            array = make_array(row)(context, builder)
            size = context.get_constant(types.intp, LANES)
            step = context.get_constant(types.intp, 8)
            start = builder.bitcast(room, ir.DoubleType().as_pointer())
            populate_array(array, start, [size], [step], step, None)
            return array._getvalue()

        return row(), code

    return registers


@cache
def _compiled_wide():
    """Return the compiled twin of `wide`, which writes LLVM's attribute to the function that calls
    it.
    """
    from numba import types
    from numba.extending import intrinsic

    @intrinsic
    def widened(typing_context):
        def code(context, builder, signature, arguments):
            # llvmlite's own `add` knows attributes without a value only
            set.add(builder.function.attributes, '"prefer-vector-width"="512"')
            return context.get_dummy_value()

        return types.void(), code

    return widened


def names_used(function: FunctionType) -> dict[str, Any]:
    """What a function takes from its module, by name."""
    used = {}
    for n in function.__code__.co_names:
        if n in function.__globals__:
            used[n] = function.__globals__[n]
    return {n: v for n, v in used.items() if v is not function}


def reached(functions: list[FunctionType]) -> set[FunctionType]:
    """Return the functions and all plain functions that they call."""
    functions_reached: set[FunctionType] = set()
    while functions:
        function = functions.pop()
        if function not in functions_reached:
            functions_reached.add(function)
            functions = functions + [
                f for f in names_used(function).values() if isinstance(f, FunctionType)
            ]
    return functions_reached


def _describe_parts(parts: dict[str, Any]) -> list[str]:
    """One line per part; the constants of functions count too, which may come from a file that is
    not hashed.
    """
    # Functions with the constants that they use, arrays written out
    lines = []
    for name, part in parts.items():
        if isinstance(part, FunctionType):
            used = {}
            for f in reached([part]):
                for n, v in names_used(f).items():
                    if not isinstance(v, FunctionType):
                        used[n] = v
            lines.append(f"{name} {part.__module__} {part.__qualname__} {_describe_parts(used)}")
        elif isinstance(part, (type, ModuleType)):
            lines.append(f"{name} {part.__name__} {getattr(part, '_fields', ())}")
        else:
            lines.append(f"{name} {part.tolist() if isinstance(part, np.ndarray) else part!r}")
    return sorted(lines)


@lru_cache(maxsize=1024)
def _source_of(path: str) -> bytes:
    return Path(path).read_bytes()


@lru_cache(maxsize=1)
def cache_folder() -> Path:
    """Return a folder that this user alone can write: what lies there is executed."""
    # A folder of the user's own, closed to others
    try:
        base = (
            Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "stiction-simbench"
        )
        base.mkdir(parents=True, exist_ok=True)
        if os.name == "posix":  # elsewhere a user's folders are closed to others
            if base.stat().st_uid != os.getuid():
                raise PermissionError
            base.chmod(0o700)

        # A file is tried in it: a full or read-only disk shows here
        with tempfile.TemporaryFile(dir=base):
            return base

    # None such: a passing folder, removed when the process ends
    except (OSError, RuntimeError):  # RuntimeError: a user without a home folder
        passing = tempfile.mkdtemp(prefix="stiction-simbench-")
        atexit.register(shutil.rmtree, passing, ignore_errors=True)
        return Path(passing)
