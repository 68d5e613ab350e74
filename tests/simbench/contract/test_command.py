"""`simbench contract FILE`: the kind is seen from the file; 0 kept, 1 broken, 2 no plug-in at
all.
"""

import json
from pathlib import Path

import pytest

import simbench.detectors as detectors
import simbench.scenarios as scenarios
from simbench.cli import main
from simbench.contract import check, kind_of
from simbench.detectors.errors import ParameterError, UserError
from simbench.loop.effects import PLUGINS
from simbench.loop.parameters import VALVES

KINDS = {
    "detector": Path(detectors.__file__).parent / "methods" / "horch.py",
    "valve": Path(VALVES.load("kano").__file__),
    "effect": Path(PLUGINS.load("deadband").__file__),
    "grid": Path(scenarios.__file__).parent / "grids" / "smoke.toml",
}


@pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=() if k == "valve" else pytest.mark.slow) for k in KINDS]
)
def test_a_plug_in_that_keeps_it_is_exit_0(kind, capsys):
    assert main(["contract", str(KINDS[kind]), "--json"]) == 0
    contract = json.loads(capsys.readouterr().out)
    nothing = {"broken": [], "notes": []}
    assert contract == {"kind": kind, "name": KINDS[kind].stem, "kept": True, **nothing}


def test_the_kind_is_seen_from_the_file():
    assert {kind: kind_of(path) for kind, path in KINDS.items()} == {kind: kind for kind in KINDS}


def test_a_broken_one_is_exit_1_with_a_line_for_each_point(tmp_path, capsys):
    path = tmp_path / "my_valve.py"
    path.write_text(KINDS["valve"].read_text().replace("return p.S, p.J", "return 0.0, 0.0"))
    assert main(["contract", str(path)]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "valve my_valve: breaks its contract in one place",
        "  broken: says FRICTION = True and maps on S = 0",
    ]
    assert "my_valve" not in VALVES.names()


HALF = '"""Half."""\nSOURCE = "a test"\nFRICTION = False\nPARAMETERS = {}\n'


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (HALF, "start, step are not defined"),
        (KINDS["valve"].read_text() + "\nprint(3)\n", "prints '3', when imported"),
    ],
)
def test_what_is_missing_and_what_a_file_prints_when_imported_breaks_it(contract_of, text, fault):
    assert contract_of(text).broken[0] == fault


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("none.py", None, "cannot be read: no such file"),
        ("none.toml", None, "no such file"),
        ("empty.py", "", "is no plug-in by what it defines"),
        ("wrong.py", "def (", "is no Python file"),
        ("wrong.toml", "a = ", "is no valid TOML"),
        ("kano.py", KINDS["valve"].read_text(), "the name 'kano' is taken"),
        pytest.param(
            "fails.py",
            KINDS["valve"].read_text() + "\n1 / 0\n",
            "cannot be imported",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_is_no_plugin_is_exit_2_in_one_sentence(tmp_path, capsys, name, text, words):
    if text is not None:
        (tmp_path / name).write_text(text)
    assert main(["contract", str(tmp_path / name)]) == 2
    answer = capsys.readouterr()
    assert answer.out == ""
    assert words in answer.err
    assert len(answer.err.strip().splitlines()) == 1


def test_an_unknown_kind_or_name_is_refused_with_the_nearest_one():
    assert check("valve", "deadband").kept
    with pytest.raises(ParameterError, match="kind 'valv'; did you mean 'valve'"):
        check("valv", "kano")
    with pytest.raises(UserError, match="unknown valve 'kanno': did you mean 'kano'"):
        check("valve", "kanno")
