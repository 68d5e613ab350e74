"""The page on the architecture is true: its functions exist, its picture shows the import rules."""

from __future__ import annotations

import ast
import re
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/site/architecture.md").read_text(encoding="utf-8")
NAMED = re.findall(r"`([\w/]+\.py):([\w.]+)`", PAGE)


@pytest.fixture
def architecture(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs/site/written"))
    import architecture

    yield architecture
    sys.modules.pop("architecture")


def defined(file: str, name: str) -> bool:
    """Whether a file defines a function, or a class and its method."""
    body = ast.parse((ROOT / file).read_text(encoding="utf-8")).body
    for part in name.split("."):
        here = [
            node
            for node in body
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and node.name == part
        ]
        if not here:
            return False
        body = here[-1].body
    return True


@pytest.mark.parametrize(("file", "name"), NAMED)
def test_every_function_that_the_page_names_exists(file, name):
    assert defined(file, name)


def test_the_picture_shows_the_import_rules_and_docstrings_of_today(architecture):
    (description,) = (
        element.text
        for element in ET.parse(architecture.PICTURE).iter()
        if element.tag.endswith("}description")
    )
    assert description == architecture.words()


def test_the_page_says_what_every_folder_is_for():
    folders = set()
    for top in ("simbench", "detectors", "scenarios"):
        for file in (ROOT / top).rglob("*.py"):
            folder = file.parent.relative_to(ROOT)
            if not any((ROOT / part).is_symlink() for part in (folder, *folder.parents)):
                folders.add(folder.name)
    untold = [
        name for name in folders if not re.search(rf"`{name}`|\*\*(simbench\.)?{name}\*\*", PAGE)
    ]
    assert untold == []
