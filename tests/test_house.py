"""The rules of the house, executed: whose modules these are, what imports cost, what docstrings
say.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import detectors
import scenarios
import simbench
from simbench.loop.effects import EFFECTS

ROOT = Path(__file__).parents[1]
FILES = sorted(
    p for name in ("simbench", "detectors", "scenarios") for p in (ROOT / name).rglob("*.py")
)
NAMES = [str(p.relative_to(ROOT)) for p in FILES]


@pytest.mark.parametrize("package", [simbench, detectors, scenarios])
def test_imported_package_is_ours_and_not_a_namesake_from_pypi(package):
    assert Path(package.__file__).is_relative_to(ROOT)


def test_importing_detectors_loads_nothing_heavy():
    code = "import sys, detectors, detectors.judge; print(','.join(sys.modules))"
    loaded = (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        .stdout.strip()
        .split(",")
    )
    for heavy in (
        "numba",
        "pandas",
        "matplotlib",
        "scipy.stats",
        "scipy.signal",
        "control",
        "joblib",
        "simbench",
        "scenarios",
    ):
        assert heavy not in loaded


@pytest.mark.parametrize("package", ["simbench", "detectors", "scenarios"])
def test_first_lines_say_what_lives_there_and_public_functions_describe_their_parameters(package):
    trees = {
        name: ast.parse(path.read_text(encoding="utf-8"))
        for path, name in zip(FILES, NAMES)
        if name.startswith(package)
    }
    for name, tree in trees.items():
        first = (ast.get_docstring(tree) or "").split("\n")[0]
        assert len(first) > 10, f"{name}: a module docstring is missing"
    for name, node in ((name, node) for name, tree in trees.items() for node in tree.body):
        if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
            continue
        if [d.id for d in node.decorator_list if isinstance(d, ast.Name)] == ["overload"]:
            continue  # a form of a call: the function itself speaks for all of them
        doc = ast.get_docstring(node) or ""
        assert doc, f"{name}: {node.name} has no docstring"
        if "Parameters\n" in doc:
            section = (
                doc.split("Parameters\n", 1)[1].split("\n\n", 1)[0] if "Returns" not in doc else doc
            )
            arguments = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
            missing = [a.arg for a in arguments if a.arg not in section]
            assert not missing, f"{name}: {node.name}: the docstring does not speak of {missing}"


PLUGINS = ["detectors/methods", "simbench/gap/effects", "simbench/figures"]
PLUGINS += [f"simbench/loop/{kind}" for kind in ("valves", "effects", "plants", "controllers")]


@pytest.mark.parametrize("folder", PLUGINS)
def test_plugins_never_import_their_siblings(folder):
    package = folder.replace("/", ".")
    files = [p for p in (ROOT / folder).glob("*.py") if not p.stem.startswith("_")]
    assert files
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            siblings = [
                n
                for n in names
                if n.startswith(package + ".") and not n.removeprefix(package + ".").startswith("_")
            ]
            assert not siblings, f"{path.name} imports {siblings}"


def test_a_class_has_a_name_of_its_own():
    homes: dict[str, list[str]] = {}
    for path, name in zip(FILES, NAMES):
        # worlds are written without sight of the rest
        if "simbench/blind/worlds/" not in name:
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                # `class Loop(spec.Loop)` says whose it extends
                own = isinstance(node, ast.ClassDef) and not any(
                    getattr(b, "attr", "") == node.name for b in node.bases
                )
                if isinstance(node, ast.ClassDef) and own:
                    homes.setdefault(node.name, []).append(name)
    assert {name: places for name, places in homes.items() if len(places) > 1} == {}


def test_a_constant_that_others_read_has_one_meaning():
    # a plug-in is asked by these words: they belong to its file
    own = (
        *PLUGINS,
        "simbench/blind/worlds",
        "simbench/gap/stiction/method.py",
        "simbench/loop/laws/curve.py",
    )
    homes: dict[str, set[str]] = {}
    for path, name in zip(FILES, NAMES):
        for node in (
            ast.parse(path.read_text(encoding="utf-8")).body if not name.startswith(own) else ()
        ):
            targets = (
                node.targets
                if isinstance(node, ast.Assign)
                else [node.target]
                if isinstance(node, ast.AnnAssign)
                else []
            )
            for word in (
                n.id
                for t in targets
                for n in ast.walk(t)
                if isinstance(n, ast.Name) and n.id.isupper()
            ):
                if not word.startswith("_") and word not in ("SOURCE", "PLUGINS", "TITLE"):
                    homes.setdefault(word, set()).add(name)
    assert len(homes) > 100
    assert {word: places for word, places in homes.items() if len(places) > 1} == {}


def test_what_is_known_of_an_effect_stands_in_its_own_files():
    own = ("simbench/loop/effects/", "simbench/gap/effects/", "simbench/blind/")
    ids, found = set(EFFECTS), []
    for path, name in zip(FILES, NAMES):
        if name.startswith("simbench/") and not name.startswith(own):
            tree = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            found += [
                f"{name}: {n.value}" for n in tree if isinstance(n, ast.Constant) and n.value in ids
            ]
    # most of these are a detector's verdict, a section of the loop file or a valve model of the
    # same name
    assert len(found) <= 70, found
