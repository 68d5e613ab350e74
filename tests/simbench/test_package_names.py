"""`detectors` and `scenarios` are packages of simbench: they hide nothing of a user, and nothing of
a user hides them from simbench.
"""

import subprocess
import sys

import pytest

PLUGIN = """
from simbench.detectors.method import Method
from simbench.detectors.verdict import Verdict
METHOD = Method(title="mine", source="a test")
def detect(prepared):
    return Verdict("mine", "stiction", score=1.0, reason="always")
"""


def script(folder, text):
    """Run a script in a folder, as a user does, and return what came of it."""
    (folder / "script.py").write_text(text)
    return subprocess.run([sys.executable, "script.py"], cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize("first", ["import simbench as sb", "import {name}; import simbench as sb"])
@pytest.mark.parametrize("name", ["detectors", "scenarios"])
def test_a_package_of_a_user_lives_beside_that_of_simbench(tmp_path, name, first):
    (tmp_path / name).mkdir()
    (tmp_path / name / "__init__.py").write_text("MINE = 1\n")
    (tmp_path / name / "judge.py").write_text("MINE = 2\n")
    done = script(
        tmp_path,
        f"{first.format(name=name)}\nsb.detect, sb.load_loop\nimport {name}.judge\n"
        f"print({name}.MINE, {name}.judge.MINE)\n",
    )
    assert done.stdout == "1 2\n", done.stderr


def test_a_plugin_is_asked_beside_a_user_s_package_of_that_name(tmp_path):
    (tmp_path / "mine.py").write_text(PLUGIN)
    (tmp_path / "detectors").mkdir()
    (tmp_path / "detectors" / "__init__.py").write_text("raise SystemExit('the wrong one')\n")
    done = script(
        tmp_path,
        "import simbench as sb\n"
        "from simbench.detectors.example_loop import example_loop\n"
        "(v,) = sb.detect(example_loop(), methods='mine', plugins=['mine.py'])\n"
        "print(v.verdict)\n",
    )
    assert done.stdout == "stiction\n", done.stderr
