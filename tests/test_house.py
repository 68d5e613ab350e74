"""Rules on the code that no linter checks: import costs, docstrings, plug-ins, names."""

from __future__ import annotations

import ast
import importlib
import inspect
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from numpydoc.hooks.validate_docstrings import parse_config
from numpydoc.validate import validate

from tests.common.habits import (
    MOST,
    MOST_BARE,
    MOST_OF_ONE_WORD,
    PRODUCT,
    counted,
    places,
    product_trees,
    statements,
)

ROOT = Path(__file__).parents[1]
PLUGINS = ["detectors/methods", "simbench/gap/effects", "simbench/figures"]
PLUGINS += [f"simbench/loop/{kind}" for kind in ("valves", "effects", "plants", "controllers")]


trees = cache(product_trees)


def test_importing_detectors_loads_nothing_heavy():
    code = "import sys, simbench.detectors.judge; print(*sys.modules)"
    command = [sys.executable, "-c", code]
    loaded = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    heavy = "numba pandas matplotlib scipy.stats scipy.signal control joblib"
    assert not {*heavy.split(), "simbench.loop", "simbench.scenarios"} & set(loaded)


def documented() -> Iterator[str]:
    """Yield the dotted name of what a package exports, with what its classes offer, and of all
    else whose docstring lists parameters.
    """
    for file, tree in trees().items():
        module = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        places = [(module, node) for node in tree.body]
        for where, node in places:
            if isinstance(node, ast.ClassDef):
                places += [(f"{where}.{node.name}", inner) for inner in node.body]
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and "Parameters\n---" in (
                ast.get_docstring(node) or ""
            ):
                yield f"{where}.{node.name}"
        if not (file.endswith("/__init__.py") and "id='__all__'" in ast.dump(tree)):
            continue
        package = importlib.import_module(module)
        for thing in (getattr(package, name) for name in package.__all__):
            if not hasattr(thing, "__qualname__"):
                continue
            home = f"{thing.__module__}.{thing.__qualname__}"
            yield home
            for member, value in vars(thing).items() if inspect.isclass(thing) else ():
                value = getattr(value, "fget", getattr(value, "__func__", value))
                name = getattr(value, "__qualname__", "")
                if member[0] != "_" and name.endswith(f".{member}"):
                    yield f"{value.__module__}.{name}"


def test_numpydoc_finds_every_parameter_and_result_of_public_names_described():
    checks = parse_config(ROOT)["checks"]
    names = sorted(n for n in set(documented()) if n.split(".")[0] in PRODUCT)
    faults = [
        f"{name}: {code} {text}"
        for name in names
        for code, text in validate(name)["errors"]
        if code in checks
    ]
    assert faults == []
    assert len(names) > 100
    assert "PR01" in {code for code, _ in validate("json.dumps")["errors"]} & checks


@pytest.mark.parametrize("folder", PLUGINS)
def test_plugins_never_import_their_siblings(folder):
    package = folder.replace("/", ".") + "."
    files = {n: t for n, t in trees().items() if n.startswith(folder + "/") and "/_" not in n}
    assert files
    for name, tree in files.items():
        for node in ast.walk(tree):
            imported = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            imported += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            siblings = [n.removeprefix(package) for n in imported if n.startswith(package)]
            assert all(n.startswith("_") for n in siblings), f"{name} imports {siblings}"


def test_a_statement_states_one_fact():
    found = places("several facts in one statement", trees())
    # names that are unpacked from what one call or one loop gives are fine now and then
    assert 1000 * len(found) <= 6 * statements(trees()), found


def test_no_answer_hides_in_a_string():
    assert places("a type hidden in a string", trees()) == []


def test_a_loop_becomes_a_table_at_the_border_alone():
    border = {
        "scenarios/spec.py",
        "simbench/gap/report/result.py",
        "simbench/bench/scenario/resolve.py",
    }
    found = places("a loop edited as a table", trees())
    assert {place.partition(":")[0] for place in found} <= border


def test_a_body_has_paragraphs_and_a_statement_states_one_fact():
    numbers = counted(trees())
    assert numbers["bare"] <= MOST_BARE
    assert numbers["one word"] <= MOST_OF_ONE_WORD
    for habit, (_, most) in MOST.items():
        assert numbers[habit] <= most, habit
