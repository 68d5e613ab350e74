"""A folder of the user that is called like a package of simbench is named, not stumbled over."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("name", ["detectors", "scenarios"])
@pytest.mark.parametrize("package", [True, False])
def test_a_folder_that_hides_a_package_is_named(tmp_path, name, package):
    (tmp_path / name).mkdir()
    if package:  # else it holds data, and hides nothing
        (tmp_path / name / "__init__.py").write_text("MINE = 1\n")
    (tmp_path / "script.py").write_text("import simbench as sb\nsb.detect, sb.load_loop\n")
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == package, done.stderr
    if package:
        last = done.stderr.strip().splitlines()[-1]
        assert last.startswith(f"ImportError: simbench needs its own package '{name}', which ")
        assert str(tmp_path / name) in last
