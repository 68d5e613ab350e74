"""Compiled kernels: read from disk by the next process, compiled anew when anything they rest on
changes.
"""

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

from detectors.compiled import LANES, compiled, lanes, njit_cached, rows

HELPER = "FACTOR = {factor}\ndef scaled(x):\n    return FACTOR * x\n"
KERNEL = "from helper import scaled\ndef kernel(x):\n    return scaled(x) + 1.0\n"
RUN = "from detectors.compiled import compiled\nfrom kernel import kernel\nf = compiled(kernel)\n"
RUN += "print(f(2.0), sum(f.stats.cache_hits.values()))"


def run(folder):
    environment = {
        **os.environ,
        "XDG_CACHE_HOME": str(folder / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    value, hits = done.stdout.split()
    return float(value), int(hits)


def test_next_process_reads_a_kernel_from_disk_and_an_edited_helper_in_another_file_makes_a_new_one(
    tmp_path,
):
    (tmp_path / "numbers_.py").write_text("FACTOR = 3.0\n")
    helper = "from numbers_ import FACTOR\ndef scaled(x):\n    return FACTOR * x\n"
    (tmp_path / "helper.py").write_text(helper)
    (tmp_path / "kernel.py").write_text(KERNEL)
    assert run(tmp_path) == (7.0, 0)
    assert run(tmp_path) == (7.0, 1)
    # a constant from a file without kernels counts as well
    (tmp_path / "numbers_.py").write_text("FACTOR = 4.0\n")
    assert run(tmp_path) == (9.0, 0)
    (tmp_path / "helper.py").write_text(helper.replace("* x", "* x + 2.0"))
    assert run(tmp_path) == (11.0, 0)


DAMAGE = [("nbi", "one bit")]
DAMAGE += [
    pytest.param(*more, marks=pytest.mark.slow)
    for more in (
        ("py", "text"),
        ("py", "half"),
        ("nbi", "empty"),
        ("nbc", "half"),
        ("nbc", "one bit"),
    )
]


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A folder with a kernel and its cache, which every test leaves whole."""
    folder = tmp_path_factory.mktemp("filled")
    (folder / "kernel.py").write_text(KERNEL)
    (folder / "helper.py").write_text(HELPER.format(factor=3.0))
    run(folder)
    return folder


@pytest.mark.parametrize(("suffix", "damage"), DAMAGE)
def test_a_damaged_file_of_the_cache_is_made_anew_and_never_executed(filled, suffix, damage):
    files = [f for f in (filled / "cache").rglob(f"*.{suffix}") if "kernel" in f.name]
    assert files
    for file in files:
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 4
        spoilt = {
            "half": content[: len(content) // 2],
            "one bit": content,
            "empty": b"",
            "text": b"raise SystemExit(3)",
        }
        file.write_bytes(bytes(spoilt[damage]))
    assert run(filled) == (7.0, 0)
    assert run(filled) == (7.0, 1)


def running_sums(x):
    total, out = lanes(), rows(x.size)
    for c in range(LANES):
        total[c] = c
    for k in range(x.size):
        for c in range(LANES):
            total[c] = 0.5 * total[c] + x[k]
        for c in range(LANES):
            out[k * LANES + c] = total[c]
    return out


def test_lanes_give_the_plain_functions_bits():
    x = np.random.default_rng(0).standard_normal(50)
    fast = compiled(running_sums)(x)
    assert np.array_equal(fast, running_sums(x))
    assert fast.ctypes.data % 64 == 0


class Trap:
    def __reduce__(self):
        return os.system, ("echo caught > trap",)


@pytest.mark.parametrize("suffix", [pytest.param("nbi", marks=pytest.mark.slow), "nbc"])
def test_a_trap_in_place_of_a_compiled_kernel_is_not_sprung(tmp_path, suffix):
    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "helper.py").write_text(HELPER.format(factor=3.0))
    run(tmp_path)
    for file in (tmp_path / "cache").rglob(f"*.{suffix}"):
        file.write_bytes(pickle.dumps(Trap()))
    assert run(tmp_path) == (7.0, 0)
    assert not (tmp_path / "trap").exists()


@pytest.mark.skipif(os.name != "posix" or os.getuid() != 0, reason="needs a file of another user")
def test_compiled_kernels_in_another_users_folder_are_left_alone(tmp_path):
    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "helper.py").write_text(HELPER.format(factor=3.0))
    run(tmp_path)
    (cache,) = (tmp_path / "cache").iterdir()
    assert cache.stat().st_mode & 0o077 == 0
    os.chown(cache, 12345, 12345)
    before = sorted(cache.rglob("*"))
    assert run(tmp_path) == (7.0, 0)
    assert sorted(cache.rglob("*")) == before


def test_a_user_who_can_write_nowhere_has_kernels_all_the_same(monkeypatch):
    from numba.core import caching

    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [])
    assert njit_cached(lambda x: 2.0 * x)(3.0) == 6.0


def test_a_cache_of_one_process_goes_with_it(tmp_path):
    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "helper.py").write_text(HELPER.format(factor=3.0))
    (tmp_path / "file").write_text("")
    environment = {
        **os.environ,
        "XDG_CACHE_HOME": str(tmp_path / "file"),
        "TMPDIR": str(tmp_path / "tmp"),
    }
    (tmp_path / "tmp").mkdir()
    words = [sys.executable, "-c", RUN]
    done = subprocess.run(
        words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.split()[0] == "7.0"
    assert list((tmp_path / "tmp").iterdir()) == []


def test_light_kernels_give_the_same_bits_plain_and_compiled():
    from detectors.compiled import compiled
    from detectors.signal.autocorrelation import _crossings, acf, decay_and_lasting
    from detectors.signal.oscillation import _reversals

    rng = np.random.default_rng(5)
    for n in (120, 333, 4001):
        x = np.sin(2 * np.pi * np.arange(n) / 17.3) + 0.3 * rng.standard_normal(n)
        rho, at = acf(x - x.mean()), [np.empty(n), np.empty(n)]
        counts = [
            kernel(rho, 0.05, to) for kernel, to in zip((_crossings, compiled(_crossings)), at)
        ]
        assert counts[0] == counts[1] > 4
        assert np.array_equal(at[0][: counts[0]], at[1][: counts[0]])
        both = [
            kernel(rho, at[0], x, 17.3)
            for kernel in (decay_and_lasting, compiled(decay_and_lasting))
        ]
        assert both[0] == both[1]
        turns = [np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)]
        assert _reversals(x, 0.5, turns[0]) == compiled(_reversals)(x, 0.5, turns[1])


IMPORTS = """
import contextlib, io, sys
from simbench.cli import main
with contextlib.redirect_stdout(io.StringIO()):
    code = main(sys.argv[1:])
print(code, *(m for m in {heavy!r} if m in sys.modules))
"""
HEAVY = (
    "numba",
    "control",
    "pandas",
    "matplotlib",
    "scipy.stats",
    "scipy.signal",
    "scipy.optimize",
    "joblib",
)


def imported(*words, heavy=HEAVY):
    """Return the exit code of a command, and what it imported of heavy packages."""
    told = subprocess.run(
        [sys.executable, "-c", IMPORTS.format(heavy=heavy), *map(str, words)],
        capture_output=True,
        text=True,
    )
    code, *found = told.stdout.split()
    return int(code), found


@pytest.mark.parametrize(
    "words",
    [("--help",), ("list",), ("list", "detectors"), ("list", "valves"), ("list", "effects")],
)
def test_help_and_lists_import_nothing_heavy(words):
    assert imported(*words) == (0, [])


def test_three_detectors_on_one_record_import_nothing_heavy(tmp_path):
    t = np.arange(800)
    rows = np.column_stack([t, 50 + np.sin(t / 8), 20 + np.cos(t / 8)])
    np.savetxt(tmp_path / "rec.csv", rows, delimiter=",", header="t_s,op,pv", comments="")
    assert imported("detect", tmp_path / "rec.csv", "--method", "horch,he,choudhury") == (0, [])


@pytest.mark.parametrize("module", ["simbench.gap.command", "simbench.plant.command"])
def test_diagnosis_and_trust_load_no_package_that_they_may_not_need(module):
    slow = ("scipy.signal", "scipy.stats", "scipy.optimize", "pandas", "matplotlib", "control")
    code = f"import sys, {module}; print(*(m for m in {slow} if m in sys.modules))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.split() == []
