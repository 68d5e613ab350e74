"""`simbench contract FILE`: the kind is seen from the file; 0 kept, 1 broken, 2 no plug-in at
all.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import detectors
import scenarios
from simbench.cli import main
from simbench.gap.effects import PLUGINS as RECOGNISERS
from simbench.loop.effects import PLUGINS
from simbench.loop.parameters import VALVES

KINDS = {
    "detector": Path(detectors.__file__).parent / "methods" / "horch.py",
    "valve": Path(VALVES.load("kano").__file__),
    "effect": Path(PLUGINS.load("deadband").__file__),
    "recogniser": Path(RECOGNISERS.load("deadband").__file__),
    "grid": Path(scenarios.__file__).parent / "grids" / "smoke.toml",
}


@pytest.mark.parametrize("kind", KINDS)
def test_the_kind_is_seen_from_the_file(kind, capsys):
    assert main(["contract", str(KINDS[kind]), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found == {
        "kind": kind,
        "name": KINDS[kind].stem,
        "kept": True,
        "broken": [],
        "notes": [],
    }


def test_a_broken_one_is_exit_1_with_a_line_for_each_point(tmp_path, capsys):
    path = tmp_path / "my_valve.py"
    path.write_text(KINDS["valve"].read_text().replace("return p.S, p.J", "return p.S, 0.0"))
    assert main(["contract", str(path)]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "valve my_valve: breaks its contract in one place",
        "  broken: maps on J = 0, but MV slips by 2 % of travel, with S = 4, J = 2",
    ]
    assert main(["contract", str(path), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["kept"] is False
    assert "my_valve" not in VALVES.names()


def test_what_is_missing_is_named(tmp_path, capsys):
    path = tmp_path / "half.py"
    path.write_text('"""Half."""\nSOURCE = "a test"\nFRICTION = False\nPARAMETERS = {}\n')
    assert main(["contract", str(path)]) == 1
    assert "broken: start, step are not defined" in capsys.readouterr().out


def test_what_a_file_prints_when_imported_is_told(tmp_path, capsys):
    path = tmp_path / "loud.py"
    path.write_text(KINDS["valve"].read_text() + '\nprint("here I am")\n')
    assert main(["contract", str(path)]) == 1
    assert "broken: prints 'here I am', when imported" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("none.py", None, "cannot be read: no such file"),
        ("none.toml", None, "no such file"),
        ("empty.py", "", "is no plug-in by what it defines"),
        ("wrong.py", "def (", "is no Python file"),
        ("wrong.toml", "a = ", "is no valid TOML"),
        ("kano.py", "same", "the name 'kano' is taken"),
        ("fails.py", "fails", "cannot be imported"),
    ],
)
def test_what_is_no_plugin_is_exit_2_in_one_sentence(tmp_path, capsys, name, text, words):
    if text is not None:
        sound = KINDS["valve"].read_text()
        (tmp_path / name).write_text({"same": sound, "fails": sound + "\n1 / 0\n"}.get(text, text))
    assert main(["contract", str(tmp_path / name)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert words in said.err
    assert len(said.err.strip().splitlines()) == 1


def test_the_contract_of_detectors_needs_no_simulator():
    code = (
        "import sys; from detectors.contract.detector import check_detector; assert"
        " check_detector('he').kept\nprint(','.join(m for m in sys.modules if m.split('.')[0] in"
        " ('simbench', 'scenarios')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
