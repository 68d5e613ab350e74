"""Compiled kernels: read from disk by the next process, compiled anew when anything they rest on
changes.
"""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from simbench.detectors.compiled import LANES, compiled, lanes, njit_cached, rows

HELPER = "from numbers_ import FACTOR\ndef scaled(x):\n    return FACTOR * x\n"
KERNEL = "from helper import scaled\ndef kernel(x):\n    return scaled(x) + 1.0\n"
RUN = "from simbench.detectors.compiled import compiled\nfrom kernel import kernel\n"
RUN += "f = compiled(kernel)\n"
RUN += "print(f(2.0), sum(f.stats.cache_hits.values()))"


def run(folder, **variables):
    """Return what the kernel gives in a new process, and whether it came from the disk cache."""
    variables = {"XDG_CACHE_HOME": str(folder / "cache"), **variables}
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **variables}
    words = [sys.executable, "-c", RUN]
    done = subprocess.run(
        words, cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    value, hits = done.stdout.split()
    return float(value), int(hits)


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A folder with a kernel and its cache, which every test leaves whole."""
    folder = tmp_path_factory.mktemp("filled")
    (folder / "kernel.py").write_text(KERNEL)
    (folder / "helper.py").write_text(HELPER)
    (folder / "numbers_.py").write_text("FACTOR = 3.0\n")
    assert run(folder) == (7.0, 0)
    return folder


@pytest.fixture
def copied(filled, tmp_path):
    """A copy of that folder, which a test may spoil."""
    return shutil.copytree(filled, tmp_path / "copy")


def test_next_process_reads_a_kernel_from_disk_and_an_edited_helper_in_another_file_makes_a_new_one(
    copied,
):
    assert run(copied) == (7.0, 1)
    # a constant from a file without kernels counts as well
    (copied / "numbers_.py").write_text("FACTOR = 4.0\n")
    assert run(copied) == (9.0, 0)
    (copied / "helper.py").write_text(HELPER.replace("* x", "* x + 2.0"))
    assert run(copied) == (11.0, 0)


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


@pytest.mark.skipif(os.name != "posix" or os.getuid() != 0, reason="needs a file of another user")
def test_compiled_kernels_in_another_users_folder_are_left_alone(copied):
    (cache,) = (copied / "cache").iterdir()
    assert cache.stat().st_mode & 0o077 == 0
    os.chown(cache, 12345, 12345)
    before = sorted(cache.rglob("*"))
    assert run(copied) == (7.0, 0)
    assert sorted(cache.rglob("*")) == before


def test_a_user_who_can_write_nowhere_has_kernels_all_the_same(monkeypatch):
    from numba.core import caching

    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [])
    assert njit_cached(lambda x: 2.0 * x)(3.0) == 6.0


def test_light_kernels_give_the_same_bits_plain_and_compiled():
    from simbench.detectors.signal.autocorrelation import _fill_crossings, acf, decay_and_lasting
    from simbench.detectors.signal.oscillation import _fill_reversals

    rng = np.random.default_rng(5)
    for n in (120, 333, 4001):
        x = np.sin(2 * np.pi * np.arange(n) / 17.3) + 0.3 * rng.standard_normal(n)
        rho, at = acf(x - x.mean()), [np.empty(n), np.empty(n)]
        counts = [
            kernel(rho, 0.05, to)
            for kernel, to in zip((_fill_crossings, compiled(_fill_crossings)), at)
        ]
        assert counts[0] == counts[1] > 4
        assert np.array_equal(at[0][: counts[0]], at[1][: counts[0]])
        both = [
            kernel(rho, at[0], x, 17.3)
            for kernel in (decay_and_lasting, compiled(decay_and_lasting))
        ]
        assert both[0] == both[1]
        turns = [np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)]
        assert _fill_reversals(x, 0.5, turns[0]) == compiled(_fill_reversals)(x, 0.5, turns[1])


SLOW = ("pandas", "matplotlib", "control", "scipy.stats", "scipy.signal", "scipy.optimize")


def printed(code):
    """Return the lines that a new process prints."""
    words = [sys.executable, "-c", code]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()


def test_diagnosis_loads_no_package_that_they_may_not_need():
    modules = "simbench.gap.command"
    code = f"import sys, {modules}; print(*(m for m in {SLOW} if m in sys.modules))"
    assert printed(code) == [""]
