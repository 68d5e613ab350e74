"""What a package needs around its code: one version, a citation, typed markers, and every file in
the wheel.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import yaml

import simbench

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_every_file_repeats_one_version():
    version = PROJECT["version"]
    assert simbench.__version__ == version
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == version
    assert citation["license"] == PROJECT["license"]
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_documents_a_stranger_looks_for_are_there_and_linked():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    for name in ("CITATION.cff", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md", "LICENSE"):
        assert (ROOT / name).stat().st_size > 200
        assert name == "LICENSE" or f"({name})" in readme


def test_folders_named_in_contributing_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    folders = {part.rsplit("/", 1)[0] for part in text.split("`") if "/NAME." in part}
    assert len(folders) >= 6
    assert all((ROOT / folder).is_dir() for folder in folders)


def test_typed_markers_and_stubs_go_into_the_wheel():
    data = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
        "setuptools"
    ]["package-data"]
    for package in ("simbench", "simbench.detectors", "simbench.scenarios"):
        assert (ROOT / package.replace(".", "/") / "py.typed").exists()
        assert "py.typed" in data[package]
    assert "**/*.pyi" in data["simbench"]
