"""The walls of the house are not paint: each kind of forbidden arrow, drawn into the import graph,
breaks a contract.
"""

from __future__ import annotations

import ast
from copy import deepcopy
from importlib import import_module
from pathlib import Path

import grimp
import pytest
from importlinter.application.use_cases import read_user_options
from importlinter.configuration import configure

configure()
OPTIONS = read_user_options(str(Path(__file__).parents[1] / "pyproject.toml"))
CLASSES = {
    "layers": "LayersContract",
    "forbidden": "ForbiddenContract",
    "independence": "IndependenceContract",
    "protected": "ProtectedContract",
    "acyclic_siblings": "AcyclicSiblingsContract",
}
ROOMS = "the rooms of the diagnosis, none looking back"


@pytest.fixture(scope="module")
def house():
    return grimp.build_graph("simbench", include_external_packages=True, cache_dir=None)


def broken(graph, asked=lambda options: True):
    """Return the names of the contracts that a graph breaks, of those that are asked about."""
    out = set()
    for options in filter(asked, OPTIONS.contracts_options):
        kind = import_module(f"importlinter.contracts.{options['type']}")
        contract = getattr(kind, CLASSES[options["type"]])(
            options["name"], OPTIONS.session_options, options
        )
        if not contract.check(graph=deepcopy(graph), verbose=False).kept:
            out.add(options["name"])
    return out


@pytest.mark.parametrize(
    ("importer", "imported", "wall"),
    [
        ("simbench.gap.sensor.samples", "simbench.gap.decide.assess", ROOMS),
        (
            "simbench.gap.likelihood.model",
            "simbench.gap.likelihood.engine",
            "no circle in the whole house",
        ),
        (
            "simbench.loop.effects.stiction",
            "simbench.loop.setup",
            "a loop's plug-ins know nothing of the run they take part in",
        ),
        ("simbench.loop.setup", "simbench.gap.situation", "rooms stand above what they use"),
        ("simbench.detectors.quality", "simbench.loop.plant", "rooms stand above what they use"),
        ("simbench.detectors.quality", "matplotlib", "detectors is usable alone"),
    ],
)
def test_a_forbidden_arrow_breaks_its_wall(house, importer, imported, wall):
    graph = deepcopy(house)
    graph.add_import(importer=importer, imported=imported)
    # `lint-imports` checks that the package breaks none
    assert broken(graph, lambda options: options["name"] == wall) == {wall}


@pytest.mark.parametrize("module", ["simbench.gap.attic", "simbench.attic", "simbench.loop.attic"])
def test_a_module_without_a_place_breaks_the_order_of_rooms(house, module):
    graph = deepcopy(house)
    graph.add_module(module)
    assert broken(graph, lambda options: options["type"] == "layers")


PLUGINS = (
    "simbench.detectors.methods",
    "simbench.loop.valves",
    "simbench.loop.effects",
    "simbench.loop.plants",
    "simbench.loop.controllers",
    "simbench.gap.effects",
    "simbench.figures",
)
HOSTS = ("simbench.detectors.__main__",)
ROOT = Path(__file__).parents[1]


def doors(graph):
    """Return the modules where a user comes in: verbs, public names, plug-ins, and
    `python -m`.
    """
    modules = {"simbench.cli", *HOSTS} | graph.find_descendants("simbench.cli")
    for folder in PLUGINS:
        modules |= {
            m for m in graph.find_children(folder) if not m.rpartition(".")[2].startswith("_")
        }
    for stub in (ROOT / "simbench").rglob("*.pyi"):
        for node in ast.walk(ast.parse(stub.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                modules |= {
                    str(node.module),
                    *(f"{node.module}.{name.name}" for name in node.names),
                }
    return modules & graph.modules


def unreached(graph):
    """Return the modules of the wheel that no way from a door leads to; a package is reached with
    what it holds.
    """
    reached, ahead = set(), list(doors(graph))
    while ahead:
        module = ahead.pop()
        if module not in reached:
            reached.add(module)
            ahead += graph.find_modules_directly_imported_by(module)
    ours = {m for m in graph.modules if m.partition(".")[0] == "simbench"}
    return {m for m in ours - reached if not graph.find_children(m)}


def test_every_module_is_reached_from_a_verb_a_public_name_or_a_kind_of_plugin(house):
    assert unreached(house) == set()


def test_no_room_has_more_than_twenty_files_but_those_of_plugins():
    rooms = {
        p.parent
        for name in ("simbench", "detectors", "scenarios")
        for p in (ROOT / name).rglob("*.py")
    }
    # `simbench/detectors` is a link, whose files are met where they lie
    plugins = {(ROOT / folder.replace(".", "/")).resolve() for folder in PLUGINS}
    assert {str(r): n for r in rooms - plugins if (n := len(list(r.glob("*.py")))) > 20} == {}
